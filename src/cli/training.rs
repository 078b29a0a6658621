//! Training as several commands do it: prior, placement, steps with progress on the console.

use std::ops::ControlFlow;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use glam::DVec3;
use rayon::prelude::*;

use super::console::Console;
use super::prior::Inputs;
use super::progress::Progress;
use super::state_file::StateFile;
use super::table::plural;
use super::{Error, Session};
use crate::container::{self, EncodeOptions, Encoding};
use crate::dataset::{self, Dataset};
use crate::digits::grouped;
use crate::geometry::Camera;
use crate::model::Scene;
use crate::pack::steer_to_size;
use crate::prior::{self, CoarseProgress, Location, VoxelBoxes};
use crate::psnr::RunningMse;
use crate::train::{self, StepReport, TrainConfig, Trainer};

/// The distance at which rays of an unbounded scene end, in edges of its inner box: what is farther does not move in any
/// picture.
const FAR_OF_UNBOUNDED: f64 = 1000.0;

/// The share of rays from which on tensors around the dataset's points hold the scene; surfaces without texture have no
/// points. In an unbounded scene, the rest may be so far away that photographs do not tell where.
const ENOUGH_COVERED: f64 = 0.99;
const ENOUGH_BEFORE_FAR: f64 = 0.7;
/// The degree of the sky of such a scene.
const SKY_DEGREE: u32 = 2;

/// The cameras of `dataset`'s photographs.
pub(super) fn cameras(dataset: &Dataset) -> Vec<Camera> {
    dataset.views.iter().map(|view| view.camera).collect()
}

/// A trainer at its first step: prior from the photographs, and placement.
pub(super) fn begin<'a>(
    mut config: TrainConfig,
    dataset: &'a mut Dataset,
    interrupted: &AtomicBool,
    session: &Session,
) -> Result<Trainer<'a>, Error> {
    let occupied = reconstruct(&mut config, dataset, false, interrupted, session)?;
    place(config, dataset, &occupied, session)
}

/// The prior from the files of `inputs`, which `cameras` see; `None` if none is named. Rays range over its cells unless
/// `config` has another range.
pub(super) fn import(
    config: &mut TrainConfig,
    inputs: &Inputs,
    cameras: &[Camera],
    interrupted: &AtomicBool,
    session: &Session,
) -> Result<Option<VoxelBoxes>, Error> {
    let Some(occupied) = inputs.voxels(cameras, interrupted, session)? else { return Ok(None) };
    let near_far = prior::ray_range(cameras, Some(&occupied));
    if config.shell.is_some() {
        locate_unbounded(config, cameras, near_far[0], session);
    } else {
        config.near_far.get_or_insert(near_far);
    }
    Ok(Some(match config.unbounded() {
        None => occupied,
        Some(unbounded) => unbounded.contract_boxes(&occupied),
    }))
}

/// The prior from the dataset's points if they cover the photographs, else from the photographs, with progress on the
/// console; `config` and `dataset` then say where the scene is.
pub(super) fn reconstruct(
    config: &mut TrainConfig,
    dataset: &mut Dataset,
    bootstrap: bool,
    interrupted: &AtomicBool,
    session: &Session,
) -> Result<VoxelBoxes, Error> {
    let asked = config.near_far;
    let is_opaque = is_opaque(dataset);
    let all_points = locate(config, dataset, is_opaque, session)?;
    if is_opaque && !bootstrap {
        let matched = find_points(config, dataset, session)?;
        if let Some(points) = prior_of_points(config, dataset, asked, all_points, &matched, session)? {
            return Ok(points);
        }
    }
    let total = if bootstrap { config.bootstrap.total_steps() } else { u64::from(config.prior.total_steps()) };
    let progress = Progress::start(&session.console, "prior", total);
    let start = Instant::now();
    let mut report = |at: CoarseProgress| {
        progress.set(u64::from(at.step), || format!("train {:.2} dB", at.psnr));
        if interrupted.load(Ordering::SeqCst) { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    };
    let occupied = if bootstrap {
        train::bootstrap_prior(config, dataset, &mut report)?
    } else {
        train::reconstruct_prior(config, dataset, &mut report).map_err(train::PrepareError::from)?
    };
    progress.finish(&format!(
        "prior: {} in {:.1} s",
        plural(occupied.cells.len(), "occupied voxel"),
        start.elapsed().as_secs_f64()
    ));
    Ok(occupied)
}

/// Places tensors on `occupied`; returns a trainer at its first step.
pub(super) fn place<'a>(
    config: TrainConfig,
    dataset: &'a Dataset,
    occupied: &VoxelBoxes,
    session: &Session,
) -> Result<Trainer<'a>, Error> {
    let config = config.fitted(occupied).map_err(train::PrepareError::from)?;
    let scene = train::place_scene(&config, dataset, occupied)?;
    let trainer = Trainer::new(config, scene, &dataset.views)?;
    session.console.say(&format!(
        "{} parameters, {} rays meet the model",
        grouped(trainer.scene().parameter_count()),
        grouped(trainer.ray_count() as u64)
    ));
    Ok(trainer)
}

