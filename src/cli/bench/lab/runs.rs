//! Timed training steps and frames.

use std::convert::Infallible;

use serde::Serialize;

use super::{MemoryMark, Runs, Spread, StageTable};
use strivec_field::render::CpuRenderer;
use strivec_field::{Field, Work};
use strivec_format::geometry::Camera;
use strivec_format::model::Scene;
use strivec_train::{TrainConfig, TrainError, Trainer};

/// Steps or frames of one kind on the threads of one pool.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Measured {
    /// Threads of the pool.
    pub threads: usize,
    /// Seconds of a step or frame.
    pub seconds: Spread,
    /// Time by stage.
    pub stages: StageTable,
    /// Peak memory above that before the work, in bytes; `None` if the system does not report it.
    pub peak_bytes: Option<u64>,
}

/// A training configuration that leaves its scene unchanged, for measurements of many steps at one point: no schedule,
/// and learning rates below the rounding of factors.
pub fn at_rest(config: &TrainConfig) -> TrainConfig {
    const STILL: f64 = 1e-20;
    let mut config = config.clone();
    (config.optimizer.factor_learning_rate, config.optimizer.network_learning_rate) = (STILL, STILL);
    (config.schedule.upsample_at, config.schedule.occupancy_at) = (Vec::new(), Vec::new());
    config
}

/// Measures the next steps of `trainer` on the threads of the current pool; `memory` was set before the trainer was made.
///
/// # Errors
///
/// The errors of [`Trainer::step`].
pub fn training_steps(trainer: &mut Trainer<'_>, runs: Runs, memory: MemoryMark) -> Result<Measured, TrainError> {
    let (seconds, reports) = runs.time(|| trainer.step())?;
    let peak_bytes = memory.peak();
    Ok(measured(seconds, reports.into_iter().map(|report| report.work), peak_bytes))
}

/// Measures frames of `scene` from `camera`, in the model's space, with the fast renderer on the threads of the current
/// pool.
pub fn frames(scene: &Scene, camera: &Camera, runs: Runs, memory: MemoryMark) -> Measured {
    let renderer = CpuRenderer::from_field(Field::<f32>::unlimited(scene));
    let timed: Result<_, Infallible> = runs.time(|| Ok(renderer.render_with_work(camera).1));
    let Ok((seconds, works)) = timed;
    measured(seconds, works.into_iter(), memory.peak())
}

fn measured(seconds: Spread, works: impl Iterator<Item = Work>, peak_bytes: Option<u64>) -> Measured {
    let (mut all, threads) = (Work::default(), rayon::current_num_threads());
    works.for_each(|work| all.add(&work));
    // The mean, like that of the stages: with the median, one slow run would hide the idle time.
    let stages = StageTable::new(&all, seconds.count, threads, seconds.mean);
    Measured { threads, seconds, stages, peak_bytes }
}
