//! A prior from photographs by tri-vectors alone (paper, appendix "Ablation Studies on Initial Geometry": "8 coarse
//! tri-vectors").
//!
//! In: posed photographs. Out: the occupied voxels. 2×2×2 tensors of eight components each cover the box of all frusta
//! and are trained as any scene is. They start empty (with the shift of −10, a feature of about 0 has no density), and
//! density grows where rays need it. The box of the occupied voxels bounds the next round. It takes longer than
//! [`strivec_capture::prior::coarse`] and finds less detail, but needs no other method's reconstruction.

use std::ops::ControlFlow;

use glam::{DVec3, UVec3};
use rayon::prelude::*;

use super::prepare::frame;
use super::{
    BootstrapOptions, DecoderConfig, Exposure, FinishConfig, LeanConfig, PhotographConfig, PoseConfig, PrepareError,
    SamplingConfig, ScaleConfig, ScheduleConfig, TrainConfig, Trainer, initial_scene,
};
use strivec_capture::dataset::{Dataset, Photograph};
use strivec_capture::prior;
use strivec_capture::prior::{CoarseProgress, VoxelBoxes};
use strivec_field::{Field, Samples, vectorized};
use strivec_format::geometry::{Aabb, Lattice, Ray, Similarity, cell_at, index_of};
use strivec_format::model::{DecoderMode, FactorKind, Placement, Scene, TensorCloud};
use strivec_format::psnr::RunningMse;

/// Share of its cells, rounded up, by which a tensor reaches past each of its faces into its neighbors. Without it, the
/// planes between tensors, in the middle of the scene, show in pictures.
const OVERLAP: f64 = 0.25;

/// The occupied voxels of `dataset`, in its own space, from eight tensors with `config`'s bootstrap options,
/// background, range and seed. The same settings always give the same voxels. `progress` is called after every step and
/// stops the work by returning [`ControlFlow::Break`].
///
/// # Errors
///
/// The errors of [`prior::coarse::reconstruct`], and if training fails.
pub fn bootstrap_prior(
    config: &TrainConfig,
    dataset: &Dataset,
    progress: &mut dyn FnMut(CoarseProgress) -> ControlFlow<()>,
) -> Result<VoxelBoxes, PrepareError> {
    let options = &config.bootstrap;
    options.check()?;
    prior::check_views(dataset)?;
    let near_far = config.space.near_far;
    let [near, far] = prior::near_and_far(dataset, near_far.map(|n| n[0]), near_far.map(|n| n[1]))?;
    let frusta = prior::frusta_within(dataset, near, far);
    if !frusta.is_solid() {
        return Err(prior::Error::no_box(dataset, &frusta).into());
    }
    let (mut done, total) = (0, options.total_steps() as u32);
    let mut within = frusta;
    let (mut found, mut psnr) = (None, 0.0);
    for (round, &steps) in options.steps.iter().enumerate() {
        let resolution = (options.resolution >> (options.steps.len() - 1 - round)).max(4);
        let cube = CoarseCube::new(&within, resolution)?;
        let config = cube.config(config, steps);
        let scene = cube.scene(&config, [near, far], &dataset.name)?;
        let mut trainer = Trainer::new(config, scene, &dataset.views)?;
        let mut fit = RunningMse::default();
        for _ in 0..steps {
            fit.add(trainer.step()?.mean_squared_error);
            done += 1;
            if progress(CoarseProgress { step: done, total, psnr: fit.psnr() }).is_break() {
                return Err(prior::Error::Cancelled { step: done }.into());
            }
        }
        let boxes = cube.occupied(&trainer.scene(), &dataset.views, options);
        if !boxes.cells.is_empty() {
            within = boxes.bounds().grown(DVec3::splat(2.0 * boxes.lattice.pitch.x)).intersection(&frusta);
        }
        (found, psnr) = (Some(boxes), fit.psnr());
    }
    match found {
        Some(boxes) if !boxes.cells.is_empty() => Ok(boxes),
        _ => Err(prior::Error::empty(dataset, done, psnr, config.photographs.background).into()),
    }
}

