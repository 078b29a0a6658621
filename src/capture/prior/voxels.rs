//! The cells of a lattice that points, triangles and boxes occupy.

use std::collections::HashMap;

use glam::{DVec3, I64Vec3, IVec3, UVec3, Vec3};

use super::Remedy;
use super::overlap::{Convex, Octahedron, Triangle, meets};
use super::{BuildError, Error, VoxelBoxes};
use strivec_format::geometry::{Aabb, Lattice};

/// Occupied cells; each takes about 50 bytes.
pub const MAX_CELLS: u64 = 1 << 25;
/// Tests of a triangle or box against a block of cells, over all geometry: some minutes of work.
const MAX_VISITS: u64 = 1 << 32;
/// Distance in cells that counts as rounding: an axis-aligned box that reaches this far into a cell does not share it,
/// and a surface this far from a cell touches it.
const FUZZ: f64 = 1e-6;
/// Bound on the error of a coordinate in the tests, relative to the largest coordinate.
const ROUNDING: f64 = 8.0 * f64::EPSILON;
/// Length of a splat's half axis, in cells: the far background of a scene has splats of any size.
const MAX_SPLAT: f64 = 8.0;
/// Colors per cell that enter its mean, so that sums do not overflow.
const MAX_COLORED: u32 = 1 << 24;

/// The occupied cells of a lattice.
#[derive(Clone, Debug)]
pub(super) struct Voxels {
    lattice: Lattice,
    /// Geometry outside is ignored.
    within: Option<Aabb>,
    cells: HashMap<[i32; 3], Tally>,
    visits: u64,
}

/// The geometry in a cell.
#[derive(Clone, Copy, Debug, Default)]
struct Tally {
    points: u32,
    /// True if a triangle or box meets the cell; then the smallest number of points does not apply.
    solid: bool,
    colored: u32,
    color_sums: [u32; 3],
}

impl Tally {
    fn add_color(&mut self, color: Option<[u8; 3]>) {
        if let Some(color) = color.filter(|_| self.colored < MAX_COLORED) {
            self.colored += 1;
            self.color_sums.iter_mut().zip(color).for_each(|(sum, c)| *sum += u32::from(c));
        }
    }

    fn color(&self) -> Option<[u8; 3]> {
        let mean = |sum: u32| ((f64::from(sum) / f64::from(self.colored)).round()) as u8;
        (self.colored > 0).then(|| self.color_sums.map(mean))
    }
}

impl Voxels {
    /// No cells, on `lattice`. Geometry outside `within` will be ignored.
    pub(super) fn new(lattice: Lattice, within: Option<Aabb>) -> Self {
        Self { lattice, within, cells: HashMap::new(), visits: 0 }
    }

    /// Number of cells.
    pub(super) fn len(&self) -> usize {
        self.cells.len()
    }

    /// Adds a point as a cube of edge `thickness`.
    pub(super) fn add_point(&mut self, at: DVec3, color: Option<[u8; 3]>, thickness: f64) -> Result<(), BuildError> {
        if self.within.is_some_and(|within| !within.contains(at)) {
            return Ok(());
        }
        let cell = self.cell_of(at)?;
        let tally = self.touch(cell)?;
        tally.points = tally.points.saturating_add(1);
        tally.add_color(color);
        if thickness > 0.0 {
            let (first, last) = self.range(&Aabb::around(at, DVec3::splat(0.5 * thickness)))?;
            self.for_cells(first, last, &mut |voxels, other| {
                if other != cell {
                    let tally = voxels.touch(other)?;
                    tally.points = tally.points.saturating_add(1);
                    tally.add_color(color);
                }
                Ok(())
            })?;
        }
        Ok(())
    }

    /// Adds all cells that the triangle, grown by half of `thickness` along every axis, intersects or touches. A face on
    /// the border of two cells therefore occupies both, and no rounding of its coordinates loses it.
    pub(super) fn add_triangle(
        &mut self,
        triangle: &Triangle,
        color: Option<[u8; 3]>,
        thickness: f64,
    ) -> Result<(), BuildError> {
        self.add_convex(triangle, color, 0.5 * thickness)
    }

