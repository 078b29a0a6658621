//! Errors of reading datasets. Each message is one line: the file, the place in it, the valid values and the
//! value found.

use std::fmt::Display;
use std::io;
use std::ops::Range;
use std::path::{Path, PathBuf};

use super::picture_format::READ_FORMATS;
use strivec_format::digits::plural;
use strivec_format::{Invalid, OptionName, Place};
use strivec_import::{Fault, ImportError};

/// The party that must act on an [`Error`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ErrorKind {
    /// The system: a file is absent, unreadable or cannot be written.
    Io,
    /// The dataset's author: a file has invalid contents.
    Malformed,
    /// The caller: an argument is invalid for this dataset.
    Argument,
    /// This project: a file exceeds a limit of the reader.
    Limit,
}

/// Reasons why a dataset cannot be read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A file or folder could not be read.
    #[error("cannot read {}: {source}", path.display())]
    Read {
        /// The file or folder.
        path: PathBuf,
        /// The system's error.
        source: io::Error,
    },
    /// Photographs whose pictures do not exist.
    #[error(
        "{}: {count} of {of} pictures do not exist, the first is {}, {instead}; {} leaves them out",
        path.display(), picture.display(), OptionName("skip_missing")
    )]
    MissingPictures {
        /// The file or folder that lists the photographs.
        path: PathBuf,
        /// The first picture's path.
        picture: PathBuf,
        /// The pictures that exist in place of the first, as the end of a sentence.
        instead: String,
        /// Number of pictures that do not exist.
        count: usize,
        /// Number of photographs.
        of: usize,
    },
    /// Too many records that are not valid, each of which could be left out alone.
    #[error("{first}; {count} of {total} are such, of which at most {limit} {} left out", if *limit == 1 { "is" } else { "are" })]
    BadRecords {
        /// The error of the first.
        first: Box<Error>,
        /// Number of invalid records.
        count: usize,
        /// Number of records.
        total: usize,
        /// The most that are left out.
        limit: usize,
    },
    /// A split without photographs in a dataset that has some.
    #[error(
        "{}: the split {split} has no photograph: {} with a pose, all in other splits{}",
        path.display(), plural(*others, "photograph"), if *is_held_out { held_out() } else { String::new() }
    )]
    EmptySplit {
        /// The file or folder that lists the photographs.
        path: PathBuf,
        /// The split.
        split: String,
        /// Number of photographs with a pose.
        others: usize,
        /// True if the test views are chosen by their number, not by the dataset.
        is_held_out: bool,
    },
    /// A file that is not JSON, or JSON of another layout. The source names line and column.
    #[error("{}: not the JSON of a dataset: {source}", path.display())]
    Json {
        /// The JSON file.
        path: PathBuf,
        /// The cause, with line and column.
        source: serde_json::Error,
    },
    /// A dataset, or a split of one, without frames.
    #[error("{}: a dataset must have at least one frame with a pose; found {}", path.display(), frames_without_pose(*lost))]
    NoFrames {
        /// The file or folder that lists the photographs.
        path: PathBuf,
        /// Frames without a pose.
        lost: usize,
    },
    /// A folder without the files of a layout.
    #[error("{}: the folder is not a dataset: it has {found}; the layouts are {wanted}", path.display())]
    Layout {
        /// The folder.
        path: PathBuf,
        /// A layout's files that lack others, or pictures without poses.
        found: String,
        /// The layouts with the files that each needs.
        wanted: String,
    },
    /// A file instead of a folder.
    #[error("{} is a file; pass the folder of the dataset", path.display())]
    NotAFolder {
        /// The file.
        path: PathBuf,
    },
    /// A split without its JSON file.
    #[error("{} does not exist; the splits of this dataset are {}", path.display(), splits.join(", "))]
    MissingSplit {
        /// The JSON file of the split.
        path: PathBuf,
        /// The splits that exist.
        splits: Vec<String>,
    },
    /// A split that the layout does not have.
    #[error("{}: the split must be train, test or all; found {found:?}", path.display())]
    Split {
        /// The dataset.
        path: PathBuf,
        /// The requested split.
        found: String,
    },
    /// A text file with invalid contents.
    #[error("{}: {invalid}", path.display())]
    Text {
        /// The file, or the folder of them.
        path: PathBuf,
        /// The key with its value, or the contents of the whole file.
        invalid: Invalid,
    },
    /// The size of the pictures is in neither the JSON file nor a picture nor the caller's arguments.
    #[error("{}: the picture size is unknown; add the keys w and h, add a picture, or set {}", path.display(), OptionName("size"))]
    UnknownSize {
        /// The file or folder that lists the photographs.
        path: PathBuf,
    },
    /// A picture that cannot be decoded.
    #[error("{}: the file must be a {} picture: {found}", path.display(), READ_FORMATS)]
    Picture {
        /// The picture.
        path: PathBuf,
        /// The decoder's error, or the contents found.
        found: String,
    },
    /// A file that is no picture of a format that is read.
    #[error("{}: the file must be a {} picture; found {found}", path.display(), READ_FORMATS)]
    PictureFormat {
        /// The file.
        path: PathBuf,
        /// The format found and what to do, or the first bytes.
        found: String,
    },
    /// A picture whose size differs from the dataset's.
    #[error(
        "{}: the picture size must be {}x{} as in {}; found {}x{}",
        path.display(), expected[0], expected[1], like.display(), found[0], found[1]
    )]
    PictureSize {
        /// The picture.
        path: PathBuf,
        /// Columns and rows.
        expected: [u32; 2],
        /// The file that defines this size: the first picture or the JSON file.
        like: PathBuf,
        /// Columns and rows.
        found: [u32; 2],
    },
    /// A quantity beyond a limit of the reader.
    #[error("{}: at most {limit} {what} are supported; found {found}", path.display())]
    TooLarge {
        /// The file.
        path: PathBuf,
        /// The limited quantity, a plural.
        what: &'static str,
        /// The limit.
        limit: u64,
        /// The quantity found.
        found: u64,
    },
    /// Photographs that take more memory than they may.
    #[error(
        "{}: the photographs take {:.1} GB of memory, more than the {:.1} GB of {}; set {}, or load fewer with {}",
        path.display(), *found as f64 / 1e9, *limit as f64 / 1e9, OptionName("max_memory"), OptionName("downscale"),
        OptionName("every")
    )]
    Memory {
        /// The file or folder that lists the photographs.
        path: PathBuf,
        /// The most bytes.
        limit: u64,
        /// The bytes of the photographs.
        found: u64,
    },
    /// A picture whose decoding takes more memory than is left.
    #[error(
        "{}: decoding the picture takes {:.3} GB of memory, more than the {:.3} GB that {} leaves beside the photographs; \
         set {}, or make the picture smaller",
        path.display(), *found as f64 / 1e9, *limit as f64 / 1e9, OptionName("max_memory"), OptionName("max_memory")
    )]
    DecodingMemory {
        /// The picture.
        path: PathBuf,
        /// The most bytes.
        limit: u64,
        /// The bytes that decoding takes.
        found: u64,
    },
    /// A downscale factor of 0 or one that leaves no pixel.
    #[error("{}: {invalid}", path.display())]
    Downscale {
        /// The JSON file, or the scan's folder.
        path: PathBuf,
        /// The factor.
        invalid: Invalid,
    },
    /// A selection of views that is empty or out of range.
    #[error(
        "{}: views must be a range within 0..{count} with a stride of at least 1; found {}..{} by {every}",
        path.display(), range.start, range.end
    )]
    Views {
        /// The JSON file, or the scan's folder.
        path: PathBuf,
        /// Views of the split.
        count: usize,
        /// The requested range.
        range: Range<usize>,
        /// The requested stride.
        every: usize,
    },
}

