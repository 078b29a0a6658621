//! From photographs to the scene that training starts from: coarse prior, canonical map, placement.

use std::ops::ControlFlow;

use super::{ConfigError, TrainConfig, TrainError, initial_scene};
use crate::dataset::Dataset;
use crate::geometry::Similarity;
use crate::model::{BrokenInvariant, ColorSpace, Frame, Scene, UpAxis};
use crate::prior::{self, CameraBounds, CoarseOptions, CoarseProgress, ScaleShape, VoxelBoxes};

/// Why there is nothing to train.
#[derive(Debug, thiserror::Error)]
pub enum PrepareError {
    /// No prior, or no placement on it.
    #[error(transparent)]
    Prior(#[from] prior::Error),
    /// Settings that do not fit the prior.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// A scene that no reader would accept.
    #[error(transparent)]
    Scene(#[from] BrokenInvariant),
    /// The tensors that were to find the scene could not be trained.
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

/// A scene of random tensors on `occupied`, which is in the dataset's space (DESIGN, section 2: Presets, Units).
///
/// # Errors
///
/// Where the prior or the settings leave nothing to place tensors on.
pub fn place_scene(config: &TrainConfig, dataset: &Dataset, occupied: &VoxelBoxes) -> Result<Scene, PrepareError> {
    let map = prior::canonical_map(&occupied.bounds())?;
    let boxes = occupied.mapped(&map);
    let clouds = (config.scales.iter())
        .map(|s| {
            prior::place_on_boxes(&boxes, &ScaleShape { pitch: s.pitch, edge: s.edge, resolution: s.resolutions[0] })
        })
        .collect::<Result<Vec<_>, _>>()?;
    let scene = initial_scene(config, clouds, frame(config, dataset, map), &dataset.name)?;
    scene.check()?;
    Ok(scene)
}

/// How a model of `dataset` sits in its space.
pub(super) fn frame(config: &TrainConfig, dataset: &Dataset, model_from_dataset: Similarity) -> Frame {
    let derived = CameraBounds::of_cameras(dataset.views.iter().map(|v| &v.camera));
    let [near, far] = config.near_far.unwrap_or([derived.near, derived.far]).map(|t| t * model_from_dataset.scale);
    Frame {
        model_from_dataset,
        up: UpAxis::Z,
        metres_per_unit: None,
        near,
        far,
        background: config.background,
        color_space: ColorSpace::Srgb,
    }
}
