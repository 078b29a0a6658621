//! Where what photographs show lies, and their rays that pass all of it.

use glam::DVec3;
use rayon::prelude::*;

use super::{SparseVoxelTree, VoxelBoxes, cells_around, central_box};
use strivec_format::geometry::{Aabb, Camera};

/// Places that photographs show that are enough to contradict the dataset's files.
const ENOUGH: usize = 500;
/// The central share of them, along each axis, that stands for all.
const CENTRAL: f64 = 0.98;
/// The margin around their box, as a share of its size, beyond which they do not count in a bounded scene.
const MARGIN: f64 = 0.25;
/// The share of the photographs' rays that pass all that is known from which on a scene is open: 2 to 8 % of captures in rooms, 15 to
/// 42 % of those that see a sky or the end of a table (docs/experiments/2026-11-30-captures.md).
pub(crate) const OPEN: f64 = 0.1;

/// The most cameras that are looked at; of more, some at equal steps.
const CAMERAS: usize = 128;
/// Rays of a camera, along columns and along rows.
const SIDE: u32 = 24;

/// The box of nearly all `places`; `None` if they are too few or in one plane.
pub(crate) fn box_of_places(places: &[DVec3]) -> Option<Aabb> {
    (places.len() >= ENOUGH).then(|| central_box(places, CENTRAL)).filter(Aabb::is_solid)
}

/// The box of nearly all places with the margin in which others count.
pub(crate) fn with_margin(shown: &Aabb) -> Aabb {
    shown.grown(MARGIN * shown.size())
}

/// True if many rays pass all that is known.
pub(crate) fn is_open(open_share: Option<f64>) -> bool {
    open_share.is_some_and(|share| share > OPEN)
}

/// The share of the rays of `cameras` that pass all `places` that they show, but for those far outside of all others; `None` if
/// they show too few.
pub(crate) fn open_share(cameras: &[Camera], places: &[DVec3]) -> Option<f64> {
    let within = with_margin(&box_of_places(places)?);
    let near: Vec<DVec3> = places.iter().copied().filter(|&at| within.contains(at)).collect();
    Some(share_beside(cameras, &cells_around(&near)?))
}

/// The share of the rays of `cameras` that meet none of `cells`.
fn share_beside(cameras: &[Camera], cells: &VoxelBoxes) -> f64 {
    let tree = SparseVoxelTree::new(cells);
    let chosen: Vec<&Camera> = cameras.iter().step_by(cameras.len().div_ceil(CAMERAS).max(1)).collect();
    let counts = chosen.par_iter().map(|camera| {
        let share = |n: u32, pixels: u32| (f64::from(n) + 0.5) / f64::from(SIDE) * f64::from(pixels);
        let rays = (0..SIDE * SIDE)
            .filter_map(|n| camera.ray_through(share(n % SIDE, camera.width), share(n / SIDE, camera.height)));
        rays.fold([0_u32; 2], |[all, open], ray| [all + 1, open + u32::from(tree.cast_ray(&ray).is_none())])
    });
    let [all, open] = counts.reduce(|| [0; 2], |a, b| [a[0] + b[0], a[1] + b[1]]);
    f64::from(open) / f64::from(all.max(1))
}

#[cfg(test)]
mod tests {
    use glam::{DVec3, UVec3};

    use super::*;
    use strivec_format::geometry::Lattice;

    #[test]
    fn rays_beside_a_wall_are_open() {
        let camera = Camera::looking_at([64, 48], 60.0, DVec3::ZERO, DVec3::X, DVec3::Z);
        let lattice = Lattice { origin: DVec3::new(5.0, -8.0, -8.0), pitch: DVec3::ONE };
        // A wall over the left half of the picture.
        let cells: Vec<UVec3> = (0..16).flat_map(|z| (8..16).map(move |y| UVec3::new(0, y, z))).collect();
        assert_eq!(share_beside(&[camera], &VoxelBoxes { lattice, cells }), 0.5);
    }
}