/// The distances of `dataset`'s photographs, for a training by `config` that finds its prior without [`reconstruct`].
pub(super) fn find_distances(config: &TrainConfig, dataset: &mut Dataset, session: &Session) -> Result<(), Error> {
    if config.distance_weight > 0.0 && is_opaque(dataset) {
        find_points(config, dataset, session)?;
    }
    Ok(())
}

/// True if nothing shows through any photograph of `dataset`.
pub(super) fn is_opaque(dataset: &Dataset) -> bool {
    dataset.views.par_iter().all(|view| view.pixels.is_opaque())
}

/// Sets the distances of the photographs of `dataset`: those of its depth maps or, if it has none, to points that are
/// matched between the photographs, and else to its mesh. Returns the matched points.
fn find_points(config: &TrainConfig, dataset: &mut Dataset, session: &Session) -> Result<Vec<DVec3>, Error> {
    let start = Instant::now();
    let with_depth = dataset::read_distances(dataset)?;
    if with_depth > 0 {
        session.console.say(&format!("distances: those of {}", plural(with_depth, "depth map")));
        return Ok(Vec::new());
    }
    let points = prior::match_points(&mut dataset.views, config.shell.is_some());
    let (count, seconds) = (plural(points.len(), "point"), start.elapsed().as_secs_f64());
    session.console.say(&format!("matching: {count} on the surfaces of the photographs in {seconds:.1} s"));
    if let Some(file) = dataset.points.as_deref().filter(|_| config.distance_weight > 0.0) {
        let share = prior::mesh_distances(file, &mut dataset.views).map_err(prior::BuildError::from)?;
        let told = match share {
            Some(share) => format!("of {:.1} % more of the pixels, by the dataset's mesh", 100.0 * share),
            None => {
                let most = grouped(prior::MAX_TRIANGLES as u64);
                format!("none by {}, which has more than {most} triangles", file.display())
            }
        };
        if share != Some(0.0) {
            session.console.say(&format!("distances: {told}"));
        }
    }
    Ok(points)
}

