//! The cells of a grid that the scene occupies.

use std::io::{self, Seek, Write};

use glam::{DVec3, IVec3};
use rayon::prelude::*;

use super::polytope::Polytope;
use super::scene::SyntheticScene;
use super::solid::{About, Solid};
use strivec_format::geometry::{Aabb, Lattice};
use strivec_import::npy::NpzWriter;

/// Number of cells along each axis.
pub(super) const CELLS: usize = 100;
/// The margin by which cells are enlarged on each side, so that rounding never loses a cell.
const MARGIN: f64 = 1e-9;

/// The bounds of the grid.
fn bounds(scene: &SyntheticScene) -> Aabb {
    Aabb::around(DVec3::ZERO, DVec3::splat(scene.extent()))
}

/// The grid's cells.
pub(super) fn lattice(scene: &SyntheticScene) -> Lattice {
    let bounds = bounds(scene);
    Lattice { origin: bounds.min, pitch: bounds.size() / CELLS as f64 }
}

/// \[z\]\[y\]\[x\] true if the closed cell, enlarged by 1e-9, has a point in common with a closed solid, its inside
/// included.
pub(super) fn occupancy(scene: &SyntheticScene) -> Vec<bool> {
    let lattice = lattice(scene);
    let mut cells = vec![false; CELLS * CELLS * CELLS];
    cells.par_chunks_exact_mut(CELLS * CELLS).enumerate().for_each(|(z, layer)| {
        for solid in scene.things.iter().map(|thing| &thing.solid) {
            let around = around(solid);
            // One more cell on each side: a cell may touch the box with a face only.
            let (first, last) = (lattice.cell_of(around.min) - 1, lattice.cell_of(around.max) + 1);
            let (first, last) = (first.max(IVec3::ZERO), last.min(IVec3::splat(CELLS as i32 - 1)));
            if (z as i32) < first.z || (z as i32) > last.z {
                continue;
            }
            for (y, x) in (first.y..=last.y).flat_map(|y| (first.x..=last.x).map(move |x| (y, x))) {
                let occupied = &mut layer[y as usize * CELLS + x as usize];
                let cell = Aabb::around(lattice.center(IVec3::new(x, y, z as i32)), 0.5 * lattice.pitch);
                *occupied = *occupied || meets(solid, &cell);
            }
        }
    });
    cells
}

/// Writes the `cells` of `scene` as an NPZ file: `occupancy` (bool, \[z\]\[y\]\[x\]) and `bounds` (float64, (2, 3): the
/// grid's smallest and largest corner as x, y, z).
pub(super) fn write_npz(scene: &SyntheticScene, cells: &[bool], out: impl Write + Seek) -> io::Result<()> {
    let (bounds, mut archive) = (bounds(scene), NpzWriter::new(out, false));
    archive.add("occupancy", &[CELLS; 3], cells.iter().copied())?;
    archive.add("bounds", &[2, 3], [bounds.min, bounds.max].iter().flat_map(|corner| corner.to_array()))?;
    archive.finish()?;
    Ok(())
}

/// The solid's bounds in the world.
fn around(solid: &Solid) -> Aabb {
    Aabb::from_points(solid.bounds.corners().map(|corner| solid.world(corner)))
}

/// True if a closed cell and a closed solid have a point in common.
///
/// The intersection of the cell with the solid's box is convex, hence connected. Distances from the center or axis
/// therefore take every value between their least and greatest there, so it suffices that this range overlaps the range
/// that is kept.
fn meets(solid: &Solid, cell: &Aabb) -> bool {
    let grown = cell.grown(DVec3::splat(MARGIN));
    let mut rest = Polytope::of_box(&grown, solid.world_from_local.transpose(), solid.center);
    for axis in 0..3 {
        rest.cut(axis, -1.0, solid.bounds.min[axis]);
        rest.cut(axis, 1.0, solid.bounds.max[axis]);
    }
    let Some(round) = solid.round.filter(|_| !rest.is_empty()) else { return !rest.is_empty() };
    let farthest = rest.corners().map(|&p| round.about.offset(p).length()).fold(0.0, f64::max);
    let inside = round.about == About::Point && grown.contains(solid.center) && solid.bounds.contains(DVec3::ZERO);
    let nearest = || rest.triangles().map(|t| distance(t.map(|p| round.about.offset(p)))).fold(f64::INFINITY, f64::min);
    farthest >= round.inner && (inside || round.outer.is_infinite() || nearest() <= round.outer)
}