/// 2×2×2 boxes of cubic cells, and the space in which they are tensors.
#[derive(Debug)]
struct CoarseCube {
    model_from_dataset: Similarity,
    /// The smallest corner, in model units.
    corner: DVec3,
    /// Edge length of a cell, in model units.
    cell: f64,
    /// Cells of a tensor along each axis.
    resolution: UVec3,
}

impl CoarseCube {
    /// Covers `within`, which is in the dataset's space, with `resolution` cells along the longest axis of each box.
    fn new(within: &Aabb, resolution: u32) -> Result<Self, prior::Error> {
        let model_from_dataset = prior::canonical_map(within, prior::CANONICAL_HALF_EXTENT)?;
        let [min, max] = [within.min, within.max].map(|p| model_from_dataset.point(p));
        let cell = (max - min).max_element() / f64::from(2 * resolution);
        // Whole cells, which may reach a little beyond the box; rounding errors add none.
        let cells = ((max - min) / (2.0 * cell) - 1e-6).ceil().max(DVec3::ONE);
        let corner = 0.5 * (min + max) - cells * cell;
        Ok(Self { model_from_dataset, corner, cell, resolution: cells.as_uvec3() })
    }

    /// Cells by which each tensor reaches into the next.
    fn overlap(&self) -> UVec3 {
        (OVERLAP * self.resolution.as_dvec3()).ceil().as_uvec3()
    }

    /// `base` for a training of the cube. Only the geometry is used, so a linear map suffices for colors. No occupancy
    /// is estimated, as it would remove space in which density has yet to grow.
    fn config(&self, base: &TrainConfig, steps: u64) -> TrainConfig {
        let options = &base.bootstrap;
        let cloud = self.cloud();
        TrainConfig {
            schedule: ScheduleConfig {
                steps,
                upsample_at: Vec::new(),
                occupancy_at: Vec::new(),
                ..base.schedule.clone()
            },
            photographs: PhotographConfig {
                random_background: false,
                sky_degree: Some(0),
                exposure: Exposure::Off,
                ..base.photographs.clone()
            },
            poses: PoseConfig::default(),
            sampling: SamplingConfig { batch_rays: options.batch_rays, ray_candidates: 1, ..base.sampling.clone() },
            lean: LeanConfig::off(),
            finish: FinishConfig::off(),
            decoder: DecoderConfig {
                mode: DecoderMode::PerSample,
                features: 8,
                feature_frequencies: 1,
                direction_frequencies: 1,
                hidden: Vec::new(),
            },
            scales: vec![ScaleConfig {
                whole_scene: false,
                pitch: (self.resolution.as_dvec3() * self.cell).to_array(),
                edge: (2.0 * cloud.half_edge).to_array(),
                resolutions: vec![cloud.resolution],
                factors: FactorKind::Cp,
                density_rank: options.components,
                appearance_rank: options.components,
                top_k: 8,
            }],
            ..base.clone()
        }
    }

    fn cloud(&self) -> TensorCloud {
        let pitch = self.resolution.as_dvec3() * self.cell;
        let cells = (0..8).map(|n| UVec3::new(n & 1, n >> 1 & 1, n >> 2)).collect();
        TensorCloud {
            placement: Placement::Lattice { lattice: Lattice { origin: self.corner, pitch }, cells },
            half_edge: 0.5 * pitch + self.overlap().as_dvec3() * self.cell,
            resolution: (self.resolution + 2 * self.overlap()).to_array(),
        }
    }

    /// The scene that `config` starts from.
    fn scene(&self, config: &TrainConfig, near_far: [f64; 2], dataset: &str) -> Result<Scene, PrepareError> {
        let frame = frame(config, self.model_from_dataset, near_far);
        let scene = initial_scene(config, vec![self.cloud()], frame, dataset)?;
        scene.check()?;
        Ok(scene)
    }

