//! Cells in which samples can count (spec 4.8), one bit per cell, in bricks that store their distance to the nearest
//! such cells: for lookup and for empty-space skipping. Twin: `shaders/cells.wgsl`.

use glam::{DVec3, UVec3};

use super::{CellIndex, Real};
use strivec_format::geometry::cell_at;
use strivec_format::model::Occupancy;

/// A bit grid over cells. For an occupancy it decides as [`Occupancy::contains`] for points inside cells; a point on a
/// face belongs to the cell beyond the face.
#[derive(Clone, Debug)]
pub struct OccupancyCells<T> {
    /// Lowest corner of the grid, relative to the field's origin.
    pub min: [T; 3],
    /// Cells per model unit, per axis.
    pub cells_per_unit: [T; 3],
    cell_size: [T; 3],
    /// Number of cells, per axis.
    pub cells: [i32; 3],
    /// Number of bricks of 4³ cells, per axis.
    pub bricks: [i32; 3],
    /// \[brick\] one bit per cell, x fastest.
    pub masks: Vec<u64>,
    /// \[brick\] the Chebyshev distance in bricks to the nearest brick with a set cell, at most 255.
    pub distances: Vec<u8>,
}

/// Cells along a brick's edge, as a shift.
/// The 4³ cells of a brick are the bits of a word. Rays cross empty space in strides as wide as a brick's distance: a
/// frame's march takes 0.42 of the time that bits in blocks of 8³ cells took
/// (docs/experiments/2026-11-26-tight-occupancy.md).
const BRICK_SHIFT: i32 = 2;

/// The bits of the 2³ cells at a brick's lower corner.
/// Beside surfaces, where bricks are not empty, a stride can still have two cells.
const OCTANT: u64 = 0x33_0033;

/// A cube of cells that are alike.
#[derive(Clone, Copy, Debug)]
struct Cube {
    occupied: bool,
    /// The cell of the smallest coordinates. It may lie outside the grid, which is empty there.
    lower: [i32; 3],
    /// Cells along its edge.
    width: i32,
}

/// A span of a ray's path over which occupancy does not change.
#[derive(Clone, Copy, Debug)]
pub(super) struct Span<T> {
    /// True if samples in it count.
    pub(super) occupied: bool,
    /// Approximate length of the span along the path, in model units or, along a line, in steps.
    pub(super) distance: T,
}

