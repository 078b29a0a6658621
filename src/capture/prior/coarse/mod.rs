//! The trainer of coarse voxel grids: DVGO's first stage, on the CPU (Sun et al., "Direct Voxel Grid Optimization",
//! CVPR 2022, section 4).
//!
//! In: posed photographs and [`CoarseOptions`]. Out: the occupied voxels. A dense grid of densities and colors over the
//! box of all frusta is trained through volume rendering, first with large voxels, then with small ones inside the box
//! of the occupied large ones. The same dataset, options and seed give the same bits on any number of threads.
//!
//! This trainer shares no code with `train/`, which is a layer above: it has one dense grid instead of tensors, and no
//! network. `ray_sampler` draws pixels. `trainer` runs one step on one grid: `ray_loss` traces fixed chunks of rays and
//! differentiates their loss, and `adam` sums the gradients of each plane of vertices in one task and updates it.

mod adam;
mod grid;
mod known;
mod options;
mod ray_loss;
mod ray_sampler;
#[cfg(test)]
mod tests;
mod trainer;
mod visibility;

use std::ops::ControlFlow;

use glam::DVec3;

pub use options::CoarseOptions;

use self::grid::CoarseGrid;
use self::known::KnownVertices;
use self::ray_loss::density_of_alpha;
use self::ray_sampler::PixelSampler;
pub use self::ray_sampler::check_views;
use self::trainer::CoarseTrainer;
use super::free_space::FreeSpace;
use super::{CameraBounds, CameraStatistics, Error, VoxelBoxes, frusta_box};
use crate::dataset::Dataset;
use strivec_format::geometry::{Aabb, Camera, Lattice, Similarity, cell_at};
use strivec_format::psnr::RunningMse;

/// Progress of a training.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CoarseProgress {
    /// Finished steps.
    pub step: u32,
    /// All steps.
    pub total: u32,
    /// Training PSNR over the last steps, in dB.
    pub psnr: f64,
}

/// Trains coarse grids on `dataset` and returns the occupied voxels, in the dataset's space or, if `options` choose it,
/// in contracted space. The result depends on `options` and `seed` alone. `progress` is called after every step and
/// stops the training by returning [`ControlFlow::Break`].
///
/// # Errors
///
/// If an option is out of range, the dataset has no views, a view's pixels do not match its camera, a camera is not
/// finite, no voxel is occupied, or `progress` stops the training.
pub fn reconstruct(
    dataset: &Dataset,
    options: &CoarseOptions,
    seed: u64,
    progress: &mut dyn FnMut(CoarseProgress) -> ControlFlow<()>,
) -> Result<VoxelBoxes, Error> {
    options.check()?;
    let map = options.unbounded.map_or(Similarity::IDENTITY, |unbounded| unbounded.model_from_dataset);
    let photographs = PixelSampler::new(dataset, options.background, &map)?;
    let [near, far] = near_and_far(dataset, options.near, options.far)?;
    let frusta = match options.unbounded {
        None => frusta_within(dataset, near, far),
        Some(unbounded) => unbounded.contraction.bounds(),
    };
    let near_far = [near, far].map(|t| t * map.scale);
    let contraction = options.unbounded.map(|unbounded| unbounded.contraction);
    let points = options.points.as_ref();
    let carving = points.filter(|_| options.free_before_points);
    let free = carving.map(|points| FreeSpace::new(photographs.cameras(), points, contraction.as_ref()));
    if !frusta.is_solid() {
        return Err(Error::no_box(dataset, &frusta));
    }

    let levels = options.steps.len();
    let coarsest = f64::from(options.voxels) / 8.0_f64.powi(levels as i32 - 1);
    let mut grid = CoarseGrid::<f32>::new(&frusta, coarsest.max(8.0));
    let mut visible = Vec::new();
    let mut known = None;
    let mut done = 0;
    let mut fit = RunningMse::default();
    for (number, &steps) in options.steps.iter().enumerate() {
        if number > 0 {
            let found = worth_refining(&grid, options);
            grid = grid.refined(&found.map_or(frusta, |found| found.intersection(&frusta)));
        }
        let finest_voxels = f64::from(1_u32 << (levels - 1 - number));
        let mut trainer = CoarseTrainer::new(grid, &photographs, options, near_far, finest_voxels, free.as_ref());
        for step in 0..steps {
            fit.add(trainer.step(&photographs, seed, u64::from(done), step));
            done += 1;
            let report = CoarseProgress { step: done, total: options.total_steps(), psnr: fit.psnr() };
            if progress(report).is_break() {
                return Err(Error::Cancelled { step: done });
            }
        }
        if number + 1 == levels {
            known = points.map(|points| KnownVertices::new(trainer.grid(), points));
            visible = trainer.visible(&photographs, options, known.as_ref());
        }
        grid = trainer.into_grid();
    }

    let mut boxes = occupied(&grid, options, |n| visible[n]);
    if let Some(known) = &known {
        boxes.cells = (0..grid.values.len())
            .filter(|&n| boxes.cells.binary_search_by_key(&n, |&cell| grid.index(cell)).is_ok() || known.contains(n))
            .map(|n| cell_at(n as u64, grid.vertices))
            .collect();
    }
    if boxes.cells.is_empty() {
        return Err(Error::empty(dataset, done, fit.psnr(), options.background));
    }
    Ok(boxes)
}

