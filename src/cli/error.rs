//! How a command can fail, by who has to act.

use std::fmt::Display;
use std::io;
use std::path::Path;

use crate::{container, dataset, import, measure, prior, train};

/// The exit code of [`Error::Usage`].
pub(super) const USAGE: u8 = 1;

/// Why a command ended early: one line that names the file, the place in it, what was expected and what was found.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The caller: an argument that makes no sense, a file that would be overwritten. Exit code 1.
    #[error("{0}")]
    Usage(String),
    /// The system: a file cannot be read or written. Exit code 2.
    #[error("{0}")]
    Io(String),
    /// The input's author: a file holds something else than it should. Exit code 3.
    #[error("{0}")]
    Malformed(String),
    /// Anything else. Exit code 4.
    #[error("{0}")]
    Runtime(String),
    /// A file of another version, or that needs what this build lacks. Exit code 5.
    #[error("{0}")]
    Unsupported(String),
    /// Two things that were compared are not the same. Exit code 7.
    #[error("{0}")]
    Differs(String),
}

impl Error {
    /// What the process returns.
    pub fn exit_code(&self) -> u8 {
        match self {
            Self::Usage(_) => USAGE,
            Self::Io(_) => 2,
            Self::Malformed(_) => 3,
            Self::Runtime(_) => 4,
            Self::Unsupported(_) => 5,
            Self::Differs(_) => 7,
        }
    }

    /// For `map_err` after an attempt to `verb` (as in "write") `path`.
    pub(super) fn io(verb: &str, path: &Path) -> impl FnOnce(io::Error) -> Self {
        move |source| Self::Io(format!("{}: cannot {verb} it: {source}", path.display()))
    }

    /// Why the scene file `path` was not read, or could not be written.
    pub(super) fn container(path: &Path, error: container::Error) -> Self {
        let message = format!("{}: {error}", path.display());
        match error {
            container::Error::Unsupported { .. }
            | container::Error::UnknownCritical { .. }
            | container::Error::UnsupportedVersion { .. } => Self::Unsupported(message),
            container::Error::Source { .. } => Self::Io(message),
            container::Error::Overflow { .. } | container::Error::Compression { .. } => Self::Runtime(message),
            container::Error::Level { .. } => Self::Usage(message),
            _ => Self::Malformed(message),
        }
    }

    /// For `map_err` where what `path` holds was refused.
    pub(super) fn malformed<E: Display>(path: &Path) -> impl FnOnce(E) -> Self {
        move |error| Self::Malformed(format!("{}: {error}", path.display()))
    }
}

impl From<dataset::Error> for Error {
    fn from(error: dataset::Error) -> Self {
        let message = error.to_string();
        match error.kind() {
            dataset::ErrorKind::Io => Self::Io(message),
            dataset::ErrorKind::Malformed | dataset::ErrorKind::Limit => Self::Malformed(message),
            dataset::ErrorKind::Argument => Self::Usage(message),
        }
    }
}

impl From<measure::Error> for Error {
    /// Commands measure only pictures that they made to fit, so this is nobody's input.
    fn from(error: measure::Error) -> Self {
        Self::Runtime(error.to_string())
    }
}

impl From<prior::BuildError> for Error {
    fn from(error: prior::BuildError) -> Self {
        let message = error.to_string();
        match error {
            prior::BuildError::Import(import::ImportError { fault, .. }) => match fault {
                import::Fault::Io(_) => Self::Io(message),
                _ => Self::Malformed(message),
            },
            prior::BuildError::Nothing { .. } => Self::Malformed(message),
            prior::BuildError::Option { .. }
            | prior::BuildError::TooManyCells { .. }
            | prior::BuildError::TooManyPoints { .. } => Self::Usage(message),
            prior::BuildError::Stopped => Self::Runtime(message),
        }
    }
}

impl From<train::PrepareError> for Error {
    fn from(error: train::PrepareError) -> Self {
        let message = error.to_string();
        match error {
            train::PrepareError::Prior(prior::Error::Option { .. }) | train::PrepareError::Config(_) => {
                Self::Usage(message)
            }
            train::PrepareError::Prior(prior::Error::Cancelled { .. }) | train::PrepareError::Scene(_) => {
                Self::Runtime(message)
            }
            train::PrepareError::Prior(_) => Self::Malformed(message),
            train::PrepareError::Train(error) => error.into(),
        }
    }
}

impl From<train::TrainError> for Error {
    fn from(error: train::TrainError) -> Self {
        let message = error.to_string();
        match error {
            train::TrainError::NoRays(_) | train::TrainError::Checkpoint(_) => Self::Malformed(message),
            train::TrainError::Diverged { .. } => Self::Runtime(message),
        }
    }
}
