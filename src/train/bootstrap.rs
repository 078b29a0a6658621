//! A prior from photographs with nothing but our own tensors (paper, appendix "Ablation Studies on Initial Geometry":
//! "8 coarse tri-vectors").
//!
//! In: posed photographs. Out: the voxels in which something is seen. CoarseCube tensors, 2×2×2, of eight components
//! each cover the box of all frusta and are trained as any scene is. They start empty (a feature of about 0 is none,
//! with the shift of −10), and density grows where rays need it. What is found bounds the next round, in which eight
//! tensors cover that alone. It takes longer than [`crate::prior::coarse`] and finds less detail: it is for those who
//! want no other method's reconstruction.

use std::ops::ControlFlow;

use glam::{DVec3, UVec3};
use rayon::prelude::*;

use super::prepare::frame;
use super::{BootstrapOptions, DecoderConfig, PrepareError, ScaleConfig, TrainConfig, Trainer, initial_scene};
use crate::dataset::{Dataset, View};
use crate::field::{Field, Samples, vectorized};
use crate::geometry::{Aabb, Lattice, Ray, Similarity, cell_at, index_of};
use crate::model::{DecoderMode, Placement, Scene, TensorCloud};
use crate::prior::{self, CoarseProgress, RunningMse, VoxelBoxes};

/// By this share of its cells, rounded up, a tensor reaches past each of its faces into its neighbors. Without it the
/// planes in which they meet, the middle of the scene, show.
const OVERLAP: f64 = 0.25;

/// The occupied voxels of `dataset`, in its own space, found by eight tensors with `config`'s bootstrap options,
/// background, range and seed. Always the same ones for the same settings. `progress` is called after every step and
/// stops the work by returning [`ControlFlow::Break`].
///
/// # Errors
///
/// As [`prior::coarse::reconstruct`], and where training fails.
pub fn bootstrap_prior(
    config: &TrainConfig,
    dataset: &Dataset,
    progress: &mut dyn FnMut(CoarseProgress) -> ControlFlow<()>,
) -> Result<VoxelBoxes, PrepareError> {
    let options = &config.bootstrap;
    options.check()?;
    prior::check_views(dataset)?;
    let [near, far] = prior::near_and_far(dataset, config.near_far.map(|n| n[0]), config.near_far.map(|n| n[1]))?;
    let frusta = prior::frusta_box(dataset.views.iter().map(|v| &v.camera), near, far);
    if !frusta.is_solid() {
        return Err(prior::Error::View {
            view: dataset.views[0].name.clone(),
            expected: "cameras whose frusta span a box".into(),
            found: format!("{frusta:?}"),
        }
        .into());
    }
    let (mut done, total) = (0, options.total_steps() as u32);
    let mut within = frusta;
    let (mut found, mut psnr) = (None, 0.0);
    for (round, &steps) in options.steps.iter().enumerate() {
        let resolution = (options.resolution >> (options.steps.len() - 1 - round)).max(4);
        let eight = CoarseCube::over(&within, resolution)?;
        let config = eight.config(config, steps);
        let scene = eight.scene(&config, [near, far], &dataset.name)?;
        let mut trainer = Trainer::new(config, scene, &dataset.views)?;
        let mut fit = RunningMse::default();
        for _ in 0..steps {
            fit.add(trainer.step()?.mean_squared_error);
            done += 1;
            if progress(CoarseProgress { step: done, total, psnr: fit.psnr() }).is_break() {
                return Err(prior::Error::Cancelled { step: done }.into());
            }
        }
        let boxes = eight.occupied(&trainer.scene(), &dataset.views, options);
        if !boxes.cells.is_empty() {
            within = boxes.bounds().grown(DVec3::splat(2.0 * boxes.lattice.pitch.x)).intersection(&frusta);
        }
        (found, psnr) = (Some(boxes), fit.psnr());
    }
    match found {
        Some(boxes) if !boxes.cells.is_empty() => Ok(boxes),
        _ => Err(prior::Error::empty(dataset, done, psnr, config.background).into()),
    }
}

