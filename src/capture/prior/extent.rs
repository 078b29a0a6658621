//! The lattice of a prior, from a first pass over the geometry.

use std::path::PathBuf;

use glam::{DAffine3, DVec3};

use super::NoCells;
use super::overlap::{Convex, Parallelepiped, Triangle};
use super::{BuildError, coarse};
use strivec_format::geometry::{Aabb, Lattice};
use strivec_format::random::Random;

/// Smallest default size of a cell as a share of the longest extent, for flat geometry.
const MIN_SHARE: f64 = 1.0 / 1024.0;
/// Points among which quantiles are taken.
const SAMPLE: usize = 1 << 16;
/// Quantiles between which the core of a cloud lies, along each axis.
const CORE: [f64; 2] = [0.05, 0.95];
/// Points farther from the core than this share of its length do not count for the size of the cells.
const FENCE: f64 = 0.5;

/// True if `map` keeps boxes axis-aligned.
pub(super) fn keeps_upright(map: &DAffine3) -> bool {
    map.matrix3.to_cols_array_2d().iter().all(|column| column.iter().filter(|v| **v != 0.0).count() == 1)
}

/// Bounds of the geometry, a sample of its points, and the cells of grids.
pub(super) struct Extent {
    crop: Option<Aabb>,
    /// Bounds of everything, the crop ignored.
    all: Aabb,
    /// Bounds of triangles and cells.
    solids: Aabb,
    /// Bounds of the points within the crop, their number, and a sample of them.
    points: Aabb,
    count: u64,
    sample: Vec<DVec3>,
    random: Random,
    /// Smallest corner of the first cell, and the smallest size of any cell.
    grid: Option<(DVec3, DVec3)>,
    /// True if all geometry is cells that the map keeps axis-aligned.
    all_grid: bool,
}

impl Extent {
    pub(super) fn new(crop: Option<Aabb>) -> Self {
        Self {
            crop,
            all: Aabb::EMPTY,
            solids: Aabb::EMPTY,
            points: Aabb::EMPTY,
            count: 0,
            sample: Vec::new(),
            random: Random::new(0, "survey"),
            grid: None,
            all_grid: true,
        }
    }

    pub(super) fn point(&mut self, at: DVec3) {
        self.all_grid = false;
        let here = Aabb { min: at, max: at };
        self.all = self.all.union(&here);
        if self.crop.is_some_and(|crop| !crop.contains(at)) {
            return;
        }
        self.points = self.points.union(&here);
        // Reservoir sampling (Vitter, 1985, algorithm R).
        self.count += 1;
        if self.sample.len() < SAMPLE {
            self.sample.push(at);
        } else {
            let place = (self.random.uniform(self.count) * self.count as f64) as usize;
            if let Some(slot) = self.sample.get_mut(place) {
                *slot = at;
            }
        }
    }

    pub(super) fn triangle(&mut self, triangle: &Triangle) {
        self.all_grid = false;
        self.solid(&triangle.bounds());
    }

    pub(super) fn cell(&mut self, cell: &Aabb, map: &DAffine3) {
        let image = Parallelepiped::image(cell, map).bounds();
        self.solid(&image);
        self.all_grid &= keeps_upright(map);
        let (corner, least) = self.grid.unwrap_or((image.min, image.size()));
        self.grid = Some((corner, least.min(image.size())));
    }

    fn solid(&mut self, bounds: &Aabb) {
        self.all = self.all.union(bounds);
        let bounds = self.crop.map_or(*bounds, |crop| crop.intersection(bounds));
        if bounds.min.cmple(bounds.max).all() {
            self.solids = self.solids.union(&bounds);
        }
    }

