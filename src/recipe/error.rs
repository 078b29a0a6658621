//! Errors of the recipe.

use std::path::PathBuf;

use super::{FileError, ObserverError};
use strivec_capture::survey::SurveyError;
use strivec_capture::{dataset, prior};
use strivec_format::OptionName;
use strivec_format::container;
use strivec_format::digits::grouped;
use strivec_measure as measure;

/// A training that did not end with a scene. Messages name settings in backticks.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The photographs cannot be read.
    #[error(transparent)]
    Dataset(#[from] dataset::Error),
    /// The prior's files cannot be read.
    #[error(transparent)]
    Prior(#[from] prior::BuildError),
    /// The cameras do not tell where the scene is.
    #[error(transparent)]
    Survey(#[from] SurveyError),
    /// There is no scene to begin with.
    #[error(transparent)]
    Prepare(#[from] strivec_train::PrepareError),
    /// The training cannot begin, or failed.
    #[error(transparent)]
    Train(#[from] strivec_train::TrainError),
    /// The scene cannot be encoded.
    #[error(transparent)]
    Encode(#[from] container::Error),
    /// The thumbnail cannot be made.
    #[error(transparent)]
    Thumbnail(#[from] measure::Error),
    /// A file cannot be read or written.
    #[error(transparent)]
    File(#[from] FileError),
    /// The trained scene could be written nowhere.
    #[error("{source}; the checkpoint {} is kept, and {} continues it", checkpoint.display(), OptionName("resume"))]
    KeptCheckpoint {
        /// The checkpoint of the run.
        checkpoint: PathBuf,
        /// Why the scene is not written.
        source: FileError,
    },
    /// The checkpoint is damaged.
    #[error("{}: {source}", path.display())]
    Checkpoint {
        /// The checkpoint.
        path: PathBuf,
        /// The damage.
        source: strivec_train::CheckpointError,
    },
    /// The scene in the checkpoint is damaged.
    #[error("{}: {source}", path.display())]
    CheckpointScene {
        /// The checkpoint.
        path: PathBuf,
        /// The damage.
        source: Box<container::Error>,
    },
    /// No encoding of the scene is small enough to begin training for the size.
    #[error("a file of {} bytes is too small; the smallest has about {} bytes", grouped(*limit), grouped(*smallest))]
    TooSmall {
        /// The most bytes that the file may have.
        limit: u64,
        /// About the bytes of the smallest file.
        smallest: u64,
    },
    /// No encoding of the trained scene is small enough.
    #[error("{} bytes cannot be reached", grouped(*limit))]
    OutOfReach {
        /// The most bytes that the file may have.
        limit: u64,
    },
    /// The observer stopped the training.
    #[error("interrupted{}", after(*step, checkpoint.as_ref()))]
    Interrupted {
        /// Steps done.
        step: u64,
        /// The checkpoint that resumes the run; `None` if the training has none.
        checkpoint: Option<PathBuf>,
    },
    /// The observer failed.
    #[error(transparent)]
    Observer(ObserverError),
}

impl Error {
    /// True if the observer stopped the run: while the prior was made, of which nothing is kept, or between steps.
    pub fn is_interruption(&self) -> bool {
        matches!(
            self,
            Self::Interrupted { .. }
                | Self::Prior(prior::BuildError::Stopped)
                | Self::Prepare(strivec_train::PrepareError::Prior(prior::Error::Cancelled { .. }))
        )
    }
}

impl From<strivec_train::ConfigError> for Error {
    fn from(error: strivec_train::ConfigError) -> Self {
        Self::Prepare(error.into())
    }
}

impl From<prior::Error> for Error {
    fn from(error: prior::Error) -> Self {
        Self::Prepare(error.into())
    }
}

/// The rest of the message of an interruption.
fn after(step: u64, checkpoint: Option<&PathBuf>) -> String {
    checkpoint.map_or_else(String::new, |path| {
        format!(" after step {step}; {} continues from {}", OptionName("resume"), path.display())
    })
}