/// The prior of opaque photographs from points: those of the dataset, outliers included, or those that are `matched`
/// between the photographs, whichever more of the rays meet, if these are nearly all. `config` then has the points' range
/// of rays, if none was `asked`. Else `config` says that the matched points are known, if they are more than the dataset's.
fn prior_of_points(
    config: &mut TrainConfig,
    dataset: &Dataset,
    asked: Option<[f64; 2]>,
    all_points: Option<VoxelBoxes>,
    matched: &[DVec3],
    session: &Session,
) -> Result<Option<VoxelBoxes>, Error> {
    let candidate = |cells: VoxelBoxes, what, near_far| -> Result<PointPrior, Error> {
        let config = TrainConfig { near_far, ..config.clone() };
        let share = train::covered_share(&config, dataset, &cells)?;
        Ok(PointPrior { cells, what, near_far, share })
    };
    let of_dataset = all_points.map(|points| candidate(points, "the dataset's points", config.near_far)).transpose()?;
    let unbounded = config.unbounded();
    let contracted: Vec<DVec3> =
        matched.iter().map(|&point| unbounded.map_or(point, |unbounded| unbounded.contract(point))).collect();
    let of_matching = prior::cells_around(&contracted).map(|cells| {
        let is_free = asked.is_none() && unbounded.is_none();
        let near_far = if is_free { Some(prior::ray_range(&cameras(dataset), Some(&cells))) } else { config.near_far };
        candidate(cells, "points matched between photographs", near_far)
    });
    let (dataset_share, of_matching) =
        (of_dataset.as_ref().map_or(0.0, |points| points.share), of_matching.transpose()?);
    let best = match of_matching {
        Some(points) if points.share > dataset_share => {
            // Thin and shiny things have none.
            (config.prior.points, config.prior.free_before_points) = (Some(points.cells.clone()), false);
            Some(points)
        }
        _ => of_dataset,
    };
    let Some(PointPrior { cells, what, near_far, share }) = best else { return Ok(None) };
    let is_enough = share >= if unbounded.is_some() { ENOUGH_BEFORE_FAR } else { ENOUGH_COVERED };
    let rest = if is_enough { "" } else { "; photographs tell the rest" };
    let count = plural(cells.cells.len(), "cell");
    session.console.say(&format!("prior: {count} of {what}, which {:.1} % of rays meet{rest}", 100.0 * share));
    if !is_enough {
        return Ok(None);
    }
    if let Some([near, far]) = near_far.filter(|range| Some(*range) != config.near_far) {
        session.console.say(&format!("rays from {near:.3} to {far:.3}, by these points"));
    }
    config.near_far = near_far;
    if share < ENOUGH_COVERED {
        let degree = *config.sky_degree.get_or_insert(if config.random_background { 0 } else { SKY_DEGREE });
        let cells = train::with_far_cells(config, dataset, &cells)?;
        let count = plural(cells.cells.len(), "cell");
        let sky = if degree > 0 { format!(", before a sky of degree {degree}") } else { String::new() };
        session.console.say(&format!("prior: {count} with those where the other rays end, far away{sky}"));
        return Ok(Some(cells));
    }
    Ok(Some(cells))
}

/// Cells around points that may be the prior.
struct PointPrior {
    /// In the space of the prior.
    cells: VoxelBoxes,
    what: &'static str,
    near_far: Option<[f64; 2]>,
    /// The share of rays that meet tensors around the cells.
    share: f64,
}

/// Where the scene of `dataset` is, as far as `config` and `dataset` do not say it. Returns the cells of all points, in the
/// space of the prior.
fn locate(
    config: &mut TrainConfig,
    dataset: &mut Dataset,
    is_opaque: bool,
    session: &Session,
) -> Result<Option<VoxelBoxes>, Error> {
    let cameras = cameras(dataset);
    let Location { near_far, bounds, points, all_points } =
        prior::locate(dataset.points.as_deref(), dataset.bounds, &cameras, || is_opaque)?;
    let points = points.filter(|_| is_opaque);
    config.prior.free_before_points = true;
    if config.shell.is_some() {
        locate_unbounded(config, &cameras, near_far[0], session);
    }
    if let Some(unbounded) = config.unbounded() {
        config.prior.points = points.map(|points| unbounded.contract_boxes(&points));
        return Ok(all_points.map(|points| unbounded.contract_boxes(&points)));
    }
    config.prior.points = points;
    let [near, far] = *config.near_far.get_or_insert(near_far);
    let within = bounds.map_or_else(String::new, |b| format!(", within {:.3} to {:.3}", b.min, b.max));
    session.console.say(&format!("rays from {near:.3} to {far:.3}{within}"));
    dataset.bounds = bounds;
    Ok(all_points)
}

/// The inner box and the range of an unbounded scene, whose rays begin at `near`, as far as `config` does not say them.
fn locate_unbounded(config: &mut TrainConfig, cameras: &[Camera], near: f64, session: &Session) {
    let [min, max] = *config.inner_box.get_or_insert_with(|| {
        let inner = prior::inner_box(cameras);
        [inner.min, inner.max]
    });
    let far = FAR_OF_UNBOUNDED * (max - min).max_element();
    let [near, far] = *config.near_far.get_or_insert([near, far]);
    session.console.say(&format!("rays from {near:.3} to {far:.3}, inner box {min:.3} to {max:.3}"));
}

