//! The occupancy grid: the region in which samples count (spec 3.6).

use glam::{DVec3, UVec3};

use crate::Invalid;
use crate::geometry::{Aabb, cell_at, index_of};

/// One bit for each vertex of a regular grid whose outermost vertices lie on the faces of `bounds`.
///
/// A point is occupied if the trilinear interpolation of the bits is positive: it is in the box, and a vertex of
/// nonzero weight is set (spec 4.8).
#[derive(Clone, Debug, PartialEq)]
pub struct Occupancy {
    /// The box of the grid, in model units.
    pub bounds: Aabb,
    /// Vertices along x, y and z, at least 2 each.
    pub vertices: UVec3,
    /// Bit (z·Y + y)·X + x of the whole, 64 to a word, least significant first; unused bits are 0.
    pub words: Vec<u64>,
}

impl Occupancy {
    /// A grid of unset vertices.
    pub fn empty(bounds: Aabb, vertices: UVec3) -> Self {
        let bits = vertices.x as usize * vertices.y as usize * vertices.z as usize;
        Self { bounds, vertices, words: vec![0; bits.div_ceil(64)] }
    }

    /// The bits in bytes, least significant first; unused bits of the last one are 0.
    pub fn bytes(&self) -> Vec<u8> {
        let mut bytes: Vec<u8> = self.words.iter().flat_map(|word| word.to_le_bytes()).collect();
        bytes.truncate(self.vertices.as_u64vec3().element_product().div_ceil(8) as usize);
        bytes
    }

    /// The bit number of `vertex`.
    pub fn index(&self, vertex: UVec3) -> usize {
        index_of(vertex, self.vertices) as usize
    }

    /// True if `vertex` is set.
    pub fn get(&self, vertex: UVec3) -> bool {
        let bit = self.index(vertex);
        self.words[bit / 64] >> (bit % 64) & 1 == 1
    }

    /// Sets `vertex`.
    pub fn set(&mut self, vertex: UVec3) {
        let bit = self.index(vertex);
        self.words[bit / 64] |= 1 << (bit % 64);
    }

    /// The position of `vertex`, in model units.
    pub fn position(&self, vertex: UVec3) -> DVec3 {
        self.bounds.min + vertex.as_dvec3() / (self.vertices.as_dvec3() - 1.0) * self.bounds.size()
    }

    /// Edge lengths of a cell between vertices, in model units.
    pub fn cell_size(&self) -> DVec3 {
        self.bounds.size() / (self.vertices.as_dvec3() - 1.0)
    }

    /// Number of set vertices.
    pub fn count(&self) -> u64 {
        self.words.iter().map(|w| u64::from(w.count_ones())).sum()
    }