impl Error {
    /// The party that must act.
    pub fn kind(&self) -> ErrorKind {
        match self {
            Self::Read { .. } | Self::MissingPictures { .. } | Self::MissingSplit { .. } => ErrorKind::Io,
            Self::Json { .. }
            | Self::NoFrames { .. }
            | Self::UnknownSize { .. }
            | Self::Picture { .. }
            | Self::PictureFormat { .. }
            | Self::PictureSize { .. }
            | Self::Layout { .. }
            | Self::EmptySplit { .. }
            | Self::BadRecords { .. }
            | Self::Text { .. } => ErrorKind::Malformed,
            Self::Downscale { .. } | Self::NotAFolder { .. } | Self::Split { .. } | Self::Views { .. } => {
                ErrorKind::Argument
            }
            Self::TooLarge { .. } | Self::Memory { .. } | Self::DecodingMemory { .. } => ErrorKind::Limit,
        }
    }

    /// The file or folder in which the error is.
    pub fn path(&self) -> &Path {
        match self {
            Self::BadRecords { first, .. } => first.path(),
            Self::Read { path, .. }
            | Self::MissingPictures { path, .. }
            | Self::EmptySplit { path, .. }
            | Self::Json { path, .. }
            | Self::NoFrames { path, .. }
            | Self::Layout { path, .. }
            | Self::NotAFolder { path }
            | Self::MissingSplit { path, .. }
            | Self::Split { path, .. }
            | Self::Text { path, .. }
            | Self::UnknownSize { path }
            | Self::Picture { path, .. }
            | Self::PictureFormat { path, .. }
            | Self::PictureSize { path, .. }
            | Self::TooLarge { path, .. }
            | Self::Memory { path, .. }
            | Self::DecodingMemory { path, .. }
            | Self::Downscale { path, .. }
            | Self::Views { path, .. } => path,
        }
    }

    /// The error as one of reading the geometry at `path`.
    pub fn of_geometry(self, path: &Path) -> ImportError {
        match self {
            Self::Read { path, source } => Fault::Io(source).of(&path),
            Self::Text { path, invalid } => Fault::from(invalid).of(&path),
            Self::TooLarge { path, what, limit, found } => Fault::Limit { what: what.into(), limit, found }.of(&path),
            other => Fault::broken("the dataset", other.to_string()).of(path),
        }
    }

    /// True if the system failed, not the data.
    pub fn is_io(&self) -> bool {
        self.kind() == ErrorKind::Io
    }

    /// Makes an [`Error::Text`].
    pub(super) fn text(path: &Path, place: impl Into<Place>, expected: impl Display, found: impl Display) -> Self {
        Self::Text { path: path.to_path_buf(), invalid: Invalid::new(place, expected, found) }
    }

    /// Converts an error of reading `path`, for `map_err`.
    pub(super) fn read(path: &Path) -> impl FnOnce(io::Error) -> Self {
        let path = path.to_path_buf();
        move |source| Self::Read { path, source }
    }
}

/// How to train on the photographs that are test views by their number.
fn held_out() -> String {
    format!("; {} 0 holds none out", OptionName("test_every"))
}

/// `lost` frames in words.
fn frames_without_pose(lost: usize) -> String {
    match lost {
        0 => "no frames".into(),
        1 => "1 frame without a pose".into(),
        lost => format!("{lost} frames without a pose"),
    }
}
