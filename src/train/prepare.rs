//! From photographs to the scene that training starts from: prior, canonical map, placement.

use std::ops::ControlFlow;

use rayon::prelude::*;

use super::{ConfigError, TrainConfig, TrainError, initial_scene};
use crate::dataset::{Dataset, View};
use crate::field::{Field, vectorized};
use crate::geometry::Similarity;
use crate::model::{BrokenInvariant, ColorSpace, Frame, Scene, UpAxis};
use crate::prior::{self, CoarseOptions, CoarseProgress, ScaleShape, VoxelBoxes};

/// Pixels among which the share of covered ones is counted, about.
const COVERAGE_PIXELS: f64 = 2e6;

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
        unbounded: config.unbounded(),
        ..config.prior.clone()
    };
    prior::coarse::reconstruct(dataset, &options, config.seed, progress)
}

/// A scene of random tensors on `occupied`, which is in the dataset's space or, for an unbounded scene, in contracted
/// space (paper, "Distributing local tensors"). Without `config`'s own, the range of rays is that of the coarse
/// reconstruction; for a prior of files, set
/// [`prior::ray_range`]'s first.
///
/// # Errors
///
/// If there is no cell to place tensors on.
pub fn place_scene(config: &TrainConfig, dataset: &Dataset, occupied: &VoxelBoxes) -> Result<Scene, PrepareError> {
    let prior_map = config.model_from_prior(&occupied.bounds())?;
    let boxes = occupied.mapped(&prior_map);
    let map = config.unbounded().map_or(prior_map, |unbounded| unbounded.model_from_dataset);
    let clouds = (config.scales.iter())
        .map(|s| {
            prior::place_on_boxes(&boxes, &ScaleShape { pitch: s.pitch, edge: s.edge, resolution: s.resolutions[0] })
        })
        .collect::<Result<Vec<_>, _>>()?;
    let cameras: Vec<_> = dataset.views.iter().map(|view| view.camera).collect();
    let near_far = config.near_far.unwrap_or_else(|| prior::ray_range(&cameras, None));
    let scene = initial_scene(config, clouds, frame(config, map, near_far), &dataset.name)?;
    scene.check()?;
    Ok(scene)
}

/// The share of `dataset`'s pixels whose rays meet the tensors that [`place_scene`] places on `occupied`; of large
/// datasets, among some pixels of each view.
///
/// # Errors
///
/// As [`place_scene`].
pub fn covered_share(config: &TrainConfig, dataset: &Dataset, occupied: &VoxelBoxes) -> Result<f64, PrepareError> {
    let scene = place_scene(config, dataset, occupied)?;
    let field = Field::<f32>::new(&scene);
    let pixels: usize = dataset.views.iter().map(|view| view.pixels.len()).sum();
    let stride = (pixels as f64 / COVERAGE_PIXELS).sqrt().ceil().max(1.0) as usize;
    let counts = |view: &View| {
        let camera = view.camera.mapped(&scene.frame.model_from_dataset);
        let mut counts = [0_u64; 2];
        for row in (stride as u32 / 2..camera.height).step_by(stride) {
            for column in (stride as u32 / 2..camera.width).step_by(stride) {
                let ray = camera.ray(column, row).filter(|_| view.counts((row * camera.width + column) as usize));
                let Some(ray) = ray else { continue };
                counts[0] += 1;
                counts[1] += u64::from(vectorized(
                    #[inline(always)]
                    || field.first_sample(&ray).is_some(),
                ));
            }
        }
        counts
    };
    let [all, met] = dataset.views.par_iter().map(counts).reduce(|| [0; 2], |a, b| [a[0] + b[0], a[1] + b[1]]);
    Ok(met as f64 / all.max(1) as f64)
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
