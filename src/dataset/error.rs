//! What can be wrong with a dataset, in one line each: the file, the place in it, what was expected, what was found.

use std::io;
use std::ops::Range;
use std::path::{Path, PathBuf};

/// Who has to act on an [`Error`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ErrorKind {
    /// The system: a file is absent, unreadable or cannot be written.
    Io,
    /// The dataset's author: a file holds something else than it should.
    Malformed,
    /// The caller: an argument makes no sense for this dataset.
    Argument,
    /// Nobody but this project: a file is larger than what is read.
    Limit,
}

/// Why a dataset could not be read or made.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A file or folder could not be read.
    #[error("cannot read {}: {source}", path.display())]
    Read {
        /// The file or folder.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// A file or folder could not be written.
    #[error("cannot write {}: {source}", path.display())]
    Write {
        /// The file or folder.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// A picture that a frame names is not there.
    #[error("{}: frame {frame}: there is no such file as the picture {}", path.display(), picture.display())]
    MissingPicture {
        /// The JSON file, or the scan's folder of poses.
        path: PathBuf,
        /// Index in `frames`, or the pose's number.
        frame: usize,
        /// Where the picture should be.
        picture: PathBuf,
    },
    /// A JSON file that is no JSON or not of this layout; the source names line and column.
    #[error("{}: not the JSON of a dataset: {source}", path.display())]
    Json {
        /// The JSON file.
        path: PathBuf,
        /// What and where.
        source: serde_json::Error,
    },
    /// A dataset, or a split of one, without frames.
    #[error("{}: there are no frames: at least one is needed", path.display())]
    NoFrames {
        /// The JSON file, or the scan's folder of poses.
        path: PathBuf,
    },
    /// A folder of no known layout.
    #[error(
        "{}: not a known dataset: expected transforms_*.json (Blender's layout) or the folders pose and color (ScanNet's), \
         found {found}",
        path.display()
    )]
    Layout {
        /// The folder.
        path: PathBuf,
        /// What the folder resembles.
        found: &'static str,
    },
    /// A file, not a folder.
    #[error("{} is a file: give the folder of the dataset, which holds transforms_train.json", path.display())]
    NotAFolder {
        /// The file.
        path: PathBuf,
    },
    /// A split without its JSON file.
    #[error("{} does not exist: the splits of this dataset are {}", path.display(), splits.join(", "))]
    MissingSplit {
        /// The JSON file of the split.
        path: PathBuf,
        /// The splits that exist.
        splits: Vec<String>,
    },
    /// A key that changes what pictures mean in a way that is not supported.
    #[error("{}: {place} is not supported: {reason}", path.display())]
    Unsupported {
        /// The JSON file.
        path: PathBuf,
        /// The frame, if any, the key and its value.
        place: String,
        /// What is supported.
        reason: &'static str,
    },
    /// A split that the layout does not have.
    #[error("{}: split: expected train or test, found {found:?}", path.display())]
    Split {
        /// The dataset.
        path: PathBuf,
        /// What was asked for.
        found: String,
    },
    /// A text file that holds something else than it should.
    #[error("{}: {place}: expected {expected}, found {found}", path.display())]
    Text {
        /// The file, or the folder of them.
        path: PathBuf,
        /// The key, or what the whole file is.
        place: String,
        /// What should be there.
        expected: String,
        /// What is there.
        found: String,
    },
    /// A `file_path` that names no file.
    #[error("{}: frame {frame}: file_path: expected a file's path, found {found:?}", path.display())]
    FilePath {
        /// The JSON file.
        path: PathBuf,
        /// Index in `frames`.
        frame: usize,
        /// The value.
        found: String,
    },
    /// A `transform_matrix` that is not a rotation and a translation.
    #[error("{}: frame {frame}: transform_matrix: expected {expected}, found {found}", path.display())]
    Pose {
        /// The JSON file.
        path: PathBuf,
        /// Index in `frames`.
        frame: usize,
        /// The property it lacks.
        expected: &'static str,
        /// By how much, or the values.
        found: String,
    },
    /// A missing or senseless camera constant.
    #[error("{}: {key}: expected {expected}, found {found}", path.display())]
    Intrinsics {
        /// The JSON file.
        path: PathBuf,
        /// The JSON key.
        key: &'static str,
        /// The values that make sense.
        expected: &'static str,
        /// The value, or that there is none.
        found: String,
    },
    /// Neither the JSON file, nor its pictures, nor the caller says how large the pictures are.
    #[error("{}: picture size: expected the keys w and h, a picture beside it or a given size, found none", path.display())]
    UnknownSize {
        /// The JSON file.
        path: PathBuf,
    },
    /// A picture that cannot be decoded.
    #[error("{}: expected a PNG or JPEG picture, found: {found}", path.display())]
    Picture {
        /// The picture.
        path: PathBuf,
        /// What the decoder said.
        found: String,
    },
    /// A picture of another size than the dataset's.
    #[error(
        "{}: picture size: expected {}x{} as {}, found {}x{}",
        path.display(), expected[0], expected[1], like.display(), found[0], found[1]
    )]
    PictureSize {
        /// The picture.
        path: PathBuf,
        /// Columns and rows.
        expected: [u32; 2],
        /// The file that says so: the first picture or the JSON file.
        like: PathBuf,
        /// Columns and rows.
        found: [u32; 2],
    },
    /// More than is read into memory.
    #[error("{}: {what}: expected at most {limit}, found {found}", path.display())]
    TooLarge {
        /// The file.
        path: PathBuf,
        /// The quantity.
        what: &'static str,
        /// What is read.
        limit: u64,
        /// What there is.
        found: u64,
    },
    /// A downscale factor of 0 or one that leaves no pixel.
    #[error(
        "{}: downscale: expected 1 to {}, found {factor}", path.display(), size[0].min(size[1])
    )]
    Downscale {
        /// The JSON file, or the scan's folder.
        path: PathBuf,
        /// The factor.
        factor: u32,
        /// Columns and rows of the pictures.
        size: [u32; 2],
    },
    /// A folder to write into that has something in it.
    #[error("{}: expected an empty or new folder, found files in it", path.display())]
    FolderNotEmpty {
        /// The folder.
        path: PathBuf,
    },
    /// Too few, too many, too large.
    #[error("{what}: expected 1 to {limit}, found {found}")]
    SynthOption {
        /// Which option.
        what: &'static str,
        /// The largest value.
        limit: u32,
        /// The value.
        found: u32,
    },
    /// A selection of views that selects none, or some that are not there.
    #[error(
        "{}: views: expected a range within 0..{count} and a stride of at least 1, found {}..{} by {every}",
        path.display(), range.start, range.end
    )]
    Views {
        /// The JSON file, or the scan's folder.
        path: PathBuf,
        /// Views of the split.
        count: usize,
        /// The range that was asked for.
        range: Range<usize>,
        /// The stride that was asked for.
        every: usize,
    },
}