    /// Adds all cells that share volume with `body`, or contain it if it is thinner than rounding.
    pub(super) fn add_box(&mut self, body: &Aabb, color: Option<[u8; 3]>) -> Result<(), BuildError> {
        let whole = body;
        let body = self.within.map_or(*body, |within| within.intersection(body));
        // A box that only touches the crop lies outside.
        if body.min.cmpgt(body.max).any() || (body != *whole && !body.is_solid()) {
            return Ok(());
        }
        let shrunk = DVec3::splat(FUZZ) * self.lattice.pitch;
        let inner = Aabb { min: body.min + shrunk, max: body.max - shrunk };
        let inner = if inner.min.cmple(inner.max).all() { inner } else { Aabb::around(body.center(), DVec3::ZERO) };
        let (first, last) = self.range(&inner)?;
        self.for_cells(first, last, &mut |voxels, cell| {
            let tally = voxels.touch(cell)?;
            tally.solid = true;
            tally.add_color(color);
            Ok(())
        })
    }

    /// Adds all cells that `body`, grown by `margin` along every axis, intersects or touches within rounding. Cells that
    /// only touch the crop are left out.
    pub(super) fn add_convex(
        &mut self,
        body: &impl Convex,
        color: Option<[u8; 3]>,
        margin: f64,
    ) -> Result<(), BuildError> {
        self.mark_convex(body, margin, &mut |tally| {
            tally.solid = true;
            tally.add_color(color);
        })
    }

    /// Adds a splat, as a point of each cell that its octahedron meets: the corners lie at its center plus and minus
    /// each of `axes`, of which at most [`MAX_SPLAT`] cells count. `thickness` grows it as it does points.
    pub(super) fn add_splat(
        &mut self,
        at: DVec3,
        axes: [Vec3; 3],
        color: Option<[u8; 3]>,
        thickness: f64,
    ) -> Result<(), BuildError> {
        if self.within.is_some_and(|within| !within.contains(at)) {
            return Ok(());
        }
        let most = MAX_SPLAT * self.lattice.pitch.min_element();
        let axes = axes.map(|axis| axis.as_dvec3().clamp_length_max(most));
        self.mark_convex(&Octahedron::new(at, axes), 0.5 * thickness, &mut |tally| {
            tally.points = tally.points.saturating_add(1);
            tally.add_color(color);
        })
    }

    fn mark_convex(
        &mut self,
        body: &impl Convex,
        margin: f64,
        mark: &mut impl FnMut(&mut Tally),
    ) -> Result<(), BuildError> {
        let bounds = body.bounds();
        let margin = DVec3::splat(margin) + self.rounding(&bounds);
        let mut bounds = bounds.grown(margin);
        if let Some(within) = &self.within {
            bounds = bounds.intersection(within);
        }
        if bounds.min.cmpgt(bounds.max).any() {
            return Ok(());
        }
        let (first, last) = self.range(&bounds)?;
        let least = FUZZ * self.lattice.pitch;
        self.descend(
            first,
            last,
            &mut |voxels, block| {
                let block = match &voxels.within {
                    Some(within) => within.intersection(block),
                    None => *block,
                };
                block.size().cmpgt(least).all() && meets(body, &block.grown(margin))
            },
            mark,
        )
    }

    /// Distance along each axis within which a body of these bounds touches a cell.
    fn rounding(&self, bounds: &Aabb) -> DVec3 {
        let largest = bounds.min.abs().max(bounds.max.abs()).max(self.lattice.origin.abs());
        FUZZ * self.lattice.pitch + ROUNDING * largest
    }

    /// Marks the cells from `first` to `last` for which `test` holds. Blocks for which it holds are halved, so the cost
    /// of a large triangle grows with its area, not with its bounding box.
    fn descend(
        &mut self,
        first: IVec3,
        last: IVec3,
        test: &mut impl FnMut(&Self, &Aabb) -> bool,
        mark: &mut impl FnMut(&mut Tally),
    ) -> Result<(), BuildError> {
        // At most one pending half per level, 32 levels per axis.
        let mut pending = vec![(first, last)];
        while let Some((first, last)) = pending.pop() {
            self.count_visits(1)?;
            let corner = |cell: IVec3| self.lattice.origin + cell.as_dvec3() * self.lattice.pitch;
            if !test(self, &Aabb { min: corner(first), max: corner(last + 1) }) {
                continue;
            }
            let extent = last - first;
            if extent == IVec3::ZERO {
                mark(self.touch(first)?);
                continue;
            }
            let axis = (0..3).max_by_key(|&a| extent[a]).unwrap_or(0);
            let middle = first[axis] + extent[axis] / 2;
            let (mut lower, mut upper) = (last, first);
            lower[axis] = middle;
            upper[axis] = middle + 1;
            pending.push((upper, last));
            pending.push((first, lower));
        }
        Ok(())
    }

