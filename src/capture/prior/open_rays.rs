//! Rays of photographs that pass all that is known.

use rayon::prelude::*;

use crate::prior::{SparseVoxelTree, VoxelBoxes};
use strivec_format::geometry::Camera;

/// The most cameras that are looked at; of more, some at equal steps.
const CAMERAS: usize = 128;
/// Rays of a camera, along columns and along rows.
const SIDE: u32 = 24;

/// The share of the rays of `cameras` that meet none of `cells`.
pub(super) fn open_share(cameras: &[Camera], cells: &VoxelBoxes) -> f64 {
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
        assert_eq!(open_share(&[camera], &VoxelBoxes { lattice, cells }), 0.5);
    }
}
