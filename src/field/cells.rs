//! Occupancy by cells instead of vertices: one bit tells whether any corner of a cell is set.

use glam::{DVec3, UVec3};

use super::Real;
use crate::model::Occupancy;

/// The decision of [`Occupancy::contains`] for points inside cells; on a face it is that of the cell beyond it.
#[derive(Clone, Debug)]
pub struct OccupancyCells<T> {
    min: [T; 3],
    cells_per_unit: [T; 3],
    cells: [i32; 3],
    words: Vec<u64>,
    /// One bit a block of cells, 8 wide: small enough for the fastest cache, where most answers come from.
    blocks: [i32; 3],
    block_words: Vec<u64>,
}

/// Cells along a block's edge, as a shift.
const BLOCK_SHIFT: i32 = 3;

impl<T: Real> OccupancyCells<T> {
    /// Prepares `occupancy` for positions relative to `origin`.
    pub fn new(occupancy: &Occupancy, origin: DVec3) -> Self {
        let cells = occupancy.vertices - 1;
        let mut grid = Self {
            min: (occupancy.bounds.min - origin).to_array().map(T::of),
            cells_per_unit: (1.0 / occupancy.cell_size()).to_array().map(T::of),
            cells: cells.as_ivec3().to_array(),
            words: words_for(cells),
            blocks: ((cells - 1) / (1 << BLOCK_SHIFT) + 1).as_ivec3().to_array(),
            block_words: words_for((cells - 1) / (1 << BLOCK_SHIFT) + 1),
        };
        for vertex in occupancy.iter() {
            let first = vertex.saturating_sub(UVec3::ONE);
            let last = vertex.min(cells - 1);
            for z in first.z..=last.z {
                for y in first.y..=last.y {
                    for x in first.x..=last.x {
                        let cell = [x as i32, y as i32, z as i32];
                        let bit = bit_number(cell, grid.cells);
                        grid.words[bit / 64] |= 1 << (bit % 64);
                        let bit = bit_number(cell.map(|c| c >> BLOCK_SHIFT), grid.blocks);
                        grid.block_words[bit / 64] |= 1 << (bit % 64);
                    }
                }
            }
        }
        grid
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
        let block = bit_number(at.map(|c| c >> BLOCK_SHIFT), self.blocks);
        if self.block_words[block / 64] >> (block % 64) & 1 == 0 {
            return false;
        }
        let bit = bit_number(at, self.cells);
        self.words[bit / 64] >> (bit % 64) & 1 == 1
    }
}

#[inline(always)]
fn bit_number([x, y, z]: [i32; 3], sizes: [i32; 3]) -> usize {
    (z as usize * sizes[1] as usize + y as usize) * sizes[0] as usize + x as usize
}

fn words_for(sizes: UVec3) -> Vec<u64> {
    vec![0; (sizes.x as usize * sizes.y as usize * sizes.z as usize).div_ceil(64)]
}
