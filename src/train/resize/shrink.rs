//! Shrinking: a training of the scene that gives up components and cells (`train/lean.rs`).

use super::{Tuning, tuned};
use crate::dataset::View;
use crate::model::Scene;
use crate::train::{LeanConfig, TrainError, Trainer};

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

/// A trainer that shrinks `scene`, which was trained on `views`, to `goal`, at its first step of `tuning.steps`. Its checkpoints
/// resume it; [`super::compacted`] is the result of its last step. It always gives the same result, on any number of
/// threads.
///
/// # Errors
///
/// If no ray passes through the scene.
pub fn shrink<'v>(
    scene: Scene,
    views: &'v [View],
    goal: ShrinkGoal,
    tuning: &Tuning,
) -> Result<Trainer<'v>, TrainError> {
    let config = tuned(&tuning.config, &scene, tuning.steps);
    Trainer::new(crate::train::TrainConfig { lean: goal.lean(), ..config }, scene, views)
}
