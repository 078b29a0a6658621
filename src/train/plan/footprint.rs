//! The size of pixels at the occupied cells.

use rayon::prelude::*;

use crate::TrainConfig;
use strivec_capture::prior;
use strivec_capture::prior::VoxelBoxes;
use strivec_format::geometry::Camera;

/// The share of seen cells with smaller pixels than [`Footprints::near_pixel`], so that a few cells close to one camera
/// do not set the resolution.
const NEAREST_SHARE: f64 = 0.1;

/// Width of a pixel at each occupied cell, of the camera whose pixels are smallest there.
#[derive(Clone, Debug)]
pub(super) struct Footprints {
    /// \[cell\] in the units of the cells; infinite if no camera sees the cell.
    widths: Vec<f64>,
}

/// A camera, and the planes between which its picture lies: a point is inside if `side`·(x, z) ≥ 0, with unit normals.
struct Frustum<'a> {
    camera: &'a Camera,
    columns: [[f64; 2]; 2],
    rows: [[f64; 2]; 2],
}

impl Footprints {
    /// The footprints at `occupied` for `cameras`, both in the dataset's space; in an unbounded scene `occupied` is in
    /// contracted space. A camera sees a cell if any part of the
    /// smallest sphere around the cell may be in its picture, between near and far. Occlusion is ignored, as the prior
    /// is only approximate.
    pub(super) fn of(config: &TrainConfig, cameras: &[Camera], occupied: &VoxelBoxes) -> Self {
        let [near, far] = config.space.near_far.unwrap_or_else(|| prior::ray_range(cameras, None));
        let radius = 0.5 * occupied.lattice.pitch.length();
        let unbounded = config.unbounded();
        let frusta: Vec<_> = cameras.iter().map(Frustum::new).collect();
        let width = |n: usize| {
            let place = occupied.cell_box(n).center();
            let center = unbounded.map_or(place, |unbounded| unbounded.expand(place));
            // The factor by which contraction scales lengths at this cell.
            let shrinking = unbounded.map_or(1.0, |unbounded| unbounded.contracted_length(1.0, center));
            let radius = radius / shrinking;
            let seen = |frustum: &Frustum<'_>| {
                let from_camera = center - frustum.camera.position;
                let distance = from_camera.length();
                if distance + radius < near || distance - radius > far {
                    return f64::INFINITY;
                }
                let p = frustum.camera.world_from_camera.transpose() * from_camera;
                shrinking * frustum.pixel_width([p.x, -p.y, -p.z], radius)
            };
            frusta.iter().map(seen).fold(f64::INFINITY, f64::min)
        };
        Self { widths: (0..occupied.cells.len()).into_par_iter().map(width).collect() }
    }

    /// True if any camera sees `cell`.
    pub(super) fn is_seen(&self, cell: usize) -> bool {
        self.widths[cell].is_finite()
    }

    /// Number of cells that any camera sees.
    pub(super) fn seen(&self) -> usize {
        self.widths.iter().filter(|w| w.is_finite()).count()
    }

    /// The lowest decile of the pixel widths at the seen cells, in the units of the cells; `None` if no cell is seen.
    pub(super) fn near_pixel(&self) -> Option<f64> {
        let mut seen: Vec<f64> = self.widths.iter().copied().filter(|w| w.is_finite()).collect();
        let at = (NEAREST_SHARE * seen.len().checked_sub(1)? as f64) as usize;
        Some(*seen.select_nth_unstable_by(at, f64::total_cmp).1)
    }
}

impl<'a> Frustum<'a> {
    fn new(camera: &'a Camera) -> Self {
        let planes = |extent: u32, principal: f64, focal: f64| {
            let [low, high] = [-principal / focal, (f64::from(extent) - principal) / focal];
            [[1.0, -low], [-1.0, high]].map(|[x, z]: [f64; 2]| [x / x.hypot(z), z / x.hypot(z)])
        };
        Self {
            camera,
            columns: planes(camera.width, camera.principal[0], camera.focal[0]),
            rows: planes(camera.height, camera.principal[1], camera.focal[1]),
        }
    }

    /// Width of a pixel at `place` (along columns, along rows, ahead); infinite if the sphere of `radius` around it is
    /// behind the camera or outside the picture. Distances are at least `radius`, as the camera may be in the cell.
    fn pixel_width(&self, [column, row, ahead]: [f64; 3], radius: f64) -> f64 {
        let inside =
            |planes: &[[f64; 2]; 2], across: f64| planes.iter().all(|[x, z]| x * across + z * ahead >= -radius);
        if ahead < -radius || !inside(&self.columns, column) || !inside(&self.rows, row) {
            return f64::INFINITY;
        }
        let [x, y] = self.camera.focal;
        ahead.max(radius) / (x * y).sqrt()
    }
}