    fn for_cells(
        &mut self,
        first: IVec3,
        last: IVec3,
        add: &mut impl FnMut(&mut Self, IVec3) -> Result<(), BuildError>,
    ) -> Result<(), BuildError> {
        let counts = (last.as_i64vec3() - first.as_i64vec3() + 1).to_array();
        self.count_visits(counts.into_iter().fold(1, |all, n| all.saturating_mul(n.unsigned_abs())))?;
        for z in first.z..=last.z {
            for y in first.y..=last.y {
                for x in first.x..=last.x {
                    add(self, IVec3::new(x, y, z))?;
                }
            }
        }
        Ok(())
    }

    fn count_visits(&mut self, visits: u64) -> Result<(), BuildError> {
        self.visits = self.visits.saturating_add(visits);
        if self.visits > MAX_VISITS { Err(self.too_many()) } else { Ok(()) }
    }

    fn too_many(&self) -> BuildError {
        too_many_cells(self.lattice.pitch).into()
    }

    /// The cell that contains `at`.
    fn cell_of(&self, at: DVec3) -> Result<IVec3, BuildError> {
        let cell = ((at - self.lattice.origin) / self.lattice.pitch).floor();
        // Leave one cell at either end, for neighbors.
        let reach = f64::from(i32::MAX - 1);
        if cell.abs().max_element() < reach {
            return Ok(cell.as_ivec3());
        }
        Err(Error::TooFar { at: at.into(), pitch: self.lattice.pitch.into() }.into())
    }

    /// The cells that contain the corners of `body`.
    fn range(&self, body: &Aabb) -> Result<(IVec3, IVec3), BuildError> {
        Ok((self.cell_of(body.min)?, self.cell_of(body.max)?))
    }

    fn touch(&mut self, cell: IVec3) -> Result<&mut Tally, BuildError> {
        if self.cells.len() as u64 >= MAX_CELLS && !self.cells.contains_key(&cell.to_array()) {
            return Err(self.too_many());
        }
        Ok(self.cells.entry(cell.to_array()).or_default())
    }

    /// The cells with at least `min_points` points or anything solid, as (cell, color), ascending by (z, y, x).
    pub(super) fn into_cells(self, min_points: u32) -> Vec<(IVec3, Option<[u8; 3]>)> {
        let kept = |tally: &Tally| tally.solid || tally.points >= min_points;
        let cells = self.cells.into_iter().filter(|(_, tally)| kept(tally));
        let mut cells: Vec<_> = cells.map(|(cell, tally)| (IVec3::from(cell), tally.color())).collect();
        cells.sort_unstable_by_key(|(cell, _)| [cell.z, cell.y, cell.x]);
        cells
    }
}

/// The error that cells of edges `pitch` are more than [`MAX_CELLS`].
pub(super) fn too_many_cells(pitch: DVec3) -> Error {
    Error::TooManyCells { pitch: pitch.into(), limit: MAX_CELLS, remedy: Remedy::FewerCells }
}

/// `cells` of `lattice`, ascending by (z, y, x), as boxes on a lattice whose origin is their smallest corner.
pub fn boxes_of(lattice: &Lattice, cells: impl Iterator<Item = IVec3> + Clone) -> Option<VoxelBoxes> {
    let first = cells.clone().reduce(IVec3::min)?;
    let origin = lattice.origin + first.as_dvec3() * lattice.pitch;
    let relative = |cell: IVec3| {
        let from_first: I64Vec3 = cell.as_i64vec3() - first.as_i64vec3();
        UVec3::from_array(from_first.to_array().map(|v| v as u32))
    };
    Some(VoxelBoxes { lattice: Lattice { origin, ..*lattice }, cells: cells.map(relative).collect() })
}

#[cfg(test)]
mod tests {
    use super::*;

    const LATTICE: Lattice = Lattice { origin: DVec3::ZERO, pitch: DVec3::ONE };

    fn found(voxels: Voxels, min_points: u32) -> Vec<[i32; 3]> {
        voxels.into_cells(min_points).into_iter().map(|(cell, _)| cell.to_array()).collect()
    }

