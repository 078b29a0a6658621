//! Errors of making captures.

use std::io;
use std::path::{Path, PathBuf};

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
    /// An option that is out of range.
    #[error("`{what}` must be 1 to {limit}; found {found}")]
    Option {
        /// The field of [`SynthOptions`](crate::SynthOptions), or `width` or `height` of `size`.
        what: &'static str,
        /// The largest value.
        limit: u32,
        /// The value found.
        found: u32,
    },
    /// A camera model that the layout cannot state.
    #[error("`camera` must be {expected} in the layout {layout}; found {found}")]
    Camera {
        /// The layout's name.
        layout: &'static str,
        /// The names of the camera models that it can state.
        expected: String,
        /// The name of the camera model.
        found: &'static str,
    },
    /// A meadow for the layout of rooms.
    #[error("`surroundings` must be a room or none in the layout scannet; found a meadow")]
    Meadow,
    /// A number of test views that the layout does not hold out.
    #[error(
        "`test_views` must be {expected} for {views} training views, as the layout {layout} holds out every eighth \
         picture; found {found}"
    )]
    TestViews {
        /// The layout's name.
        layout: &'static str,
        /// The number of training views.
        views: u32,
        /// The number of test views that fits.
        expected: u32,
        /// The number of test views found.
        found: u32,
    },
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
