//! Shrinking: a training of the scene that gives up components and cells (`train/lean.rs`).

use super::{Tuning, tuned};
use crate::dataset::View;
use crate::model::Scene;
use crate::train::{FinishConfig, LeanConfig, TrainConfig, TrainError, Trainer, march_step};

/// Frames of a shrunk scene are to be faster as well: the march's steps get longer by this factor, up to this share of a cell of
/// the first scale, and samples are left out below so many times the weight and transmittance of the end of a training, up to
/// this. A trained scene loses 0.03 dB at once by both (docs/experiments/2026-11-27-equal-quality.md).
const LONGER_STEP: f64 = 1.1;
const LONGEST_STEP_CELLS: f64 = 0.75;
const LEFT_OUT: f64 = 2.0;
const MOST_LEFT_OUT: f64 = 0.05;

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
/// given up. Its checkpoints resume it; [`super::compacted`] is the result of its last step. It always gives the same result, on
/// any number of threads.
///
/// # Errors
///
/// If no ray passes through the scene.
pub fn shrink<'v>(
    mut scene: Scene,
    views: &'v [View],
    goal: ShrinkGoal,
    tuning: &Tuning,
) -> Result<Trainer<'v>, TrainError> {
    let steps = tuning.steps;
    let mut config = TrainConfig { lean: goal.lean(), ..tuned(&tuning.config, &scene, steps) };
    if tuning.config.finish.from < 1.0 {
        let given_up = (config.lean.during[1] * steps as f64).ceil() as u64;
        config.occupancy_at = vec![1, given_up.max(2)];
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