    #[test]
    fn a_triangle_fills_what_it_crosses_and_nothing_that_only_its_bounds_do() {
        let mut voxels = Voxels::new(LATTICE, None);
        let corners = [[0.5, 0.5, 0.5], [3.5, 0.5, 0.5], [0.5, 3.5, 0.5]].map(DVec3::from);
        voxels.add_triangle(&Triangle { corners }, None, 0.0).unwrap();
        let expected: Vec<[i32; 3]> = (0..4)
            .flat_map(|y| (0..4).filter(move |x| x + y <= 4).map(move |x| [x, y, 0]))
            .filter(|c| {
                c[0] + c[1] < 4 || {
                    // The edge x + y = 4 passes through cells whose lower corner has x + y of at most 3, and touches
                    // the corners of those with 4.
                    c[0] + c[1] == 4 && c[0] > 0 && c[1] > 0
                }
            })
            .collect();
        assert_eq!(found(voxels, 9), expected);
    }

    /// The cells of the rectangle `from` to `to`, flat along one axis, as two triangles.
    fn of_rectangle(voxels: &mut Voxels, from: DVec3, to: DVec3) {
        let flat = (0..3).find(|&axis| from[axis] == to[axis]).unwrap();
        let mut corners = [from, to, from, to];
        corners[2][(flat + 1) % 3] = to[(flat + 1) % 3];
        corners[3][(flat + 1) % 3] = from[(flat + 1) % 3];
        for n in [2, 3] {
            voxels.add_triangle(&Triangle { corners: [corners[0], corners[n], corners[1]] }, None, 0.0).unwrap();
        }
    }

    #[test]
    fn faces_on_the_border_of_cells_fill_both_sides_at_any_rounding() {
        for pitch in [0.3, 0.02, 0.1, 0.2, 0.01, 0.05, 0.25, 7.0 / 3.0] {
            for at in -20..20 {
                for axis in 0..3 {
                    for single in [false, true] {
                        let mut voxels = Voxels::new(Lattice { origin: DVec3::ZERO, pitch: DVec3::splat(pitch) }, None);
                        let (mut from, mut to) = (DVec3::splat(0.5 * pitch), DVec3::splat(2.5 * pitch));
                        let height = f64::from(at) * pitch;
                        from[axis] = if single { f64::from(height as f32) } else { height };
                        to[axis] = from[axis];
                        of_rectangle(&mut voxels, from, to);
                        let cells = found(voxels, 0);
                        assert_eq!(cells.len(), 18, "{pitch} {at} {axis}");
                        assert!(cells.iter().all(|cell| (at - 1..=at).contains(&cell[axis])), "{pitch} {at} {axis}");
                    }
                }
            }
        }
    }

    #[test]
    fn no_face_of_a_random_box_is_lost() {
        let random = strivec_format::random::Random::new(7, "boxes");
        for n in 0..60 {
            let number = |k: u64| random.uniform(16 * n + k);
            // Rounded to six digits, as files are, far from the origin, and on a lattice that begins at the corner.
            let rounded = |value: f64| (value * 1e6).round() / 1e6;
            let vector = |k: u64| DVec3::new(number(k), number(k + 1), number(k + 2)).map(rounded);
            let min = 1000.0 * (vector(0) - 0.5);
            let max = min + vector(3) + 0.5;
            let pitch = 0.01 + 0.1 * number(6);
            let lattice = Lattice { origin: min, pitch: DVec3::splat(pitch) };
            for axis in 0..3 {
                for height in [min[axis], max[axis]] {
                    let mut voxels = Voxels::new(lattice, None);
                    let (mut from, mut to) = (min, max);
                    (from[axis], to[axis]) = (height, height);
                    of_rectangle(&mut voxels, from, to);
                    let inner = (max - min) / pitch;
                    let least: f64 = (0..3).filter(|&a| a != axis).map(|a| inner[a].floor()).product();
                    let cells = found(voxels, 0).len() as f64;
                    assert!(cells >= least, "{cells} of {least}");
                }
            }
        }
    }

