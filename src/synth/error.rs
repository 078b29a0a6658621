//! Errors of making captures.

use std::io;
use std::path::{Path, PathBuf};

use strivec_format::Invalid;

/// Reasons why a synthetic capture is not made.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A folder could not be read.
    #[error("cannot read {}: {source}", path.display())]
    Read {
        /// The folder.
        path: PathBuf,
        /// The system's error.
        source: io::Error,
    },
    /// A file or folder could not be written.
    #[error("cannot write {}: {source}", path.display())]
    Write {
        /// The file or folder.
        path: PathBuf,
        /// The system's error.
        source: io::Error,
    },
    /// An output folder that is not empty.
    #[error("{}: the output folder must be new or empty; found files in it", path.display())]
    FolderNotEmpty {
        /// The folder.
        path: PathBuf,
    },
    /// An option that is out of range, or that the layout does not support.
    #[error(transparent)]
    Option(#[from] Invalid),
}

impl Error {
    /// True if the system failed; false if the caller's options are invalid.
    pub fn is_io(&self) -> bool {
        matches!(self, Self::Read { .. } | Self::Write { .. })
    }

    /// Converts an error of reading `path`, for `map_err`.
    pub(crate) fn read(path: &Path) -> impl FnOnce(io::Error) -> Self {
        let path = path.to_path_buf();
        move |source| Self::Read { path, source }
    }

    /// Converts an error of writing `path`, for `map_err`.
    pub(crate) fn write(path: &Path) -> impl FnOnce(io::Error) -> Self {
        let path = path.to_path_buf();
        move |source| Self::Write { path, source }
    }
}
