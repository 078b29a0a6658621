//! Errors of training.

use strivec_format::Invalid;
use strivec_format::model::OverMemory;

use super::{ConfigError, Divergence};

/// A run that cannot begin or continue.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum TrainError {
    /// No pixel's ray passes through the model.
    #[error(
        "none of the {pixels} rays of the photographs passes through the model; check that the prior and the \
         photographs are of the same scene"
    )]
    NoRays {
        /// Pixels of all photographs, in whole bytes of the mask.
        pixels: u64,
    },
    /// The photographs have more pixels than can be numbered.
    #[error(
        "the photographs have {pixels} pixels, and training supports less than 2^32; use fewer or smaller photographs"
    )]
    TooManyPixels {
        /// Pixels of all photographs.
        pixels: u64,
    },
    /// No component of any tensor contributes to any ray.
    #[error(
        "after {steps} steps no tensor contributes to any photograph: the scene is empty; train for more steps, \
         or start from a prior that covers the scene"
    )]
    EmptyScene {
        /// Steps that the scene was trained for.
        steps: u64,
    },
    /// The error or the parameters grow without bound.
    #[error("the run diverged at step {step}: {found}")]
    Diverged {
        /// Steps done.
        step: u64,
        /// The symptom, and the setting to change.
        found: Divergence,
    },
    /// The scene takes more memory than it may.
    #[error(transparent)]
    Memory(#[from] OverMemory),
    /// The checkpoint does not belong to the scene and the photographs.
    #[error(transparent)]
    Checkpoint(#[from] CheckpointError),
}

/// A checkpoint that cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CheckpointError {
    /// A part is missing, damaged, or of another run.
    #[error("the checkpoint's {0}")]
    Malformed(Invalid),
    /// The settings in a checkpoint cannot be read.
    #[error("the checkpoint's settings: {0}")]
    Config(#[from] ConfigError),
}
