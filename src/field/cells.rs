//! Cells in which samples can count (spec 4.8), one bit per cell and one per block of cells: for lookup and for
//! empty-space skipping. Twin: `shaders/cells.wgsl`.

use glam::{DVec3, UVec3};

use super::{CellIndex, Real};
use crate::geometry::cell_at;
use crate::model::Occupancy;

/// A bit grid over cells. For an occupancy it decides as [`Occupancy::contains`] for points inside cells; a point on a
/// face belongs to the cell beyond the face.
#[derive(Clone, Debug)]
pub struct OccupancyCells<T> {
    pub(crate) min: [T; 3],
    pub(crate) cells_per_unit: [T; 3],
    cell_size: [T; 3],
    pub(crate) cells: [i32; 3],
    pub(crate) words: Vec<u64>,
    /// One bit per block of 8³ cells: small enough for the first-level cache, and enough for most lookups.
    pub(crate) blocks: [i32; 3],
    pub(crate) block_words: Vec<u64>,
}

/// Cells along a block's edge, as a shift.
pub(crate) const BLOCK_SHIFT: i32 = 3;

/// A span of a ray's path over which occupancy does not change.
#[derive(Clone, Copy, Debug)]
pub(super) struct Span<T> {
    /// True if samples in it count.
    pub(super) occupied: bool,
    /// Its approximate length along the path, in model units.
    pub(super) distance: T,
}

impl<T: Real> OccupancyCells<T> {
    /// Prepares `occupancy` for positions relative to `origin`. A cell is set if any of its corners is.
    pub fn new(occupancy: &Occupancy, origin: DVec3) -> Self {
        let cells = occupancy.vertices - 1;
        let mut grid = Self::empty(
            (occupancy.bounds.min - origin).to_array().map(T::of),
            (1.0 / occupancy.cell_size()).to_array().map(T::of),
            cells.as_ivec3().to_array(),
        );
        for vertex in occupancy.iter() {
            let first = vertex.saturating_sub(UVec3::ONE);
            let last = vertex.min(cells - 1);
            for z in first.z..=last.z {
                for y in first.y..=last.y {
                    for x in first.x..=last.x {
                        grid.set([x as i32, y as i32, z as i32]);
                    }
                }
            }
        }
        grid
    }

    /// The cells that any tensor of `index` reaches into. The grid is padded by a copy of its border, so that rounding
    /// cannot move a point on its outermost faces out of it.
    pub(super) fn from_index(index: &CellIndex<T>) -> Self {
        let (min, cells_per_unit, cells) = index.grid();
        let padded_min = [0, 1, 2].map(|a| min[a] - T::one() / cells_per_unit[a]);
        let mut grid = Self::empty(padded_min, cells_per_unit, cells.map(|c| c + 2));
        for (cell_index, _) in index.covered_cells().enumerate().filter(|c| c.1) {
            let cell = cell_at(cell_index as u64, cells.map(|c| c as u32).into()).to_array();
            let [xs, ys, zs] = [0, 1, 2].map(|a| {
                let c = cell[a] as i32;
                let first = if c == 0 { 0 } else { c + 1 };
                let last = if c + 1 == cells[a] { c + 2 } else { c + 1 };
                first..=last
            });
            for z in zs {
                for y in ys.clone() {
                    for x in xs.clone() {
                        grid.set([x, y, z]);
                    }
                }
            }
        }
        grid
    }

    fn empty(min: [T; 3], cells_per_unit: [T; 3], cells: [i32; 3]) -> Self {
        let blocks = cells.map(|c| ((c - 1) >> BLOCK_SHIFT) + 1);
        let words_for = |[x, y, z]: [i32; 3]| vec![0; (x as usize * y as usize * z as usize).div_ceil(64)];
        Self {
            min,
            cells_per_unit,
            cell_size: cells_per_unit.map(|c| T::one() / c),
            cells,
            words: words_for(cells),
            blocks,
            block_words: words_for(blocks),
        }
    }

