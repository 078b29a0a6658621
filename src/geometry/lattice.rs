//! Regular lattices of box cells.

use glam::{DVec3, IVec3};

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
