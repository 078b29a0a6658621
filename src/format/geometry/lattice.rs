//! Regular lattices of box cells, and the numbering of the cells of a box.

use glam::{DVec3, IVec3, UVec3};

/// A lattice of box cells: cell (i, j, k) spans `origin` + (i, j, k)·`pitch` to `origin` + (i+1, j+1, k+1)·`pitch`.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct Lattice {
    /// The smallest corner of cell (0, 0, 0).
    pub origin: DVec3,
    /// Edge lengths of a cell.
    pub pitch: DVec3,
}

impl Lattice {
    /// The cell that contains `point`; a point on a face belongs to the larger cell.
    pub fn cell_of(&self, point: DVec3) -> IVec3 {
        ((point - self.origin) / self.pitch).floor().as_ivec3()
    }

    /// The center of `cell`.
    pub fn center(&self, cell: IVec3) -> DVec3 {
        self.origin + (cell.as_dvec3() + 0.5) * self.pitch
    }
}

/// The number of `cell` among those of a box of `extent` cells along x, y and z: x fastest, z slowest.
#[inline]
pub fn index_of(cell: UVec3, extent: UVec3) -> u64 {
    let [x, y, z] = cell.to_array().map(u64::from);
    (z * u64::from(extent.y) + y) * u64::from(extent.x) + x
}

/// The cell of number `index`, the inverse of [`index_of`].
#[inline]
pub fn cell_at(index: u64, extent: UVec3) -> UVec3 {
    let (row, x) = (index / u64::from(extent.x), index % u64::from(extent.x));
    let (z, y) = (row / u64::from(extent.y), row % u64::from(extent.y));
    UVec3::new(x as u32, y as u32, z as u32)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_count_x_fastest() {
        let extent = UVec3::new(2, 3, 4);
        assert_eq!(index_of(UVec3::new(1, 2, 3), extent), 23);
        for index in 0..24 {
            assert_eq!(index_of(cell_at(index, extent), extent), index);
        }
        assert_eq!(cell_at(6, extent), UVec3::new(0, 0, 1));
    }
}