/// The distance of the origin from a triangle, which may be flattened to a line or a point.
fn distance([a, b, c]: [DVec3; 3]) -> f64 {
    let to_edge = |p: DVec3, q: DVec3| {
        let along = q - p;
        let squared = along.length_squared();
        let t = if squared > 0.0 { (-p.dot(along) / squared).clamp(0.0, 1.0) } else { 0.0 };
        (p + t * along).length()
    };
    let edges = to_edge(a, b).min(to_edge(b, c)).min(to_edge(c, a));
    let normal = (b - a).cross(c - a);
    let squared = normal.length_squared();
    if squared < 1e-30 {
        return edges;
    }
    let foot = normal * (a.dot(normal) / squared);
    let within = [(a, b), (b, c), (c, a)].iter().all(|&(p, q)| normal.dot((q - p).cross(foot - p)) >= 0.0);
    if within { foot.length() } else { edges }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::SolidMesh;
    use crate::points::points;
    use crate::portable::uniform;

    #[test]
    fn every_surface_point_is_in_an_occupied_cell_and_occupied_cells_are_near() {
        let scene = SyntheticScene::new(2);
        let (cells, lattice) = (occupancy(&scene), lattice(&scene));
        let on_surface = points(&scene, 50_000, 3).into_iter().map(|p| p.position);
        for point in on_surface.chain(SolidMesh::of_scene(&scene).vertices) {
            let cell = lattice.cell_of(point).as_uvec3();
            let index = (cell.z as usize * CELLS + cell.y as usize) * CELLS + cell.x as usize;
            assert!(cells[index], "{point}");
        }
        let half_diagonal = 0.5 * lattice.pitch.length() + 2.0 * MARGIN;
        for index in (0..cells.len()).filter(|&i| cells[i]) {
            let cell =
                IVec3::new((index % CELLS) as i32, (index / CELLS % CELLS) as i32, (index / CELLS / CELLS) as i32);
            let center = lattice.center(cell);
            assert!(scene.things.iter().any(|t| t.solid.depth(center) >= -half_diagonal), "{cell}");
        }
    }

    #[test]
    fn cells_of_any_size_agree_with_dense_sampling() {
        let (mut occupied, mut unseen) = (0, 0);
        for (k, thing) in SyntheticScene::new(0).things.iter().enumerate() {
            let around = around(&thing.solid).grown(DVec3::splat(0.02));
            for i in 0..60_u64 {
                let random = |axis| uniform(k as u64, 4 * i + axis);
                let at = around.min + around.size() * DVec3::new(random(0), random(1), random(2));
                let cell = Aabb::around(at, DVec3::splat(0.003 + 0.2 * random(3) * random(3)));
                let step = cell.size() / 15.0;
                let sampled = (0..4096).any(|s| {
                    let steps = IVec3::new(s % 16, s / 16 % 16, s / 256).as_dvec3();
                    thing.solid.depth(cell.min + step * steps) >= 0.0
                });
                let exact = meets(&thing.solid, &cell);
                assert!(exact || !sampled, "solid {k}, {cell:?}");
                occupied += u32::from(exact);
                unseen += u32::from(exact && !sampled);
            }
        }
        // The samples miss only thin overlaps: corners that barely touch.
        assert!(occupied > 300 && unseen * 25 < occupied, "{unseen} of {occupied}");
    }
}