    #[test]
    fn splats_cover_their_extent_up_to_a_bound() {
        let splat = |axes: [[f32; 3]; 3]| {
            let mut voxels = Voxels::new(LATTICE, None);
            voxels.add_splat(DVec3::splat(0.5), axes.map(Vec3::from), Some([1, 2, 3]), 0.0).unwrap();
            (found(voxels.clone(), 1), found(voxels, 2).len())
        };
        assert_eq!(splat([[0.1, 0.0, 0.0], [0.0, 0.1, 0.0], [0.0; 3]]), (vec![[0, 0, 0]], 0));
        let long: Vec<_> = (-2..=2).map(|x| [x, 0, 0]).collect();
        assert_eq!(splat([[2.2, 0.0, 0.0], [0.0, 0.1, 0.0], [0.0, 0.0, 0.01]]).0, long);
        let (disk, _) = splat([[0.0, 2.2, 0.0], [2.2, 0.0, 0.0], [0.0; 3]]);
        assert!(disk.len() > 9 && disk.iter().all(|cell| cell[2] == 0), "{disk:?}");
        assert_eq!(splat([[1e30, 0.0, 0.0], [0.0; 3], [0.0; 3]]).0.len(), 17);
    }

    #[test]
    fn cells_that_only_touch_the_crop_are_left_out() {
        let within = Aabb { min: DVec3::ZERO, max: DVec3::splat(2.0) };
        let mut voxels = Voxels::new(LATTICE, Some(within));
        of_rectangle(&mut voxels, DVec3::new(0.0, -5.0, -5.0), DVec3::new(0.0, 5.0, 5.0));
        assert_eq!(found(voxels, 0), [[0, 0, 0], [0, 1, 0], [0, 0, 1], [0, 1, 1]]);
    }

    #[test]
    fn thickness_grows_to_both_sides() {
        let mut voxels = Voxels::new(LATTICE, None);
        let corners = [[0.2, 0.2, 0.1], [0.8, 0.2, 0.1], [0.2, 0.8, 0.1]].map(DVec3::from);
        voxels.add_triangle(&Triangle { corners }, None, 0.3).unwrap();
        assert_eq!(found(voxels, 0), [[0, 0, -1], [0, 0, 0]]);
    }

    #[test]
    fn points_are_counted_and_colors_averaged() {
        let mut voxels = Voxels::new(LATTICE, None);
        for color in [[0, 10, 255], [101, 20, 255]] {
            voxels.add_point(DVec3::splat(0.5), Some(color), 0.0).unwrap();
        }
        voxels.add_point(DVec3::new(-0.5, 0.5, 0.5), None, 0.0).unwrap();
        assert_eq!(voxels.clone().into_cells(1), [(IVec3::new(-1, 0, 0), None), (IVec3::ZERO, Some([51, 15, 255]))]);
        assert_eq!(found(voxels, 2), [[0, 0, 0]]);
    }

    #[test]
    fn upright_boxes_that_end_on_faces_fill_no_more() {
        let mut voxels = Voxels::new(LATTICE, None);
        voxels.add_box(&Aabb { min: DVec3::splat(1.0 - 1e-9), max: DVec3::new(2.0, 3.0 + 1e-9, 2.0) }, None).unwrap();
        assert_eq!(found(voxels, 0), [[1, 1, 1], [1, 2, 1]]);
    }

    #[test]
    fn what_is_outside_the_crop_is_left_out() {
        let within = Aabb { min: DVec3::splat(-10.0), max: DVec3::new(1.5, 10.0, 10.0) };
        let mut voxels = Voxels::new(LATTICE, Some(within));
        let corners = [[0.5, 0.5, 0.5], [9.5, 0.5, 0.5], [0.5, 0.6, 0.5]].map(DVec3::from);
        voxels.add_triangle(&Triangle { corners }, None, 0.0).unwrap();
        voxels.add_point(DVec3::new(1.6, 0.5, 5.5), None, 0.0).unwrap();
        voxels.add_box(&Aabb { min: DVec3::splat(3.0), max: DVec3::splat(4.0) }, None).unwrap();
        assert_eq!(found(voxels, 0), [[0, 0, 0], [1, 0, 0]]);
    }

    #[test]
    fn too_much_is_refused() {
        let mut voxels = Voxels::new(Lattice { origin: DVec3::ZERO, pitch: DVec3::splat(1e-3) }, None);
        let huge = Aabb { min: DVec3::splat(-1e3), max: DVec3::splat(1e3) };
        assert!(matches!(voxels.add_box(&huge, None), Err(BuildError::Prior(Error::TooManyCells { .. }))));
        assert!(matches!(voxels.add_point(DVec3::splat(1e9), None, 0.0), Err(BuildError::Prior(Error::TooFar { .. }))));
    }
}
