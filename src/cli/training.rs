//! Training as several commands do it: prior, placement, steps with progress on the console.

use std::ops::ControlFlow;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use rayon::prelude::*;

use super::console::Console;
use super::progress::Progress;
use super::table::plural;
use super::{Error, Session};
use crate::container::{self, EncodeOptions, Encoding};
use crate::dataset::Dataset;
use crate::digits::grouped;
use crate::geometry::Camera;
use crate::model::Scene;
use crate::prior::{self, BuildError, BuildOptions, Built, CoarseProgress, Outliers, VoxelBoxes};
use crate::psnr::RunningMse;
use crate::train::{self, StepReport, TrainConfig, Trainer};

/// The rule for outliers among the sparse points of structure from motion.
const SPARSE_OUTLIERS: Outliers = Outliers { neighbors: 16, deviations: 2.0 };
/// The margin around the sparse points' box, as a share of its size: surfaces without texture have no points.
const SPARSE_MARGIN: f64 = 0.1;

/// The cameras of `dataset`'s photographs.
pub(super) fn cameras(dataset: &Dataset) -> Vec<Camera> {
    dataset.views.iter().map(|view| view.camera).collect()
}

/// A flag that the first Ctrl-C or termination signal sets; the second one ends the process.
pub(super) fn interrupts() -> Result<Arc<AtomicBool>, Error> {
    let interrupted = Arc::new(AtomicBool::new(false));
    let seen = Arc::clone(&interrupted);
    ctrlc::set_handler(move || {
        if seen.swap(true, Ordering::SeqCst) {
            std::process::exit(4);
        }
    })
    .map_err(|e| Error::Runtime(format!("cannot handle Ctrl-C: {e}")))?;
    Ok(interrupted)
}

/// A trainer at its first step: prior from the photographs, and placement.
pub(super) fn begin<'a>(
    config: TrainConfig,
    dataset: &'a Dataset,
    interrupted: &AtomicBool,
    session: &Session,
) -> Result<Trainer<'a>, Error> {
    let occupied = reconstruct(&config, dataset, false, interrupted, session)?;
    place(config, dataset, &occupied, session)
}

/// The prior from the photographs, with progress on the console.
pub(super) fn reconstruct(
    config: &TrainConfig,
    dataset: &Dataset,
    bootstrap: bool,
    interrupted: &AtomicBool,
    session: &Session,
) -> Result<VoxelBoxes, Error> {
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
    let scene = train::place_scene(&config, dataset, occupied)?;
    let trainer = Trainer::new(config, scene, &dataset.views)?;
    session.console.say(&format!(
        "{} parameters, {} rays meet the model",
        grouped(trainer.scene().parameter_count()),
        grouped(trainer.ray_count() as u64)
    ));
    Ok(trainer)
}

/// The place of a scene by its sparse points.
pub(super) struct SparsePoints {
    /// The cells that hold points, without outliers, in the dataset's space.
    pub(super) boxes: VoxelBoxes,
    /// The distances at which rays begin and end.
    pub(super) near_far: [f64; 2],
}

/// The place of the sparse points in the file `path`, which `cameras` see; `None` if it has no points.
pub(super) fn sparse_points(path: &Path, cameras: &[Camera]) -> Result<Option<SparsePoints>, Error> {
    let options = BuildOptions { outliers: Some(SPARSE_OUTLIERS), ..BuildOptions::default() };
    match prior::build(&[path.to_path_buf()], &options, &mut |_| ControlFlow::Continue(())) {
        Ok(Built { boxes, .. }) => Ok(Some(SparsePoints { near_far: prior::ray_range(cameras, Some(&boxes)), boxes })),
        // Points in one place have no extent.
        Err(BuildError::Nothing { .. } | BuildError::OnePlace { .. }) => Ok(None),
        Err(error) => Err(error.into()),
    }
}

/// The box and the range of rays of the scene that `dataset` shows, as far as they are not given: around its sparse
/// points, in its own box, or behind the focus if photographs are opaque. Of photographs with transparent backgrounds
/// the cameras alone decide, in later steps.
pub(super) fn locate(config: &mut TrainConfig, dataset: &mut Dataset, session: &Session) -> Result<(), Error> {
    let cameras = cameras(dataset);
    let points = dataset.points.as_ref().map(|path| sparse_points(path, &cameras)).transpose()?.flatten();
    let range = match points {
        Some(SparsePoints { boxes, near_far }) => {
            let bounds = boxes.bounds();
            dataset.bounds.get_or_insert(bounds.grown(SPARSE_MARGIN * bounds.size()));
            near_far
        }
        None if dataset.views.par_iter().all(|view| view.pixels.is_opaque()) => {
            prior::ray_range_of_surroundings(&cameras, dataset.bounds.as_ref())
        }
        None => return Ok(()),
    };
    let [near, far] = *config.near_far.get_or_insert(range);
    let bounds = dataset.bounds.map_or_else(String::new, |b| format!(", within {:.3} to {:.3}", b.min, b.max));
    session.console.say(&format!("rays from {near:.3} to {far:.3}{bounds}"));
    Ok(())
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
    dataset: &Dataset,
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

/// Progress of the steps on the console.
pub(super) struct Meter<'a> {
    progress: Progress<'a>,
    begun: Instant,
    first_step: u64,
    error: RunningMse,
}

impl<'a> Meter<'a> {
    pub(super) fn start(console: &'a Console, trainer: &Trainer<'_>) -> Self {
        let progress = Progress::start(console, "train", trainer.config().steps);
        Self { progress, begun: Instant::now(), first_step: trainer.steps_done(), error: RunningMse::default() }
    }

    pub(super) fn add(&mut self, report: &StepReport, trainer: &Trainer<'_>) {
        self.error.add(report.mean_squared_error);
        let rays = (report.step - self.first_step) * trainer.config().batch_rays as u64;
        self.progress.set(report.step, || {
            let rate = rays as f64 / self.begun.elapsed().as_secs_f64();
            format!("{rate:.0} rays/s, train {:.2} dB", self.error.psnr())
        });
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

/// The checkpoint file `path` of an unfinished run, and its scene.
pub(super) fn read_state(path: &Path) -> Result<(train::Checkpoint, Scene), Error> {
    let bytes = std::fs::read(path).map_err(Error::io("read", path))?;
    let (progress, scene) = train::Checkpoint::from_bytes(&bytes).map_err(Error::malformed(path))?;
    let scene = container::decode(&scene).map_err(Error::malformed(path))?;
    Ok((progress, scene))
}