/// A straight path, in cells. Its samples are a step apart.
#[derive(Clone, Copy, Debug)]
pub(super) struct Line<T> {
    /// Position of the first sample, in cells.
    first: [T; 3],
    /// The way from a sample to the next.
    per_step: [T; 3],
    /// Steps from one cell to the next, per axis.
    steps_per_cell: [T; 3],
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
        // Cells of a row that are found together, whole bricks of them: two vertices of each are within a word.
        const TOGETHER: u32 = 60;
        // By rows of bits, not cell by cell, with which a grid of 2²⁸ set vertices took seconds.
        for z in 0..cells.z {
            for y in 0..cells.y {
                for x in (0..cells.x).step_by(TOGETHER as usize) {
                    let rows = [(y, z), (y + 1, z), (y, z + 1), (y + 1, z + 1)];
                    let vertices = rows.iter().fold(0, |all, &(y, z)| all | occupancy.row_from(UVec3::new(x, y, z)));
                    let mut set = (vertices | vertices >> 1) & (u64::MAX >> (64 - TOGETHER.min(cells.x - x)));
                    let mut cell = [x as i32, y as i32, z as i32];
                    while set != 0 {
                        let brick = grid.brick_of(cell);
                        let found = set & ((1 << (1 << BRICK_SHIFT)) - 1);
                        if found != 0 {
                            grid.masks[brick] |= found << bit_in_brick(cell);
                            grid.distances[brick] = 0;
                        }
                        set >>= 1 << BRICK_SHIFT;
                        cell[0] += 1 << BRICK_SHIFT;
                    }
                }
            }
        }
        grid.measure_distances();
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
        grid.measure_distances();
        grid
    }

    fn empty(min: [T; 3], cells_per_unit: [T; 3], cells: [i32; 3]) -> Self {
        let bricks = cells.map(|c| ((c - 1) >> BRICK_SHIFT) + 1);
        let count = bricks.iter().map(|&b| b as usize).product();
        Self {
            min,
            cells_per_unit,
            cell_size: cells_per_unit.map(|c| T::one() / c),
            cells,
            bricks,
            masks: vec![0; count],
            distances: vec![u8::MAX; count],
        }
    }

    fn set(&mut self, cell: [i32; 3]) {
        let brick = self.brick_of(cell);
        self.masks[brick] |= 1 << bit_in_brick(cell);
        self.distances[brick] = 0;
    }

    /// Fills `distances`, in which the bricks with a set cell have 0 and all others 255: in one pass over all bricks from
    /// their neighbors with smaller indices, and in one backwards from the others.
    fn measure_distances(&mut self) {
        let [columns, rows, layers] = self.bricks;
        // A byte saturates at 255 bricks; farther away, a ray only takes a stride more.
        let spread = |distances: &mut [u8], [x, y, z]: [i32; 3], sign: i32| {
            let at = |x: i32, y: i32, z: i32| ((z * rows + y) * columns + x) as usize;
            let mut least = distances[at(x, y, z)];
            // Of the 26 neighbors, the 13 that come before the brick in the pass.
            for n in 0..13 {
                let [i, j, k] = [n % 3 - 1, n / 3 % 3 - 1, n / 9 - 1].map(|d| d * sign);
                let (x, y, z) = (x + i, y + j, z + k);
                if (0..columns).contains(&x) && (0..rows).contains(&y) && (0..layers).contains(&z) {
                    least = least.min(distances[at(x, y, z)].saturating_add(1));
                }
            }
            distances[at(x, y, z)] = least;
        };
        let count = self.distances.len() as u64;
        let bricks = self.bricks.map(|b| b as u32).into();
        let brick = |index| cell_at(index, bricks).as_ivec3().to_array();
        // Two passes are exact for the Chebyshev distance.
        (0..count).for_each(|index| spread(&mut self.distances, brick(index), 1));
        (0..count).rev().for_each(|index| spread(&mut self.distances, brick(index), -1));
    }

    /// True if samples at `position` count.
    #[inline(always)]
    pub fn contains(&self, position: [T; 3]) -> bool {
        self.lookup(self.in_cells(position)).is_some_and(|cube| cube.occupied)
    }

    /// True if any sample between `min` and `max`, or up to 0.01 cells beyond, counts.
    pub(super) fn any_in(&self, min: [T; 3], max: [T; 3]) -> bool {
        // Rounding in T may move a corner of the box to the other side of a face.
        let slack = T::of(0.01);
        let (min, max) = (self.in_cells(min), self.in_cells(max));
        let [xs, ys, zs] = [0, 1, 2]
            .map(|a| (min[a] - slack).floor_i32().max(0)..=(max[a] + slack).floor_i32().min(self.cells[a] - 1));
        let is_set = |cell| self.masks[self.brick_of(cell)] >> bit_in_brick(cell) & 1 == 1;
        zs.into_iter().any(|z| ys.clone().any(|y| xs.clone().any(|x| is_set([x, y, z]))))
    }

    /// The span from `position` on, along a ray whose direction has the reciprocals `inverse` per axis.
    #[inline(always)]
    pub(super) fn span(&self, position: [T; 3], inverse: [T; 3]) -> Span<T> {
        self.span_to_faces(self.in_cells(position), [0, 1, 2].map(|a| self.cell_size[a] * inverse[a]))
    }

    /// The span from `at`, in cells, on, along a path that crosses a cell on an axis in a length of `per_cell`, which has
    /// the direction's sign.
    #[inline(always)]
    fn span_to_faces(&self, at: [T; 3], per_cell: [T; 3]) -> Span<T> {
        let Some(Cube { occupied, lower, width }) = self.lookup(at) else {
            // Outside the grid nothing is known of the next cells: the march goes on by one sample.
            return Span { occupied: false, distance: T::zero() };
        };
        let mut distance = T::infinity();
        for a in 0..3 {
            let face = if per_cell[a] > T::zero() { lower[a] + width } else { lower[a] };
            // The reciprocal of a direction's zero is finite, so that this is a number at a face, too.
            distance = distance.min((T::of_i32(face) - at[a]) * per_cell[a]);
        }
        Span { occupied, distance }
    }

    /// The path from `position` along `direction`, with its reciprocals `inverse`, in steps of the length `step`.
    #[inline(always)]
    pub(super) fn line(&self, position: [T; 3], direction: DVec3, inverse: [T; 3], step: f64) -> Line<T> {
        Line {
            first: self.in_cells(position),
            per_step: [0, 1, 2].map(|a| T::of(direction[a] * step) * self.cells_per_unit[a]),
            steps_per_cell: [0, 1, 2].map(|a| self.cell_size[a] * T::of(1.0 / step) * inverse[a]),
        }
    }

    /// The span from the sample `index` of `line` on. Its length is in steps.
    #[inline(always)]
    pub(super) fn span_of_line(&self, line: &Line<T>, index: u32) -> Span<T> {
        let steps = T::of_i32(index as i32);
        let at = [0, 1, 2].map(|a| line.first[a] + steps * line.per_step[a]);
        self.span_to_faces(at, line.steps_per_cell)
    }

    /// The span from `position` on, along a path in any direction that changes each coordinate by at most its length.
    #[inline(always)]
    pub(super) fn span_around(&self, position: [T; 3]) -> Span<T> {
        let at = self.in_cells(position);
        let Some(Cube { occupied, lower, width }) = self.lookup(at) else {
            return Span { occupied: false, distance: T::zero() };
        };
        let mut distance = T::infinity();
        for a in 0..3 {
            let [below, above] = [at[a] - T::of_i32(lower[a]), T::of_i32(lower[a] + width) - at[a]];
            distance = distance.min(below.min(above) * self.cell_size[a]);
        }
        Span { occupied, distance }
    }

    #[inline(always)]
    fn in_cells(&self, position: [T; 3]) -> [T; 3] {
        [0, 1, 2].map(|a| (position[a] - self.min[a]) * self.cells_per_unit[a])
    }

    /// The cube of cells around `at`, in cells, that are known to be alike; `None` outside the grid.
    #[inline(always)]
    fn lookup(&self, at: [T; 3]) -> Option<Cube> {
        let cell = at.map(T::floor_i32);
        for a in 0..3 {
            if cell[a] < 0 || cell[a] >= self.cells[a] {
                return None;
            }
        }
        let brick = self.brick_of(cell);
        // The brick's distance spares a look at each brick on the way.
        let distance = i32::from(self.distances[brick]);
        if distance > 0 {
            let lower = cell.map(|c| ((c >> BRICK_SHIFT) + 1 - distance) << BRICK_SHIFT);
            return Some(Cube { occupied: false, lower, width: (2 * distance - 1) << BRICK_SHIFT });
        }
        let mask = self.masks[brick];
        let occupied = mask >> bit_in_brick(cell) & 1 == 1;
        let corner = cell.map(|c| c & !1);
        let octant = mask >> bit_in_brick(corner) & OCTANT;
        let is_alike = octant == if occupied { OCTANT } else { 0 };
        Some(Cube { occupied, lower: if is_alike { corner } else { cell }, width: 1 + i32::from(is_alike) })
    }

    #[inline(always)]
    fn brick_of(&self, cell: [i32; 3]) -> usize {
        let [x, y, z] = cell.map(|c| (c >> BRICK_SHIFT) as usize);
        (z * self.bricks[1] as usize + y) * self.bricks[0] as usize + x
    }
}