    /// The set vertices, in storage order.
    pub fn iter(&self) -> impl Iterator<Item = UVec3> + '_ {
        self.words.iter().enumerate().flat_map(move |(i, &word)| {
            let set = (0..64).filter(move |b| word >> b & 1 == 1);
            set.map(move |b| cell_at(i as u64 * 64 + b, self.vertices))
        })
    }

    /// With what lies between set vertices: all but the vertices of cubes of `2·radius + 1` vertices along each edge, some perhaps
    /// beyond the bounds, without a set one (morphological closing).
    pub fn closed(&self, radius: u32) -> Self {
        let margin = UVec3::splat(radius);
        // Behind a margin, words may be shifted as a whole: what passes from one row into the next stays in the margins.
        let mut wide = Self::empty(self.bounds, self.vertices + 2 * margin);
        self.iter().for_each(|vertex| wide.set(vertex + margin));
        wide.join_around(radius, |a, b| a | b);
        wide.join_around(radius, |a, b| a & b);
        let mut closed = Self::empty(self.bounds, self.vertices);
        let within = wide.iter().filter_map(|vertex| vertex.checked_sub(margin));
        within.filter(|vertex| vertex.cmplt(self.vertices).all()).for_each(|vertex| closed.set(vertex));
        closed
    }

    /// Replaces each bit by all those of the cube of this `radius` around it, joined by `join`.
    fn join_around(&mut self, radius: u32, join: impl Fn(u64, u64) -> u64) {
        let strides = [1, self.vertices.x, self.vertices.x * self.vertices.y].map(i64::from);
        for stride in strides {
            let bits_at = |bit: i64| {
                let word = |at: i64| usize::try_from(at).ok().and_then(|at| self.words.get(at)).copied().unwrap_or(0);
                let (first, shift) = (bit.div_euclid(64), bit.rem_euclid(64));
                word(first) >> shift | word(first + 1) << 1 << (63 - shift)
            };
            let offsets = || -i64::from(radius)..=i64::from(radius);
            let around = |word: usize| offsets().map(|n| bits_at(64 * word as i64 + n * stride)).reduce(&join);
            self.words = (0..self.words.len()).map(|word| around(word).unwrap_or(0)).collect();
        }
    }

    /// The vertices of a row from `first` on, which is within the grid, from the lowest bit on; zeros beyond the row.
    pub fn row_from(&self, first: UVec3) -> u64 {
        let [columns, rows] = [self.vertices.x, self.vertices.y].map(u64::from);
        let bit = (u64::from(first.z) * rows + u64::from(first.y)) * columns + u64::from(first.x);
        let (word, shift) = ((bit / 64) as usize, bit % 64);
        let next = self.words.get(word + 1).copied().unwrap_or(0);
        let bits = self.words[word] >> shift | next << 1 << (63 - shift);
        bits & (u64::MAX >> (64 - u64::from(self.vertices.x - first.x).min(64)))
    }

    /// The position of `point` in cells from the first vertex, per axis from 0 to vertices − 1 within the bounds.
    pub fn cell_coordinates(&self, point: DVec3) -> DVec3 {
        (point - self.bounds.min) / self.bounds.size() * (self.vertices.as_dvec3() - 1.0)
    }

    /// True if `point`, in model units, is occupied.
    pub fn contains(&self, point: DVec3) -> bool {
        if !self.bounds.contains(point) {
            return false;
        }
        let at = self.cell_coordinates(point);
        let first = at.floor().as_uvec3().min(self.vertices - 2);
        let fraction = at - first.as_dvec3();
        corners().any(|corner| {
            let weight = (0..3).map(|a| if corner[a] == 1 { fraction[a] } else { 1.0 - fraction[a] }).product::<f64>();
            weight > 0.0 && self.get(first + corner)
        })
    }

    /// True if any point of the closed box `within` is occupied.
    pub fn meets(&self, within: &Aabb) -> bool {
        let last = self.vertices.as_dvec3() - 1.0;
        let (low, high) = (self.cell_coordinates(within.min), self.cell_coordinates(within.max));
        let is_inside = low.cmple(last).all() && high.cmpge(DVec3::ZERO).all() && low.cmple(high).all();
        // A vertex counts in the open cells around it: from less than 1 before to less than 1 behind it.
        let (first, end) = (low.max(DVec3::ZERO).floor().as_uvec3(), high.min(last).ceil().as_uvec3());
        let mut rows = (first.z..=end.z).flat_map(|z| (first.y..=end.y).map(move |y| (y, z)));
        is_inside && rows.any(|(y, z)| (first.x..=end.x).any(|x| self.get(UVec3::new(x, y, z))))
    }

    /// True if any of the eight vertices of the cell with the smallest vertex `cell` is set: the decision for the
    /// cell's interior. Cells outside the grid are not occupied.
    pub fn cell_is_occupied(&self, cell: glam::IVec3) -> bool {
        let inside = cell.cmpge(glam::IVec3::ZERO).all() && cell.cmplt(self.vertices.as_ivec3() - 1).all();
        inside && corners().any(|corner| self.get(cell.as_uvec3() + corner))
    }

    pub(super) fn check(&self) -> Result<(), Invalid> {
        if !self.bounds.is_solid() {
            return Err(Invalid::new("occupancy bounds", "a finite box of positive size", self.bounds));
        }
        if self.vertices.min_element() < 2 {
            return Err(Invalid::new("occupancy vertices", "at least 2 along each axis", self.vertices));
        }
        let bits = self.vertices.to_array().iter().map(|&v| u128::from(v)).product::<u128>();
        Invalid::unless_equal(|| "occupancy words".into(), bits.div_ceil(64), self.words.len() as u128)?;
        let used = (bits % 64) as u32;
        if used != 0 && self.words.last().is_some_and(|w| w >> used != 0) {
            return Err(Invalid::new("unused bits of the occupancy words", "zeros", "a set bit past the last vertex"));
        }
        Ok(())
    }
}

fn corners() -> impl Iterator<Item = UVec3> {
    (0..8).map(|c| UVec3::new(c & 1, c >> 1 & 1, c >> 2))
}

#[cfg(test)]
mod tests {
    use glam::IVec3;

    use super::*;
    use crate::random::Random;

    fn one_vertex() -> Occupancy {
        let mut grid = Occupancy::empty(Aabb { min: DVec3::ZERO, max: DVec3::splat(4.0) }, UVec3::splat(5));
        grid.set(UVec3::new(2, 2, 2));
        grid
    }