    fn set(&mut self, cell: [i32; 3]) {
        let bit = bit_index(cell, self.cells);
        self.words[bit / 64] |= 1 << (bit % 64);
        let bit = bit_index(cell.map(|c| c >> BLOCK_SHIFT), self.blocks);
        self.block_words[bit / 64] |= 1 << (bit % 64);
    }

    /// True if samples at `position` count.
    #[inline(always)]
    pub fn contains(&self, position: [T; 3]) -> bool {
        self.lookup(self.in_cells(position)).is_some_and(|found| found.0)
    }

    /// True if any sample between `min` and `max`, or up to 0.01 cells beyond, counts.
    pub(super) fn any_in(&self, min: [T; 3], max: [T; 3]) -> bool {
        let slack = T::of(0.01);
        let (min, max) = (self.in_cells(min), self.in_cells(max));
        let [xs, ys, zs] = [0, 1, 2]
            .map(|a| (min[a] - slack).floor_i32().max(0)..=(max[a] + slack).floor_i32().min(self.cells[a] - 1));
        let is_set = |cell| {
            let bit = bit_index(cell, self.cells);
            self.words[bit / 64] >> (bit % 64) & 1 == 1
        };
        zs.into_iter().any(|z| ys.clone().any(|y| xs.clone().any(|x| is_set([x, y, z]))))
    }

    /// The span from `position` on, along a ray whose direction has the reciprocals `inverse` per axis.
    #[inline(always)]
    pub(super) fn span(&self, position: [T; 3], inverse: [T; 3]) -> Span<T> {
        let at = self.in_cells(position);
        let Some((occupied, width)) = self.lookup(at) else {
            return Span { occupied: false, distance: T::zero() };
        };
        let mut distance = T::infinity();
        for a in 0..3 {
            let lower = at[a].floor_i32() & !(width - 1);
            let face = if inverse[a] > T::zero() { lower + width } else { lower };
            distance = distance.min((T::of_i32(face) - at[a]) * self.cell_size[a] * inverse[a]);
        }
        Span { occupied, distance }
    }

    /// The span from `position` on, along a path in any direction that changes each coordinate by at most its length.
    #[inline(always)]
    pub(super) fn span_around(&self, position: [T; 3]) -> Span<T> {
        let at = self.in_cells(position);
        let Some((occupied, width)) = self.lookup(at) else {
            return Span { occupied: false, distance: T::zero() };
        };
        let mut distance = T::infinity();
        for a in 0..3 {
            let lower = at[a].floor_i32() & !(width - 1);
            let [below, above] = [at[a] - T::of_i32(lower), T::of_i32(lower + width) - at[a]];
            distance = distance.min(below.min(above) * self.cell_size[a]);
        }
        Span { occupied, distance }
    }

    #[inline(always)]
    fn in_cells(&self, position: [T; 3]) -> [T; 3] {
        [0, 1, 2].map(|a| (position[a] - self.min[a]) * self.cells_per_unit[a])
    }

    /// The value of the cell at `at`, and the width in cells of the cube around it that has the same value; `None`
    /// outside the grid.
    #[inline(always)]
    fn lookup(&self, at: [T; 3]) -> Option<(bool, i32)> {
        let cell = at.map(T::floor_i32);
        for a in 0..3 {
            if cell[a] < 0 || cell[a] >= self.cells[a] {
                return None;
            }
        }
        let block = bit_index(cell.map(|c| c >> BLOCK_SHIFT), self.blocks);
        if self.block_words[block / 64] >> (block % 64) & 1 == 0 {
            return Some((false, 1 << BLOCK_SHIFT));
        }
        let bit = bit_index(cell, self.cells);
        Some((self.words[bit / 64] >> (bit % 64) & 1 == 1, 1))
    }
}

#[inline(always)]
fn bit_index([x, y, z]: [i32; 3], sizes: [i32; 3]) -> usize {
    (z as usize * sizes[1] as usize + y as usize) * sizes[0] as usize + x as usize
}