/// The bytes of `scene`'s file.
pub(super) fn encode(scene: &Scene, factors: Encoding, path: &Path) -> Result<Vec<u8>, Error> {
    let options = EncodeOptions::uniform(factors);
    container::encode(scene, &options).map_err(|e| Error::Runtime(format!("{}: {e}", path.display())))
}

/// Trains `config`'s scene on `dataset` with progress on the console, for commands that write no checkpoints. Fails if
/// `interrupted` becomes true.
pub(super) fn train_through(
    config: TrainConfig,
    dataset: &mut Dataset,
    interrupted: &AtomicBool,
    session: &Session,
) -> Result<Scene, Error> {
    let mut trainer = begin(config, dataset, interrupted, session)?;
    let mut meter = Meter::start(&session.console, &trainer);
    while trainer.steps_done() < trainer.config().steps {
        if interrupted.load(Ordering::SeqCst) {
            return Err(Error::Runtime("interrupted".into()));
        }
        let report = trainer.step()?;
        meter.add(&report, &trainer);
    }
    meter.finish();
    Ok(trainer.scene())
}

/// The steps of `trainer` that are left, with progress on the console. The checkpoint is written to `state` every so many
/// steps, and when the run is interrupted.
pub(super) fn run_steps(
    trainer: &mut Trainer<'_>,
    state: &StateFile,
    checkpoint_every: Option<u64>,
    interrupted: &AtomicBool,
    session: &Session,
) -> Result<(), Error> {
    let mut meter = Meter::start(&session.console, trainer);
    while trainer.steps_done() < trainer.config().steps {
        let report = step(trainer)?;
        meter.add(&report, trainer);
        let stops = interrupted.load(Ordering::SeqCst) && report.step < trainer.config().steps;
        if stops || checkpoint_every.is_some_and(|every| report.step.is_multiple_of(every)) {
            state.write_training(trainer)?;
        }
        if stops {
            return Err(state.interrupted(&format!("step {}", report.step)));
        }
    }
    meter.finish();
    Ok(())
}

/// A step of `trainer`, and what a training for a size changes after it.
pub(super) fn step(trainer: &mut Trainer<'_>) -> Result<StepReport, Error> {
    let report = trainer.step()?;
    steer_to_size(trainer).map_err(|e| Error::Runtime(e.to_string()))?;
    Ok(report)
}

/// Progress of the steps on the console.
pub(super) struct Meter<'a> {
    progress: Progress<'a>,
    begun: Instant,
    first_step: u64,
    error: RunningMse,
    console: &'a Console,
    maps_colors: bool,
}

impl<'a> Meter<'a> {
    pub(super) fn start(console: &'a Console, trainer: &Trainer<'_>) -> Self {
        let progress = Progress::start(console, "train", trainer.config().steps);
        Self {
            progress,
            begun: Instant::now(),
            first_step: trainer.steps_done(),
            error: RunningMse::default(),
            console,
            maps_colors: false,
        }
    }

    pub(super) fn add(&mut self, report: &StepReport, trainer: &Trainer<'_>) {
        self.error.add(report.mean_squared_error);
        let rays = (report.step - self.first_step) * trainer.config().batch_rays as u64;
        self.progress.set(report.step, || {
            let rate = rays as f64 / self.begun.elapsed().as_secs_f64();
            format!("{rate:.0} rays/s, train {:.2} dB", self.error.psnr())
        });
        let photographs = trainer.checkpoint().exposures.maps().len();
        if photographs > 0 && !self.maps_colors {
            self.maps_colors = true;
            let count = plural(photographs, "photograph");
            self.console.say(&format!("exposure: fitted for {count}; the scene has the colors of their mean"));
        }
    }

    /// Calls `work`, which writes to standard error.
    pub(super) fn suspend<R>(&self, work: impl FnOnce() -> R) -> R {
        self.progress.suspend(work)
    }

    /// Excludes `time` from the rate.
    pub(super) fn skip(&mut self, time: Duration) {
        self.begun += time;
        self.progress.reset_rate();
    }

    pub(super) fn finish(self) {
        self.progress.finish(&format!("train: {:.2} dB on the last rays", self.error.psnr()));
    }
}