    /// The cells of `scene` that are dense and at most one cell away from a sample that `views` see, in the dataset's
    /// space.
    fn occupied(&self, scene: &Scene, views: &[Photograph], options: &BootstrapOptions) -> VoxelBoxes {
        let field = Field::<f32>::unlimited(scene);
        let size = 2 * self.resolution;
        let seen = self.seen(&field, views, options);
        let is_near_seen = |cell: UVec3| {
            let (first, last) = (cell.saturating_sub(UVec3::ONE), (cell + 1).min(size - 1));
            let mut rows = (first.z..=last.z).flat_map(|z| (first.y..=last.y).map(move |y| (y, z)));
            rows.any(|(y, z)| (first.x..=last.x).any(|x| seen[self.index(UVec3::new(x, y, z))]))
        };
        let edges_in_a_step = self.cell / field.rules.step;
        let is_dense = |samples: &mut Samples<f32>, cell: UVec3| {
            let position = field.relative(self.corner + (cell.as_dvec3() + 0.5) * self.cell);
            let feature = vectorized(
                #[inline(always)]
                || field.density_feature(position, samples),
            );
            let depth = feature.map_or(0.0, |f| f64::from(field.optical_depth(f)) * edges_in_a_step);
            -(-depth).exp_m1() > options.occupied_alpha
        };
        // (z, y, x), the canonical order.
        let cells = (0..seen.len())
            .into_par_iter()
            .map_init(Samples::default, |samples, n| {
                let cell = self.cell_at(n);
                (is_near_seen(cell) && is_dense(samples, cell)).then_some(cell)
            })
            .flatten_iter()
            .collect();
        let back = self.model_from_dataset.inverse();
        let lattice =
            Lattice { origin: back.point(self.corner), pitch: DVec3::splat(self.cell / self.model_from_dataset.scale) };
        VoxelBoxes { lattice, cells }
    }

    /// The index of `cell` in the grid of all eight boxes.
    fn index(&self, cell: UVec3) -> usize {
        index_of(cell, 2 * self.resolution) as usize
    }

    /// The cell of an index.
    fn cell_at(&self, n: usize) -> UVec3 {
        cell_at(n as u64, 2 * self.resolution)
    }

    /// \[z\]\[y\]\[x\] true if a cell holds a sample of enough visibility weight for some pixel.
    fn seen(&self, field: &Field<f32>, views: &[Photograph], options: &BootstrapOptions) -> Vec<bool> {
        let pixels: usize = views.iter().map(|v| v.pixels.len()).sum();
        let stride = (pixels as f64 / f64::from(options.visibility_rays)).sqrt().ceil().max(1.0) as usize;
        let corner = field.relative(self.corner);
        let last = 2 * self.resolution - 1;
        let look = |mut seen: Vec<bool>, view: &Photograph| {
            let camera = view.camera.mapped(&self.model_from_dataset);
            let mut samples = Samples::default();
            for row in (0..camera.height).step_by(stride) {
                let rays: Vec<Ray> =
                    (0..camera.width).step_by(stride).filter_map(|column| camera.ray(column, row)).collect();
                vectorized(
                    #[inline(always)]
                    || field.march(&rays, &mut samples),
                );
                for &place in &samples.order {
                    if f64::from(samples.weight(place as usize)) <= options.min_visibility_weight {
                        continue;
                    }
                    let position = samples.positions[place as usize];
                    // Samples beyond the boxes, which tensors cover too, belong to the cells at the faces.
                    let cell = [0, 1, 2].map(|a| {
                        let at = (position[a] - corner[a]) / self.cell as f32;
                        (at.max(0.0) as u32).min(last[a])
                    });
                    seen[self.index(cell.into())] = true;
                }
            }
            seen
        };
        // A union does not depend on the order.
        let union = |mut a: Vec<bool>, b: Vec<bool>| {
            a.iter_mut().zip(b).for_each(|(a, b)| *a |= b);
            a
        };
        let none = || vec![false; (2 * self.resolution).as_u64vec3().element_product() as usize];
        views.par_iter().with_min_len(views.len().div_ceil(16)).fold(none, look).reduce(none, union)
    }
}
