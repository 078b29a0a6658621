//! Shrinking: a training of the scene that gives up components and cells (`train/lean.rs`).
//!
//! In: a trained scene and its photographs. Out: the same scene with fewer parameters, counted without components of
//! zeros ([`Scene::nonzero_parameter_count`]). An interrupted shrinking resumes from the trainer's checkpoint.

mod ranks;

use super::{
    FinishConfig, LeanConfig, OptimizerConfig, ScaleConfig, ScheduleConfig, TrainConfig, TrainError, Trainer,
    march_step,
};
use strivec_capture::dataset::Photograph;
use strivec_format::model::{Scale, Scene};

/// Learning rates start at this share of the run's: about where those of a preset end.
const LEARNING_RATE_SHARE: f64 = 0.25;

/// Frames of a shrunk scene are to be faster as well: the march's steps get longer by this factor, up to this share of a cell of
/// the first scale, and samples are left out below so many times the weight and transmittance of the end of a training, up to
/// this. A trained scene loses 0.03 dB at once by both (docs/experiments/2026-11-27-equal-quality.md).
const LONGER_STEP: f64 = 1.1;
const LONGEST_STEP_CELLS: f64 = 0.75;
const LEFT_OUT: f64 = 2.0;
const MOST_LEFT_OUT: f64 = 0.05;

/// Training of a scene that is shrunk.
#[derive(Clone, Debug)]
pub struct Tuning {
    /// Steps.
    pub steps: u64,
    /// Settings of the run that made the scene. Its schedule and scales are not used.
    pub config: TrainConfig,
}

/// The size that a scene is shrunk to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ShrinkGoal {
    /// At most this many parameters.
    Parameters(u64),
    /// As few parameters as lose about this PSNR on rays of the photographs, in dB.
    Loss(f64),
}

impl ShrinkGoal {
    /// True if `scene` need not shrink.
    pub fn is_met_by(&self, scene: &Scene) -> bool {
        matches!(*self, Self::Parameters(most) if scene.nonzero_parameter_count() <= most)
    }

    /// The components that training gives up.
    fn lean(&self) -> LeanConfig {
        match *self {
            Self::Parameters(most) => LeanConfig { max_parameters: Some(most), ..LeanConfig::off() },
            Self::Loss(most) => LeanConfig { max_loss: f64::MAX, max_drop: Some(most), ..LeanConfig::default() },
        }
    }
}

/// A trainer that shrinks `scene`, which was trained on `views`, to `goal`, at its first step of `tuning.steps`. Unless the
/// settings switch the march of the end off, it has a faster one than that from the start, and once more when all parameters are
/// given up. Its checkpoints resume it; [`compacted`] is the result of its last step. It always gives the same result, on
/// any number of threads.
///
/// # Errors
///
/// If no ray passes through the scene.
pub fn shrink<'v>(
    mut scene: Scene,
    views: &'v [Photograph],
    goal: ShrinkGoal,
    tuning: &Tuning,
) -> Result<Trainer<'v>, TrainError> {
    let steps = tuning.steps;
    let mut config = TrainConfig { lean: goal.lean(), ..tuned(&tuning.config, &scene, steps) };
    if tuning.config.finish.from < 1.0 {
        let given_up = (config.lean.during[1] * steps as f64).ceil() as u64;
        config.schedule.occupancy_at = vec![1, given_up.max(2)];
        let raised = |value: f64, factor: f64, most: f64| value.max(most.min(factor * value));
        let longest = march_step(&scene.scales[0].cloud, LONGEST_STEP_CELLS);
        scene.rules.step = raised(scene.rules.step, LONGER_STEP, longest);
        let finish = &tuning.config.finish;
        config.finish = FinishConfig {
            from: 0.0,
            min_transmittance: raised(finish.min_transmittance, LEFT_OUT, MOST_LEFT_OUT),
            min_weight: raised(finish.min_weight, LEFT_OUT, MOST_LEFT_OUT),
            ..finish.clone()
        };
    }
    Trainer::new(config, scene, views)
}

/// The scene of `trainer` without dead components and unused ranks.
///
/// # Errors
///
/// [`TrainError::EmptyScene`].
pub fn compacted(trainer: &Trainer<'_>) -> Result<Scene, TrainError> {
    let mut scene = trainer.scene();
    trainer.prune_dead_components(&mut scene)?;
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
        schedule: ScheduleConfig {
            steps,
            upsample_at: Vec::new(),
            occupancy_at: Vec::new(),
            ..config.schedule.clone()
        },
        lean: LeanConfig::off(),
        finish: FinishConfig::off(),
        optimizer: OptimizerConfig {
            factor_learning_rate: LEARNING_RATE_SHARE * config.optimizer.factor_learning_rate,
            network_learning_rate: LEARNING_RATE_SHARE * config.optimizer.network_learning_rate,
            sky_learning_rate: LEARNING_RATE_SHARE * config.optimizer.sky_learning_rate,
            ..config.optimizer.clone()
        },
        scales: scene.scales.iter().map(of_scale).collect(),
        ..config.clone()
    }
}