/// CoarseCube boxes of cubic cells, and the space in which they are tensors.
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
    /// Over `within`, which is in the dataset's space, with `resolution` cells along the longest axis of each.
    fn over(within: &Aabb, resolution: u32) -> Result<Self, prior::Error> {
        let model_from_dataset = prior::canonical_map(within, prior::CANONICAL_HALF_EXTENT)?;
        let [min, max] = [within.min, within.max].map(|p| model_from_dataset.point(p));
        let cell = (max - min).max_element() / f64::from(2 * resolution);
        // Whole cells, a little more than the box; rounding alone adds none.
        let cells = ((max - min) / (2.0 * cell) - 1e-6).ceil().max(DVec3::ONE);
        let corner = 0.5 * (min + max) - cells * cell;
        Ok(Self { model_from_dataset, corner, cell, resolution: cells.as_uvec3() })
    }

    /// Cells by which each tensor reaches into the next.
    fn overlap(&self) -> UVec3 {
        (OVERLAP * self.resolution.as_dvec3()).ceil().as_uvec3()
    }

    /// `base` for a training of the eight. Geometry is all that is wanted, so colors need no more than a linear map,
    /// and no occupancy may take away what has yet to grow.
    fn config(&self, base: &TrainConfig, steps: u64) -> TrainConfig {
        let options = &base.bootstrap;
        let cloud = self.cloud();
        TrainConfig {
            preset: "bootstrap".into(),
            steps,
            batch_rays: options.batch_rays,
            random_background: false,
            upsample_at: Vec::new(),
            occupancy_at: Vec::new(),
            decoder: DecoderConfig {
                mode: DecoderMode::PerSample,
                features: 8,
                feature_frequencies: 1,
                direction_frequencies: 1,
                hidden: Vec::new(),
            },
            scales: vec![ScaleConfig {
                pitch: (self.resolution.as_dvec3() * self.cell).to_array(),
                edge: (2.0 * cloud.half_edge).to_array(),
                resolutions: vec![cloud.resolution],
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

    /// The cells of `scene` that are dense and within one cell of what `views` see of it, in the dataset's space.
    fn occupied(&self, scene: &Scene, views: &[View], options: &BootstrapOptions) -> VoxelBoxes {
        let field = Field::<f32>::new(scene);
        let size = 2 * self.resolution;
        let seen = self.seen(&field, views, options);
        let is_near_seen = |cell: UVec3| {
            let (first, last) = (cell.saturating_sub(UVec3::ONE), (cell + 1).min(size - 1));
            let mut rows = (first.z..=last.z).flat_map(|z| (first.y..=last.y).map(move |y| (y, z)));
            rows.any(|(y, z)| (first.x..=last.x).any(|x| seen[self.number(UVec3::new(x, y, z))]))
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
                let cell = self.cell_number(n);
                (is_near_seen(cell) && is_dense(samples, cell)).then_some(cell)
            })
            .flatten_iter()
            .collect();
        let back = self.model_from_dataset.inverse();
        let lattice =
            Lattice { origin: back.point(self.corner), pitch: DVec3::splat(self.cell / self.model_from_dataset.scale) };
        VoxelBoxes { lattice, cells }
    }

    /// The number of `cell`, of all eight boxes together.
    fn number(&self, cell: UVec3) -> usize {
        index_of(cell, 2 * self.resolution) as usize
    }

    /// The cell of a number.
    fn cell_number(&self, n: usize) -> UVec3 {
        cell_at(n as u64, 2 * self.resolution)
    }

    /// \[z\]\[y\]\[x\] the cells that hold a sample which adds enough to some pixel.
    fn seen(&self, field: &Field<f32>, views: &[View], options: &BootstrapOptions) -> Vec<bool> {
        let pixels: usize = views.iter().map(|v| v.pixels.len()).sum();
        let stride = (pixels as f64 / f64::from(options.visibility_rays)).sqrt().ceil().max(1.0) as usize;
        let corner = field.relative(self.corner);
        let last = 2 * self.resolution - 1;
        let look = |mut seen: Vec<bool>, view: &View| {
            let camera = view.camera.mapped(&self.model_from_dataset);
            let mut samples = Samples::default();
            for row in (0..camera.height).step_by(stride) {
                let rays: Vec<Ray> = (0..camera.width).step_by(stride).map(|column| camera.ray(column, row)).collect();
                vectorized(
                    #[inline(always)]
                    || field.march(&rays, &mut samples),
                );
                for &place in &samples.order {
                    if f64::from(samples.weight(place as usize)) <= options.min_visibility_weight {
                        continue;
                    }
                    let position = samples.positions[place as usize];
                    // What the tensors cover beyond the boxes belongs to the cells at their faces.
                    let cell = [0, 1, 2].map(|a| {
                        let at = (position[a] - corner[a]) / self.cell as f32;
                        (at.max(0.0) as u32).min(last[a])
                    });
                    seen[self.number(cell.into())] = true;
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
