//! Resizing after training: scenes with fewer parameters, or with more.
//!
//! In: a trained scene and its photographs. Out: the same scene with another number of parameters, counted without
//! components of zeros ([`Scene::nonzero_parameter_count`]). Shrinking is a training that gives up parameters; growing
//! goes in rounds, each with a short training. Both can be interrupted, and resume.

mod grow;
mod ranks;
mod shrink;

pub use grow::{GrowRound, GrowState, GrowStep, Growing};
pub use shrink::{ShrinkGoal, shrink};

use super::{FinishConfig, LeanConfig, ScaleConfig, TrainConfig, TrainError, Trainer, prune_dead_components};
use crate::model::{Scale, Scene};

/// Learning rates start at this share of the run's: about where those of a preset end.
const LEARNING_RATE_SHARE: f64 = 0.25;

/// Training of a scene that is resized.
#[derive(Clone, Debug)]
pub struct Tuning {
    /// Steps: all of a shrinking, or those of a round of growing; the last training then has twice as many.
    pub steps: u64,
    /// Settings of the run that made the scene. Its schedule and scales are not used.
    pub config: TrainConfig,
}

/// The scene of `trainer` without dead components and unused ranks.
///
/// # Errors
///
/// [`TrainError::EmptyScene`].
pub fn compacted(trainer: &Trainer<'_>) -> Result<Scene, TrainError> {
    let mut scene = trainer.scene();
    prune_dead_components(&mut scene, trainer.sampler(), trainer.config().seed)?;
    ranks::drop_ranks(&mut scene);
    Ok(scene)
}

/// Settings to continue the training of `scene` for `steps`, without any schedule.
pub(super) fn tuned(config: &TrainConfig, scene: &Scene, steps: u64) -> TrainConfig {
    let of_scale = |s: &Scale| ScaleConfig {
        whole_scene: false,
        // No tensor is placed.
        pitch: (2.0 * s.cloud.half_edge).to_array(),
        edge: (2.0 * s.cloud.half_edge).to_array(),
        resolutions: vec![s.cloud.resolution],
        factors: s.factors.kind(),
        density_rank: s.factors.density_rank(),
        appearance_rank: s.factors.appearance_rank(),
        top_k: s.top_k,
    };
    TrainConfig {
        steps,
        upsample_at: Vec::new(),
        occupancy_at: Vec::new(),
        lean: LeanConfig::off(),
        finish: FinishConfig::off(),
        factor_learning_rate: LEARNING_RATE_SHARE * config.factor_learning_rate,
        network_learning_rate: LEARNING_RATE_SHARE * config.network_learning_rate,
        sky_learning_rate: LEARNING_RATE_SHARE * config.sky_learning_rate,
        scales: scene.scales.iter().map(of_scale).collect(),
        ..config.clone()
    }
}