impl Error {
    /// Who has to act.
    pub fn kind(&self) -> ErrorKind {
        match self {
            Self::Read { .. } | Self::Write { .. } | Self::MissingPicture { .. } | Self::MissingSplit { .. } => {
                ErrorKind::Io
            }
            Self::Json { .. }
            | Self::NoFrames { .. }
            | Self::FilePath { .. }
            | Self::Pose { .. }
            | Self::Intrinsics { .. }
            | Self::UnknownSize { .. }
            | Self::Picture { .. }
            | Self::PictureSize { .. }
            | Self::Layout { .. }
            | Self::Unsupported { .. }
            | Self::Text { .. } => ErrorKind::Malformed,
            Self::Downscale { .. }
            | Self::FolderNotEmpty { .. }
            | Self::SynthOption { .. }
            | Self::NotAFolder { .. }
            | Self::Split { .. }
            | Self::Views { .. } => ErrorKind::Argument,
            Self::TooLarge { .. } => ErrorKind::Limit,
        }
    }

    /// Whether the system failed, not the data.
    pub fn is_io(&self) -> bool {
        self.kind() == ErrorKind::Io
    }

    /// [`Error::Text`].
    pub(super) fn text(
        path: &Path,
        place: impl Into<String>,
        expected: impl Into<String>,
        found: impl Into<String>,
    ) -> Self {
        Self::Text { path: path.to_path_buf(), place: place.into(), expected: expected.into(), found: found.into() }
    }

    /// For `map_err` after reading `path`.
    pub(super) fn read(path: &Path) -> impl FnOnce(io::Error) -> Self {
        let path = path.to_path_buf();
        move |source| Self::Read { path, source }
    }

    /// For `map_err` after writing `path`.
    pub(super) fn write(path: &Path) -> impl FnOnce(io::Error) -> Self {
        let path = path.to_path_buf();
        move |source| Self::Write { path, source }
    }
}
