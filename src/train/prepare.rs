//! From photographs to the scene that training starts from: prior, canonical map, placement.

use std::ops::ControlFlow;

use glam::DVec3;

use super::{ConfigError, TrainConfig, TrainError, initial_scene};
use crate::dataset::Dataset;
use crate::geometry::{Aabb, Similarity};
use crate::model::{BrokenInvariant, ColorSpace, Frame, Scene, UpAxis};
use crate::prior::{self, CameraBounds, CoarseOptions, CoarseProgress, ScaleShape, VoxelBoxes};

/// A scene that cannot be made.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PrepareError {
    /// There is no prior, or no placement on it.
    #[error(transparent)]
    Prior(#[from] prior::Error),
    /// The settings do not fit the prior.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// The scene breaks an invariant of the model.
    #[error(transparent)]
    Scene(#[from] BrokenInvariant),
    /// Training the prior's tensors failed.
    #[error(transparent)]
    Train(#[from] TrainError),
}

/// The coarse reconstruction of `dataset` with `config`'s options, background, range and seed.
///
/// # Errors
///
/// As [`prior::coarse::reconstruct`].
pub fn reconstruct_prior(
    config: &TrainConfig,
    dataset: &Dataset,
    progress: &mut dyn FnMut(CoarseProgress) -> ControlFlow<()>,
) -> Result<VoxelBoxes, prior::Error> {
    let options = CoarseOptions {
        background: config.background,
        near: config.near_far.map(|n| n[0]),
        far: config.near_far.map(|n| n[1]),
        ..config.prior.clone()
    };
    prior::coarse::reconstruct(dataset, &options, config.seed, progress)
}

/// A scene of random tensors on `occupied`, which is in the dataset's space (paper, "Distributing local tensors").
///
/// # Errors
///
/// If there is no cell to place tensors on.
pub fn place_scene(config: &TrainConfig, dataset: &Dataset, occupied: &VoxelBoxes) -> Result<Scene, PrepareError> {
    let bounds = occupied.bounds();
    let map = prior::canonical_map(&bounds, config.half_extent)?;
    let boxes = occupied.mapped(&map);
    let clouds = (config.scales.iter())
        .map(|s| {
            prior::place_on_boxes(&boxes, &ScaleShape { pitch: s.pitch, edge: s.edge, resolution: s.resolutions[0] })
        })
        .collect::<Result<Vec<_>, _>>()?;
    let near_far = config.near_far.unwrap_or_else(|| near_far(dataset, &bounds));
    let scene = initial_scene(config, clouds, frame(config, map, near_far), &dataset.name)?;
    scene.check()?;
    Ok(scene)
}

/// The frame of a model whose rays have the range `near_far`, in the dataset's units.
pub(super) fn frame(config: &TrainConfig, model_from_dataset: Similarity, near_far: [f64; 2]) -> Frame {
    let [near, far] = near_far.map(|t| t * model_from_dataset.scale);
    Frame {
        model_from_dataset,
        up: UpAxis::Z,
        meters_per_unit: None,
        near,
        far,
        background: config.background,
        color_space: ColorSpace::Srgb,
    }
}

/// The range of rays, in the dataset's units. It is derived from the cameras alone, unless one of them is inside
/// `bounds`, as in a room: then rays begin at the camera and reach the farthest corner.
fn near_far(dataset: &Dataset, bounds: &Aabb) -> [f64; 2] {
    let cameras = dataset.views.iter().map(|view| &view.camera);
    let inside = |p: DVec3| p.clamp(bounds.min, bounds.max) == p;
    if !cameras.clone().any(|camera| inside(camera.position)) {
        let CameraBounds { near, far, .. } = CameraBounds::from_cameras(cameras);
        return [near, far];
    }
    let farthest = |p: DVec3| (p - bounds.min).abs().max((p - bounds.max).abs()).length();
    [0.0, cameras.map(|camera| farthest(camera.position)).fold(0.0, f64::max)]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dataset::{Pixels, View};
    use crate::geometry::Camera;

    #[test]
    fn rays_of_cameras_in_a_room_begin_at_once_and_reach_its_corners() {
        let view = |x: f64, y: f64, z: f64| {
            let camera = Camera::looking_at([8, 8], 9.0, DVec3::new(x, y, z), DVec3::ZERO, DVec3::Z);
            View::new("", camera, Pixels::opaque([[0.0; 3]; 64]))
        };
        let room = Aabb::around(DVec3::ZERO, DVec3::new(3.0, 4.0, 0.5));
        let dataset = |views| Dataset::new("", views);
        let inside = near_far(&dataset(vec![view(1.0, 0.0, 0.0), view(-9.0, 0.0, 0.0)]), &room);
        assert_eq!(inside, [0.0, DVec3::new(12.0, 4.0, 0.5).length()]);
        let [near, far] = near_far(&dataset(vec![view(4.0, 0.0, 3.0), view(0.0, 4.0, 3.0)]), &room);
        assert!((near - 2.5).abs() < 1e-9 && (far - 7.5).abs() < 1e-9, "{near} {far}");
    }
}
