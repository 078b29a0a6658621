//! The voxels of a grid that hold points on the scene's surfaces, and the rays that meet them.

use std::collections::HashSet;

use glam::{DVec3, UVec3};

use super::grid::{CoarseGrid, Scalar};
use crate::prior::VoxelBoxes;
use strivec_format::geometry::RayPath;

/// Steps along a ray, in voxels.
const STEP: f64 = 0.5;

/// \[vertex\] true if the voxel around it holds a part of a known cell.
pub(super) struct KnownVertices(Vec<bool>);

impl KnownVertices {
    /// The vertices of `grid` in or nearest to the cells of `points`, which are in its space.
    pub(super) fn new<T: Scalar>(grid: &CoarseGrid<T>, points: &VoxelBoxes) -> Self {
        let cells: HashSet<UVec3> = points.cells.iter().copied().collect();
        let is_in_cell = |n: usize| {
            let cell = points.lattice.cell_of(grid.vertex(n));
            cell.min_element() >= 0 && cells.contains(&cell.as_uvec3())
        };
        let mut known: Vec<bool> = (0..grid.values.len()).map(is_in_cell).collect();
        for cell in points.boxes() {
            if let Some(n) = nearest(grid, cell.center()) {
                known[n] = true;
            }
        }
        Self(known)
    }

    /// True if the voxel around vertex `n` is known.
    pub(super) fn contains(&self, n: usize) -> bool {
        self.0[n]
    }

    /// True if `path`, which is in the grid's space, passes between known vertices or beside one.
    pub(super) fn meets<T: Scalar>(&self, grid: &CoarseGrid<T>, path: &RayPath) -> bool {
        let Some((begin, end)) = path.span else { return false };
        let step = STEP * grid.voxel;
        let steps = ((end - begin) / step).max(0.0) as u32;
        let limit = grid.vertices - 1;
        let is_known = |point: DVec3| {
            let first = grid.local(point).floor();
            if first.min_element() < 0.0 || first.cmpge(limit.as_dvec3()).any() {
                return false;
            }
            let first = first.as_uvec3();
            (0..8).any(|n| self.0[grid.index(first + UVec3::new(n & 1, n >> 1 & 1, n >> 2))])
        };
        (0..steps).any(|k| is_known(path.position(begin + f64::from(k) * step)))
    }
}

/// The vertex nearest to `point`; `None` if it is outside of the grid.
fn nearest<T: Scalar>(grid: &CoarseGrid<T>, point: DVec3) -> Option<usize> {
    let place = grid.local(point).round();
    let is_inside = place.min_element() >= 0.0 && place.cmplt(grid.vertices.as_dvec3()).all();
    is_inside.then(|| grid.index(place.as_uvec3()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use strivec_format::geometry::{Aabb, Lattice, Ray};

    #[test]
    fn voxels_of_smaller_and_of_larger_cells_are_known_and_rays_through_them_meet_them() {
        let bounds = Aabb::around(DVec3::ZERO, DVec3::ONE);
        let grid = CoarseGrid::<f32>::with_voxel(&bounds, 0.1);
        for pitch in [0.03, 0.1, 0.4] {
            let lattice = Lattice { origin: DVec3::NEG_ONE, pitch: DVec3::splat(pitch) };
            let cell = lattice.cell_of(DVec3::new(0.51, 0.02, 0.01)).as_uvec3();
            let points = VoxelBoxes { lattice, cells: vec![cell] };
            let known = KnownVertices::new(&grid, &points);
            let count = (0..grid.values.len()).filter(|&n| known.contains(n)).count();
            assert!(
                if pitch < 0.2 { (1..=8).contains(&count) } else { (27..=125).contains(&count) },
                "{pitch}: {count}"
            );
            let place = points.boxes().next().unwrap().center();
            let meets = |target: DVec3, far: f64| {
                let origin = DVec3::new(-3.0, 0.4, 0.3);
                let ray = Ray { origin, direction: (target - origin).normalize() };
                known.meets(&grid, &RayPath::new(&ray, &grid.bounds(), None, [0.0, far]))
            };
            assert!(meets(place, 9.0) && !meets(place, 2.5), "{pitch}: rays that end before it do not");
            assert!(!meets(place - 0.9 * DVec3::Z, 9.0) && !meets(DVec3::new(-3.0, 0.4, 9.0), 9.0), "{pitch}");
        }
    }
}