    /// The lattice of grids if there is nothing else; otherwise cells that divide the bounds into about as many as the
    /// coarse trainer has. Points far from most others do not count for the bounds, so that a few outliers do not make
    /// all cells large.
    ///
    /// # Errors
    ///
    /// If there is no geometry, or all lies in one place. `files` are named in errors.
    pub(super) fn lattice(mut self, files: &[PathBuf]) -> Result<Lattice, BuildError> {
        let whole = self.points.union(&self.solids);
        if whole.min.cmpgt(whole.max).any() {
            let has_geometry = self.all.min.cmple(self.all.max).all();
            return Err(BuildError::Nothing(match has_geometry {
                true => NoCells::Cropped { bounds: self.all },
                false => NoCells::NoGeometry,
            }));
        }
        if let Some((corner, pitch)) = self.grid.filter(|_| self.all_grid) {
            return Ok(Lattice { origin: corner, pitch });
        }
        let bounds = self.central().union(&self.solids);
        let size = bounds.size();
        let longest = size.max_element();
        if longest <= 0.0 || !longest.is_finite() {
            let files = match files {
                [file] => file.display().to_string(),
                [file, ..] => format!("{} and {} more", file.display(), files.len() - 1),
                [] => String::new(),
            };
            return Err(BuildError::OnePlace { files, place: bounds.min.into() });
        }
        let voxels = f64::from(coarse::CoarseOptions::default().voxels);
        let edge = (size.element_product() / voxels).cbrt().max(MIN_SHARE * longest);
        Ok(Lattice { origin: bounds.min, pitch: DVec3::splat(edge) })
    }

    /// Bounds of the points near the core: the box between two quantiles along each axis. These are the bounds of all
    /// points unless some lie far outside.
    fn central(&mut self) -> Aabb {
        let last = self.sample.len().saturating_sub(1) as f64;
        let mut core = Aabb::EMPTY;
        for axis in 0..3 {
            self.sample.sort_unstable_by(|a, b| a[axis].total_cmp(&b[axis]));
            let [from, to] = CORE.map(|share| (share * last).round() as usize);
            if let (Some(from), Some(to)) = (self.sample.get(from), self.sample.get(to)) {
                (core.min[axis], core.max[axis]) = (from[axis], to[axis]);
            }
        }
        let near = core.grown(FENCE * core.size());
        if self.sample.is_empty()
            || core.size() == DVec3::ZERO
            || (near.contains(self.points.min) && near.contains(self.points.max))
        {
            return self.points;
        }
        Aabb::from_points(self.sample.iter().copied().filter(|&at| near.contains(at)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Points of a cube of edge 1.
    fn cube(extent: &mut Extent, count: u64) {
        let random = Random::new(3, "cube");
        let at = |n: u64| DVec3::new(random.uniform(3 * n), random.uniform(3 * n + 1), random.uniform(3 * n + 2));
        (0..count).for_each(|n| extent.point(at(n)));
    }

    fn edge(extent: Extent) -> f64 {
        extent.lattice(&[]).unwrap().pitch.x
    }

    #[test]
    fn a_few_points_far_away_do_not_change_the_cells() {
        for count in [1000, 200_000] {
            let mut clean = Extent::new(None);
            cube(&mut clean, count);
            let mut spoiled = Extent::new(None);
            cube(&mut spoiled, count);
            for n in 0..count / 50 {
                spoiled.point(DVec3::splat(20.0 + n as f64));
            }
            let (clean, spoiled) = (edge(clean), edge(spoiled));
            assert!((0.009..0.0101).contains(&clean), "{clean}");
            assert!((spoiled / clean - 1.0).abs() < 0.02, "{spoiled} {clean}");
        }
    }

    #[test]
    fn far_triangles_and_evenly_spread_points_count() {
        let mut extent = Extent::new(None);
        cube(&mut extent, 1000);
        extent.triangle(&Triangle { corners: [DVec3::ZERO, DVec3::splat(10.0), DVec3::X] });
        assert!((edge(extent) - 0.1).abs() < 0.001);
        let mut line = Extent::new(None);
        (0..100).for_each(|n| line.point(DVec3::X * f64::from(n)));
        let lattice = line.lattice(&[]).unwrap();
        assert_eq!((lattice.origin, lattice.pitch.x), (DVec3::ZERO, 99.0 / 1024.0));
    }

    #[test]
    fn points_in_one_place_name_their_file() {
        let mut extent = Extent::new(None);
        (0..9).for_each(|_| extent.point(DVec3::new(1.0, 2.0, 3.0)));
        let error = extent.lattice(&["a.xyz".into()]).unwrap_err().to_string();
        assert_eq!(
            error,
            "a.xyz: all geometry lies in one place, [1.0, 2.0, 3.0], so no cell size follows from it: set `voxel`"
        );
    }
}