    #[test]
    fn a_vertex_counts_in_the_open_cells_around_it() {
        let grid = one_vertex();
        assert!(grid.contains(DVec3::splat(2.0)));
        assert!(grid.contains(DVec3::new(1.001, 2.999, 2.0)));
        assert!(!grid.contains(DVec3::new(1.0, 2.0, 2.0)), "weight 0 on the far face");
        assert!(!grid.contains(DVec3::new(3.0, 2.0, 2.0)));
        assert!(!grid.contains(DVec3::splat(-1.0)));
    }

    #[test]
    fn a_box_is_met_where_it_has_a_point_that_counts() {
        let mut grid = one_vertex();
        let meets = |grid: &Occupancy, min: [f64; 3], max: [f64; 3]| {
            grid.meets(&Aabb { min: DVec3::from(min), max: DVec3::from(max) })
        };
        assert!(meets(&grid, [0.0; 3], [4.0; 3]));
        assert!(meets(&grid, [2.9; 3], [9.0; 3]) && meets(&grid, [-9.0; 3], [1.1; 3]));
        assert!(meets(&grid, [1.5; 3], [1.5; 3]), "a point");
        assert!(!meets(&grid, [3.0, 0.0, 0.0], [4.0; 3]), "weight 0 on the face that both share");
        assert!(!meets(&grid, [0.0; 3], [4.0, 1.0, 4.0]));
        assert!(!meets(&grid, [1.0, 1.0, 4.5], [3.0, 3.0, 9.0]) && !grid.meets(&Aabb::EMPTY));
        grid.set(UVec3::splat(4));
        assert!(meets(&grid, [4.0; 3], [9.0; 3]), "a vertex on the border");
        assert!(!meets(&grid, [4.0 + 1e-9, 0.0, 0.0], [9.0; 3]), "nothing counts outside");
        // Both rules agree: a box is met exactly where a point of it counts.
        for n in 0..4096_u32 {
            let at = |shift: u32| f64::from(n >> shift & 7) * 0.5 + 0.25;
            let corner = DVec3::new(at(0), at(3), at(6));
            let cube = Aabb { min: corner, max: corner + f64::from(n >> 9) * 0.125 };
            let points = (0..27).map(|k| {
                let step = UVec3::new(k % 3, k / 3 % 3, k / 9).as_dvec3() / 2.0;
                cube.min + step * cube.size()
            });
            assert_eq!(grid.meets(&cube), points.into_iter().any(|p| grid.contains(p)), "{cube:?}");
        }
    }

    #[test]
    fn set_vertices_are_iterated_with_their_coordinates() {
        let mut grid = one_vertex();
        grid.set(UVec3::new(4, 0, 4));
        assert_eq!(grid.iter().collect::<Vec<_>>(), [UVec3::new(2, 2, 2), UVec3::new(4, 0, 4)]);
        assert_eq!(grid.count(), 2);
    }

    #[test]
    fn closing_fills_all_that_no_empty_cube_covers() {
        let vertices = UVec3::new(13, 9, 11);
        let random = Random::new(5, "occupancy to close");
        let mut grid = Occupancy { vertices, ..one_vertex() };
        grid.words = vec![0; (13 * 9 * 11_usize).div_ceil(64)];
        let all = || (0..13 * 9 * 11).map(|n| cell_at(n, vertices));
        all().zip(0..).filter(|&(_, n)| random.below(n, 12) == 0).for_each(|(vertex, _)| grid.set(vertex));
        let is_set =
            |at: IVec3| at.cmpge(IVec3::ZERO).all() && at.cmplt(vertices.as_ivec3()).all() && grid.get(at.as_uvec3());
        let around = |radius: i32| {
            let offsets = move || -radius..=radius;
            offsets().flat_map(move |z| offsets().flat_map(move |y| offsets().map(move |x| IVec3::new(x, y, z))))
        };
        for radius in 0..3 {
            let closed = grid.closed(radius);
            closed.check().unwrap();
            for vertex in all() {
                let is_covered = |center: IVec3| around(radius as i32).any(|offset| is_set(center + offset));
                let expected = around(radius as i32).all(|offset| is_covered(vertex.as_ivec3() + offset));
                assert_eq!(closed.get(vertex), expected, "{vertex}, {radius}");
            }
            assert_eq!(closed.closed(radius), closed);
            assert_eq!(radius == 0, closed == grid);
        }
    }

    #[test]
    fn a_bit_past_the_last_vertex_is_named() {
        let mut grid = one_vertex();
        *grid.words.last_mut().unwrap() |= 1 << 63;
        assert_eq!(grid.check().unwrap_err().place.to_string(), "unused bits of the occupancy words");
    }
}