/// The box of the dataset's frusta between `near` and `far`, but for cameras far from all others, or its part in the box that the dataset itself has.
pub fn frusta_within(dataset: &Dataset, near: f64, far: f64) -> Aabb {
    let cameras: Vec<Camera> = dataset.views.iter().map(|view| view.camera).collect();
    let frusta = frusta_box(CameraStatistics::of(&cameras).usual(&cameras), near, far);
    let within = dataset.bounds.map(|bounds| frusta.intersection(&bounds));
    within.filter(Aabb::is_solid).unwrap_or(frusta)
}

/// Distances at which rays begin and end, in dataset units: those given, else those of [`CameraBounds`].
pub fn near_and_far(dataset: &Dataset, near: Option<f64>, far: Option<f64>) -> Result<[f64; 2], Error> {
    let derived = CameraBounds::from_cameras(dataset.views.iter().map(|v| &v.camera));
    let (near, far) = (near.unwrap_or(derived.near), far.unwrap_or(derived.far));
    if near >= 0.0 && near < far && far.is_finite() {
        Ok([near, far])
    } else {
        Err(Error::option("near_far", "two numbers with 0 <= near < far", [near, far]))
    }
}

/// The box that the next grid covers: that of the occupied voxels and of the points, grown by two voxels. A grid no larger
/// than the scene also fits the processor's caches. `None` if no voxel is occupied yet.
fn worth_refining(grid: &CoarseGrid<f32>, options: &CoarseOptions) -> Option<Aabb> {
    let known = options.points.as_ref().map_or(Aabb::EMPTY, VoxelBoxes::bounds);
    let bounds = occupied(grid, options, |_| true).bounds().union(&known);
    bounds.is_solid().then(|| bounds.grown(DVec3::splat(2.0 * grid.voxel)).intersection(&grid.bounds()))
}

/// The voxels around those of the vertices that count whose α over a voxel edge exceeds the threshold. A vertex seen by too few views keeps
/// its initial density, which is below it.
fn occupied(grid: &CoarseGrid<f32>, options: &CoarseOptions, counts: impl Fn(usize) -> bool) -> VoxelBoxes {
    let shift = density_of_alpha(options.initial_alpha, 1.0);
    let threshold = (density_of_alpha(options.occupied_alpha, 1.0) - shift) as f32;
    let vertex = |n: usize| cell_at(n as u64, grid.vertices);
    let cells = (0..grid.values.len()).filter(|&n| grid.values[n][0] > threshold && counts(n)).map(vertex).collect();
    let lattice = Lattice { origin: grid.origin - 0.5 * grid.voxel, pitch: DVec3::splat(grid.voxel) };
    VoxelBoxes { lattice, cells }
}
