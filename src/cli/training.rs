//! Training as several commands do it: prior, placement, steps with progress on the console.

use std::ops::ControlFlow;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use rayon::prelude::*;

use super::console::Console;
use super::prior::Inputs;
use super::progress::Progress;
use super::table::plural;
use super::{Error, Session};
use crate::container::{self, EncodeOptions, Encoding};
use crate::dataset::Dataset;
use crate::digits::grouped;
use crate::geometry::Camera;
use crate::model::Scene;
use crate::prior::{self, CoarseProgress, Location, VoxelBoxes};
use crate::psnr::RunningMse;
use crate::train::{self, StepReport, TrainConfig, Trainer};

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
    let occupied = inputs.voxels(cameras, interrupted, session)?;
    if let Some(occupied) = &occupied {
        config.near_far.get_or_insert_with(|| prior::ray_range(cameras, Some(occupied)));
    }
    Ok(occupied)
}

/// The prior from the photographs, with progress on the console; `config` and `dataset` then say where the scene is.
pub(super) fn reconstruct(
    config: &mut TrainConfig,
    dataset: &mut Dataset,
    bootstrap: bool,
    interrupted: &AtomicBool,
    session: &Session,
) -> Result<VoxelBoxes, Error> {
    locate(config, dataset, session)?;
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

/// Where the scene of `dataset` is, as far as `config` and `dataset` do not say it.
fn locate(config: &mut TrainConfig, dataset: &mut Dataset, session: &Session) -> Result<(), Error> {
    let is_opaque = || dataset.views.par_iter().all(|view| view.pixels.is_opaque());
    let Location { near_far, bounds, .. } =
        prior::locate(dataset.points.as_deref(), dataset.bounds, &cameras(dataset), is_opaque)?;
    let [near, far] = *config.near_far.get_or_insert(near_far);
    let within = bounds.map_or_else(String::new, |b| format!(", within {:.3} to {:.3}", b.min, b.max));
    session.console.say(&format!("rays from {near:.3} to {far:.3}{within}"));
    dataset.bounds = bounds;
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
