//! Occupancy by cells instead of vertices: one bit tells whether any corner of a cell is set.

use glam::{DVec3, IVec3, UVec3};

use super::Real;
use crate::model::Occupancy;

/// The decision of [`Occupancy::contains`] for points inside cells; on a face it is that of the cell beyond it.
#[derive(Clone, Debug)]
pub struct OccupancyCells<T> {
    min: [T; 3],
    cells_per_unit: [T; 3],
    cells: [i32; 3],
    words: Vec<u64>,
}

impl<T: Real> OccupancyCells<T> {
    /// Prepares `occupancy` for positions relative to `origin`.
    pub fn new(occupancy: &Occupancy, origin: DVec3) -> Self {
        let cells = occupancy.vertices - 1;
        let mut grid = Self {
            min: (occupancy.bounds.min - origin).to_array().map(T::of),
            cells_per_unit: (1.0 / occupancy.cell_size()).to_array().map(T::of),
            cells: cells.as_ivec3().to_array(),
            words: vec![0; (cells.x as usize * cells.y as usize * cells.z as usize).div_ceil(64)],
        };
        for vertex in occupancy.iter() {
            let first = vertex.saturating_sub(UVec3::ONE);
            let last = vertex.min(cells - 1);
            for z in first.z..=last.z {
                for y in first.y..=last.y {
                    for x in first.x..=last.x {
                        let bit = grid.bit(IVec3::new(x as i32, y as i32, z as i32).to_array());
                        grid.words[bit / 64] |= 1 << (bit % 64);
                    }
                }
            }
        }
        grid
    }

    #[inline(always)]
    fn bit(&self, [x, y, z]: [i32; 3]) -> usize {
        (z as usize * self.cells[1] as usize + y as usize) * self.cells[0] as usize + x as usize
    }

    /// Whether samples at `position` count.
    #[inline(always)]
    pub fn contains(&self, position: [T; 3]) -> bool {
        let mut at = [0; 3];
        for a in 0..3 {
            at[a] = ((position[a] - self.min[a]) * self.cells_per_unit[a]).floor_i32();
            if at[a] < 0 || at[a] >= self.cells[a] {
                return false;
            }
        }
        let bit = self.bit(at);
        self.words[bit / 64] >> (bit % 64) & 1 == 1
    }
}
