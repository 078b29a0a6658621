//! Errors of commands, by who has to act, and the flags of the library's fields.

use std::fmt::Display;
use std::io;
use std::path::Path;

use crate::{container, dataset, import, measure, prior, train};

/// The exit code of [`Error::Usage`].
pub(super) const USAGE: u8 = 1;

/// Why a command ended early: one sentence that names the file and the place in it.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// Usage: an invalid argument, a file that would be overwritten. Exit code 1.
    #[error("{0}")]
    Usage(String),
    /// Input or output: a file cannot be read or written. Exit code 2.
    #[error("{0}")]
    Io(String),
    /// Malformed input: a file does not have the content that it should. Exit code 3.
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
    /// The exit code of the process.
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

    /// For `map_err` if the content of `path` was refused.
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
    /// Commands measure only pictures of matching sizes, so no input causes this.
    fn from(error: measure::Error) -> Self {
        Self::Runtime(error.to_string())
    }
}

impl From<prior::BuildError> for Error {
    fn from(error: prior::BuildError) -> Self {
        let message = with_flags(&error.to_string());
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
        let message = with_flags(&error.to_string());
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
            train::TrainError::NoRays { .. }
            | train::TrainError::TooManyPixels { .. }
            | train::TrainError::Checkpoint(_) => Self::Malformed(message),
            train::TrainError::Diverged { .. } | train::TrainError::EmptyScene { .. } => Self::Runtime(message),
        }
    }
}

/// Fields of the library's options and the flags that set them, if the flag is not the field's name with hyphens.
const FLAGS: [(&str, &str); 12] = [
    ("neighbors", "--top-k"),
    ("max_reprojection_error", "--max-error"),
    ("parameters", "--max-params"),
    ("file_bytes", "--max-size"),
    ("batch_rays", "--batch"),
    ("test_views", "--test-views"),
    ("near_far", "--near and --far"),
    ("frames per second", "--min-fps"),
    ("PSNR", "--min-psnr"),
    ("quality", "--quality"),
    ("memory", "--memory"),
    ("prior", "--prior"),
];

/// The flag that sets `field` of the library's options.
pub(super) fn flag_of(field: &str) -> String {
    let known = FLAGS.iter().find(|(name, _)| *name == field);
    known.map_or_else(|| format!("--{}", field.replace('_', "-")), |(_, flag)| (*flag).to_owned())
}

/// `message` of the library with its fields, written as `` `field` ``, replaced by flags. Words in backticks that are not
/// plain identifiers stay as they are.
pub(super) fn with_flags(message: &str) -> String {
    let is_field = |word: &str| !word.is_empty() && word.chars().all(|c| c.is_ascii_lowercase() || c == '_');
    let mut parts: Vec<String> = message.split('`').map(str::to_owned).collect();
    if parts.len() % 2 == 0 {
        return message.to_owned();
    }
    for part in parts.iter_mut().skip(1).step_by(2) {
        *part = if is_field(part) { flag_of(part) } else { format!("`{part}`") };
    }
    parts.concat()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fields_become_flags() {
        assert_eq!(with_flags("too many cells; set `voxel` or `crop`"), "too many cells; set --voxel or --crop");
        assert_eq!(with_flags("`step_scale`: 0.25 to 64"), "--step-scale: 0.25 to 64");
        assert_eq!(with_flags("`neighbors` of 5"), "--top-k of 5");
        assert_eq!(with_flags("run `strivec prior`; a ` alone"), "run `strivec prior`; a ` alone");
        assert_eq!(with_flags("run `strivec prior`"), "run `strivec prior`");
    }
}