/// The bit of `cell` in its brick's mask.
#[inline(always)]
fn bit_in_brick(cell: [i32; 3]) -> i32 {
    let [x, y, z] = cell.map(|c| c & ((1 << BRICK_SHIFT) - 1));
    (z << (2 * BRICK_SHIFT)) + (y << BRICK_SHIFT) + x
}

#[cfg(test)]
mod tests {
    use super::*;
    use strivec_format::geometry::Aabb;
    use strivec_format::random::Random;

    fn grid() -> Occupancy {
        let random = Random::new(5, "cells");
        let vertices = UVec3::new(43, 30, 51);
        let mut grid = Occupancy::empty(Aabb { min: DVec3::ZERO, max: vertices.as_dvec3() - 1.0 }, vertices);
        for block in 0..12 {
            let below = |axis: u64, end: u32| random.below(4 * block + axis, u64::from(end)) as u32;
            let corner = UVec3::new(below(0, vertices.x), below(1, vertices.y), below(2, vertices.z));
            let end = vertices.min(corner + 1 + below(3, 6));
            for z in corner.z..end.z {
                for y in corner.y..end.y {
                    (corner.x..end.x).for_each(|x| grid.set(UVec3::new(x, y, z)));
                }
            }
        }
        grid
    }

    #[test]
    fn cubes_hold_their_cell_and_are_alike_throughout() {
        let occupancy = grid();
        let cells = OccupancyCells::<f64>::new(&occupancy, DVec3::ZERO);
        let mut widths = std::collections::BTreeSet::new();
        for index in 0..(42 * 29 * 50) {
            let cell = cell_at(index, UVec3::new(42, 29, 50)).as_ivec3();
            let cube = cells.lookup((cell.as_dvec3() + 0.5).to_array()).expect("a cell of the grid");
            widths.insert((cube.occupied, cube.width));
            let lower = glam::IVec3::from(cube.lower);
            assert!(cell.cmpge(lower).all() && cell.cmplt(lower + cube.width).all(), "{cell} in {cube:?}");
            for n in 0..cube.width.pow(3) {
                let other = lower + cell_at(n as u64, UVec3::splat(cube.width as u32)).as_ivec3();
                assert_eq!(occupancy.cell_is_occupied(other), cube.occupied, "{other} in {cube:?} of {cell}");
            }
        }
        assert!(widths.is_superset(&[(false, 1), (false, 2), (false, 4), (false, 12), (true, 1), (true, 2)].into()));
        assert!(cells.lookup([-0.5, 3.0, 3.0]).is_none() && cells.lookup([3.0, 3.0, 50.5]).is_none());
    }

    #[test]
    fn distances_are_those_of_an_exhaustive_search() {
        let cells = OccupancyCells::<f32>::new(&grid(), DVec3::ZERO);
        let bricks: Vec<_> = (0..cells.masks.len() as u64)
            .map(|brick| cell_at(brick, cells.bricks.map(|b| b as u32).into()).as_ivec3())
            .collect();
        for (brick, &distance) in bricks.iter().zip(&cells.distances) {
            let set = bricks.iter().zip(&cells.masks).filter(|other| *other.1 != 0);
            let nearest = set.map(|other| (other.0 - brick).abs().max_element()).min();
            assert_eq!(nearest, Some(i32::from(distance)), "{brick}");
        }
    }
}
