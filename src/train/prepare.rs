//! From photographs to the scene that training starts from: prior, canonical map, placement.

use std::collections::BTreeSet;
use std::ops::ControlFlow;

use glam::IVec3;
use rayon::prelude::*;

use super::{ConfigError, ScaleConfig, TrainConfig, TrainError, initial_scene};
use strivec_capture::dataset::{Dataset, Photograph};
use strivec_capture::prior;
use strivec_capture::prior::{CoarseOptions, CoarseProgress, ScaleShape, VoxelBoxes};
use strivec_field::{Field, vectorized};
use strivec_format::Invalid;
use strivec_format::geometry::{Ray, Similarity};
use strivec_format::model::{ColorSpace, Frame, Scene, UpAxis};

/// Pixels among which the share of covered ones is counted, about.
const COVERAGE_PIXELS: f64 = 2e6;
/// The longest edge of the finest of [`close_tensors`], in half the extent of a scene or of its inner cube.
/// With the tensors of the preset 360, within which cameras stand, all rays meet one: 19.2 instead of 30.2 dB
/// (docs/experiments/2026-11-25-fox-and-360.md).
const CLOSE_EDGE: f64 = 0.17;

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
    Scene(#[from] Invalid),
    /// Training the prior's tensors failed.
    #[error(transparent)]
    Train(#[from] TrainError),
}

/// The coarse reconstruction of `dataset` with `config`'s options, background, range and seed.
///
/// # Errors
///
/// The errors of [`prior::coarse::reconstruct`].
pub fn reconstruct_prior(
    config: &TrainConfig,
    dataset: &Dataset,
    progress: &mut dyn FnMut(CoarseProgress) -> ControlFlow<()>,
) -> Result<VoxelBoxes, prior::Error> {
    let options = CoarseOptions {
        background: config.photographs.background,
        near: config.space.near_far.map(|n| n[0]),
        far: config.space.near_far.map(|n| n[1]),
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
    let config = &config.fitted(occupied)?;
    let prior_map = config.model_from_prior(&occupied.bounds())?;
    let boxes = occupied.mapped(&prior_map);
    let map = config.unbounded().map_or(prior_map, |unbounded| unbounded.model_from_dataset);
    let clouds = (config.scales.iter())
        .map(|s| {
            prior::place_on_boxes(&boxes, &ScaleShape { pitch: s.pitch, edge: s.edge, resolution: s.resolutions[0] })
        })
        .collect::<Result<Vec<_>, _>>()?;
    let cameras: Vec<_> = dataset.views.iter().map(|view| view.camera).collect();
    let near_far = config.space.near_far.unwrap_or_else(|| prior::ray_range(&cameras, None));
    let scene = initial_scene(config, clouds, frame(config, map, near_far), &dataset.name)?;
    scene.check()?;
    Ok(scene)
}

/// The share of `dataset`'s pixels whose rays meet tensors close around `occupied`; of large datasets, among some pixels of
/// each view.
///
/// # Errors
///
/// The errors of [`place_scene`].
pub fn covered_share(config: &TrainConfig, dataset: &Dataset, occupied: &VoxelBoxes) -> Result<f64, PrepareError> {
    let scene = place_scene(&close_tensors(config), dataset, occupied)?;
    let field = Field::<f32>::unlimited(&scene);
    let stride = coverage_stride(dataset);
    let counts = dataset.views.par_iter().map(|view| {
        let mut counts = [0_u64; 2];
        for_some_rays(view, stride, &scene, |ray, _| {
            counts[0] += 1;
            counts[1] += u64::from(meets(&field, ray));
        });
        counts
    });
    let [all, met] = counts.reduce(|| [0; 2], |a, b| [a[0] + b[0], a[1] + b[1]]);
    Ok(met as f64 / all.max(1) as f64)
}

/// `occupied`, the prior of an unbounded scene in contracted space, and the cells at the border of contracted space at which
/// the rays of `dataset` end that meet no tensors close around it: what nothing is known of is taken to be far away. If
/// `unknown_may_be_far`, so may be what each pixel without a known distance shows: its ray may meet tensors before that.
///
/// # Errors
///
/// The errors of [`place_scene`].
pub fn with_far_cells(
    config: &TrainConfig,
    dataset: &Dataset,
    occupied: &VoxelBoxes,
    unknown_may_be_far: bool,
) -> Result<VoxelBoxes, PrepareError> {
    let Some(contraction) = config.model.contraction else { return Ok(occupied.clone()) };
    let scene = place_scene(&close_tensors(config), dataset, occupied)?;
    let field = Field::<f32>::unlimited(&scene);
    let lattice = occupied.lattice;
    let bounds = contraction.bounds().grown(-0.5 * lattice.pitch);
    let stride = coverage_stride(dataset);
    let far = dataset.views.par_iter().map(|view| {
        let mut cells = Vec::new();
        for_some_rays(view, stride, &scene, |ray, pixel| {
            let is_unknown = unknown_may_be_far && view.distances.get(pixel).is_some_and(|&distance| distance == 0.0);
            if is_unknown || !meets(&field, ray) {
                let end = contraction.contract(ray.at(scene.frame.far)).clamp(bounds.min, bounds.max);
                cells.push(lattice.cell_of(end));
            }
        });
        cells
    });
    let cells = occupied.cells.iter().map(|cell| cell.as_ivec3());
    let all: BTreeSet<_> = cells.chain(far.flatten_iter().collect::<Vec<_>>()).map(|c| [c.z, c.y, c.x]).collect();
    let boxes = prior::boxes_of(&lattice, all.iter().map(|&[z, y, x]| IVec3::new(x, y, z)));
    Ok(boxes.unwrap_or_else(|| occupied.clone()))
}

/// `config` with tensors that are close around what they stand on: if its finest tensors are large, all are smaller in
/// proportion. Cameras may stand within large tensors, which then all rays meet.
fn close_tensors(config: &TrainConfig) -> TrainConfig {
    let half_extent = if config.model.contraction.is_some() { 1.0 } else { config.space.half_extent };
    let longest = |scale: &ScaleConfig| scale.edge.into_iter().fold(0.0, f64::max);
    let finest = config.scales.iter().map(longest).fold(f64::INFINITY, f64::min);
    let factor = (CLOSE_EDGE * half_extent / finest).min(1.0);
    let mut close = config.clone();
    for scale in &mut close.scales {
        (scale.pitch, scale.edge) = (scale.pitch.map(|p| p * factor), scale.edge.map(|e| e * factor));
        let fewer = |cells: u32| ((f64::from(cells) * factor).ceil() as u32).max(1);
        scale.resolutions.iter_mut().for_each(|resolution| *resolution = resolution.map(fewer));
        (scale.density_rank, scale.appearance_rank) = (1, 1);
    }
    close
}

/// The interval of columns and rows between the pixels of `dataset` among which covered ones are counted.
fn coverage_stride(dataset: &Dataset) -> usize {
    let pixels: usize = dataset.views.iter().map(|view| view.pixels.len()).sum();
    (pixels as f64 / COVERAGE_PIXELS).sqrt().ceil().max(1.0) as usize
}

/// Calls `visit` with the rays of every `stride`th pixel of every `stride`th row of `view` that count, in the space of
/// `scene`, and the pixels' numbers.
fn for_some_rays(view: &Photograph, stride: usize, scene: &Scene, mut visit: impl FnMut(&Ray, usize)) {
    let camera = view.camera.mapped(&scene.frame.model_from_dataset);
    for row in (stride as u32 / 2..camera.height).step_by(stride) {
        for column in (stride as u32 / 2..camera.width).step_by(stride) {
            let pixel = (row * camera.width + column) as usize;
            let ray = camera.ray(column, row).filter(|_| view.counts(pixel));
            ray.iter().for_each(|ray| visit(ray, pixel));
        }
    }
}

/// True if `ray` meets a tensor.
fn meets(field: &Field<f32>, ray: &Ray) -> bool {
    vectorized(
        #[inline(always)]
        || field.first_sample(ray).is_some(),
    )
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
        background: config.photographs.background,
        color_space: ColorSpace::Srgb,
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;
    use strivec_capture::dataset::Pixels;
    use strivec_format::geometry::{Camera, Contraction, Lattice};

    #[test]
    fn what_pixels_without_a_distance_show_may_be_far_behind_what_is_known() {
        let mut config = TrainConfig::default();
        config.model.contraction = Some(Contraction { shell: 0.4 });
        config.space.inner_box = Some([DVec3::NEG_ONE, DVec3::ONE]);
        config.space.near_far = Some([0.1, 2000.0]);
        // A plate that all rays meet.
        let lattice = Lattice { origin: DVec3::new(-0.05, -1.0, -1.0), pitch: DVec3::splat(0.1) };
        let plate = prior::boxes_of(&lattice, (0..400).map(|n| IVec3::new(0, n % 20, n / 20))).unwrap();
        let camera = Camera::looking_at([16, 16], 32.0, DVec3::new(0.9, 0.0, 0.0), DVec3::ZERO, DVec3::Z);
        let mut view = Photograph::new("a", camera, Pixels::opaque((0..256).map(|_| [0.5; 3])));
        view.distances = (0..256).map(|n| if n < 128 { 0.9 } else { 0.0 }).collect();
        let mut dataset = Dataset::new("plate", vec![view]);
        let cells = |dataset: &Dataset, unknown_may_be_far| {
            with_far_cells(&config, dataset, &plate, unknown_may_be_far).unwrap().cells.len()
        };
        assert_eq!(cells(&dataset, false), 400);
        let of_half = cells(&dataset, true);
        dataset.views[0].distances.fill(0.0);
        let of_all = cells(&dataset, true);
        assert!(400 < of_half && of_half < of_all, "{of_half} of half of the pixels, {of_all} of all");
        dataset.views[0].distances.clear();
        assert_eq!(cells(&dataset, true), 400, "a photograph that is not matched tells nothing");
    }
}
