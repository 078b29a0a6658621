//! Errors of commands, by who has to act, and the flags of the library's fields.

use std::fmt::Display;
use std::io;
use std::path::Path;

use strivec_capture::survey::SurveyError;
use strivec_capture::{dataset, prior};
use strivec_export as interop;
use strivec_field::render::RendererError;
use strivec_format::model::OverMemory;
use strivec_format::{container, named_by};
use strivec_import as import;
use strivec_measure as measure;
use strivec_recipe as recipe;
use strivec_train as train;

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
    /// More memory is needed than may be taken. Exit code 5.
    #[error("{0}")]
    Memory(String),
    /// Two things that were compared are not the same. Exit code 7.
    #[error("{0}")]
    Differs(String),
    /// An error, and lines of a file or of a program's log that show it.
    #[error("{error}")]
    WithLines {
        /// The error; its message introduces the lines.
        error: Box<Error>,
        /// The lines, without line feeds.
        lines: Vec<String>,
    },
}

impl Error {
    /// The exit code of the process.
    pub fn exit_code(&self) -> u8 {
        match self {
            Self::Usage(_) => USAGE,
            Self::Io(_) => 2,
            Self::Malformed(_) => 3,
            Self::Runtime(_) => 4,
            Self::Unsupported(_) | Self::Memory(_) => 5,
            Self::Differs(_) => 7,
            Self::WithLines { error, .. } => error.exit_code(),
        }
    }

    /// For `map_err` after an attempt to `verb` (as in "write") `path`.
    pub(super) fn io(verb: &str, path: &Path) -> impl FnOnce(io::Error) -> Self {
        move |source| Self::Io(format!("{}: cannot {verb} it: {source}", path.display()))
    }

    /// Why the scene file `path` was not read, or could not be written.
    pub fn container(path: &Path, error: container::Error) -> Self {
        let message = match &error {
            container::Error::NotStrivec { found } => {
                format!("{}: not a .strivec file: it begins like {}", path.display(), format_of(found))
            }
            _ => format!("{}: {error}", path.display()),
        };
        match error {
            container::Error::Budget { .. } => Self::Memory(message),
            error if error.needs_another_reader() => Self::Unsupported(message),
            container::Error::Source { .. } => Self::Io(message),
            container::Error::Overflow { .. } | container::Error::Compression { .. } => Self::Runtime(message),
            container::Error::Level { .. } => Self::Usage(message),
            _ => Self::Malformed(message),
        }
    }

    /// For `map_err` if the scene was not exported to `path`.
    pub(super) fn interop(path: &Path) -> impl FnOnce(interop::Error) -> Self {
        move |error| {
            let message = format!("{}: {}", path.display(), with_flags(&error));
            match error {
                interop::Error::Setting(_) | interop::Error::TooLarge { .. } => Self::Usage(message),
                interop::Error::Memory(error) => error.into(),
                interop::Error::Io(_) => Self::Io(message),
                interop::Error::Checkpoint(error) => Self::checkpoint(path)(error),
                _ => Self::Runtime(message),
            }
        }
    }

    /// For `map_err` if the scene was not written as a checkpoint to `path`.
    pub(super) fn checkpoint(path: &Path) -> impl FnOnce(strivec_checkpoints::Error) -> Self {
        move |error| {
            let message = format!("{}: {error}", path.display());
            match error {
                strivec_checkpoints::Error::Io(_) => Self::Io(message),
                _ => Self::Unsupported(message),
            }
        }
    }

    /// For `map_err` if the scene of the file `path` takes more memory than it may.
    pub(super) fn memory(path: &Path) -> impl FnOnce(OverMemory) -> Self {
        move |error| Self::Memory(format!("{}: {error}", path.display()))
    }

    /// For `map_err` of what prepares the scene of the file `path`: names the file in an error of memory.
    pub(super) fn of_scene(path: &Path) -> impl FnOnce(Self) -> Self {
        move |error| match error {
            Self::Memory(message) => Self::Memory(format!("{}: {message}", path.display())),
            error => error,
        }
    }

    /// For `map_err` if no scene was trained or packed for the file `path`.
    pub(super) fn recipe(path: &Path) -> impl FnOnce(recipe::Error) -> Self {
        move |error| match error {
            recipe::Error::Encode(error) => Self::container(path, error),
            recipe::Error::TooSmall { .. } | recipe::Error::OutOfReach { .. } => {
                Self::Runtime(format!("{}: {error}", path.display()))
            }
            error => error.into(),
        }
    }

    /// For `map_err` if the content of `path` was refused.
    pub(super) fn malformed<E: Display>(path: &Path) -> impl FnOnce(E) -> Self {
        move |error| Self::Malformed(format!("{}: {error}", path.display()))
    }
}

impl From<dataset::Error> for Error {
    fn from(error: dataset::Error) -> Self {
        let message = with_flags(&error);
        match error.kind() {
            dataset::ErrorKind::Io => Self::Io(message),
            dataset::ErrorKind::Malformed | dataset::ErrorKind::Limit => Self::Malformed(message),
            dataset::ErrorKind::Argument => Self::Usage(message),
        }
    }
}

impl From<strivec_synth::Error> for Error {
    fn from(error: strivec_synth::Error) -> Self {
        let message = with_flags(&error);
        if error.is_io() { Self::Io(message) } else { Self::Usage(message) }
    }
}

impl From<measure::Error> for Error {
    /// Commands measure only pictures of matching sizes, so no input causes this.
    fn from(error: measure::Error) -> Self {
        Self::Runtime(error.to_string())
    }
}

impl From<import::ImportError> for Error {
    fn from(error: import::ImportError) -> Self {
        let message = with_flags(&error);
        match error.fault {
            import::Fault::Io(_) => Self::Io(message),
            _ => Self::Malformed(message),
        }
    }
}

impl From<prior::BuildError> for Error {
    fn from(error: prior::BuildError) -> Self {
        let message = with_flags(&error);
        match error {
            prior::BuildError::Import(error) => error.into(),
            prior::BuildError::Nothing(_) | prior::BuildError::OnePlace { .. } => Self::Malformed(message),
            prior::BuildError::Prior(_) | prior::BuildError::TooManyPoints { .. } => Self::Usage(message),
            _ => Self::Runtime(message),
        }
    }
}

impl From<SurveyError> for Error {
    fn from(error: SurveyError) -> Self {
        match error {
            SurveyError::Points(error) => error.into(),
            error => Self::Malformed(error.to_string()),
        }
    }
}

impl From<train::PrepareError> for Error {
    fn from(error: train::PrepareError) -> Self {
        let message = with_flags(&error);
        match error {
            train::PrepareError::Prior(prior::Error::Option(_) | prior::Error::TooWide { .. })
            | train::PrepareError::Config(_) => Self::Usage(message),
            train::PrepareError::Prior(prior::Error::Cancelled { .. }) => Self::Runtime(message),
            train::PrepareError::Prior(_) => Self::Malformed(message),
            train::PrepareError::Train(error) => error.into(),
            _ => Self::Runtime(message),
        }
    }
}

impl From<train::TrainError> for Error {
    fn from(error: train::TrainError) -> Self {
        let message = error.to_string();
        match error {
            train::TrainError::Memory(error) => error.into(),
            train::TrainError::NoRays { .. }
            | train::TrainError::TooManyPixels { .. }
            | train::TrainError::Checkpoint(_) => Self::Malformed(message),
            _ => Self::Runtime(message),
        }
    }
}

impl From<OverMemory> for Error {
    fn from(error: OverMemory) -> Self {
        Self::Memory(error.to_string())
    }
}

impl From<RendererError> for Error {
    fn from(error: RendererError) -> Self {
        match error {
            RendererError::Approximation(error) => error.into(),
            RendererError::Memory(error) => error.into(),
            error => Self::Memory(error.to_string()),
        }
    }
}

impl From<recipe::FileError> for Error {
    fn from(error: recipe::FileError) -> Self {
        let message = with_flags(&error);
        if error.is_io() { Self::Io(message) } else { Self::Usage(message) }
    }
}

impl From<recipe::PosesError> for Error {
    fn from(error: recipe::PosesError) -> Self {
        match error {
            recipe::PosesError::File(error) => error.into(),
            _ => Self::Malformed(error.to_string()),
        }
    }
}

impl From<recipe::Error> for Error {
    fn from(error: recipe::Error) -> Self {
        let message = with_flags(&error);
        match error {
            recipe::Error::Dataset(error) => error.into(),
            recipe::Error::Prior(error) => error.into(),
            recipe::Error::Survey(error) => error.into(),
            recipe::Error::Prepare(error) => error.into(),
            recipe::Error::Train(error) => error.into(),
            recipe::Error::Thumbnail(error) => error.into(),
            recipe::Error::File(error) => error.into(),
            recipe::Error::KeptCheckpoint { .. } => Self::Io(message),
            recipe::Error::Observer(error) => error.downcast().map_or_else(|_| Self::Runtime(message), |error| *error),
            recipe::Error::Checkpoint { .. } | recipe::Error::CheckpointScene { .. } => Self::Malformed(message),
            _ => Self::Runtime(message),
        }
    }
}

/// The known format whose files begin with `bytes`, else the bytes.
fn format_of(bytes: &[u8]) -> String {
    const KNOWN: [(&[u8], &str); 10] = [
        (b"ply", "a PLY file"),
        (b"\x89PNG", "a PNG picture"),
        (b"\xff\xd8\xff", "a JPEG picture"),
        (b"{", "JSON"),
        (b"[", "JSON"),
        (b"PK\x03\x04", "a ZIP archive (NPZ, for example)"),
        (b"\x93NUMPY", "a NumPy array"),
        (b"glTF", "a GLB model"),
        (b"\x1f\x8b", "gzip data (SPZ, for example)"),
        (b"\x28\xb5\x2f\xfd", "zstd data"),
    ];
    let known = KNOWN.iter().find(|(magic, _)| bytes.starts_with(magic));
    match known {
        Some((_, name)) => (*name).to_owned(),
        None if bytes.is_empty() => "an empty file".to_owned(),
        None => format!("\"{}\"", bytes.escape_ascii()),
    }
}

/// The flags of the library's options. Other options, such as most of a configuration's, have no flag.
const FLAGS: [(&str, &str); 38] = [
    ("alpha", "--alpha"),
    ("background", "--set photographs.background"),
    ("bounds", "--bounds"),
    ("budget", "--max-params or --max-size"),
    ("close", "--close"),
    ("crop", "--crop"),
    ("decoder", "--decoder"),
    ("dilate", "--dilate"),
    ("downscale", "--downscale"),
    ("every", "--every"),
    ("files", "--prior"),
    ("force", "--force"),
    ("harmonics", "--harmonics"),
    ("max_memory", "--max-memory"),
    ("max_reprojection_error", "--max-error"),
    ("min_alpha", "--min-alpha"),
    ("min_confidence", "--min-confidence"),
    ("min_points", "--min-points"),
    ("min_track", "--min-track"),
    ("min_transmittance", "--min-transmittance"),
    ("min_weight", "--min-weight"),
    ("near_far", "--set space.near_far"),
    ("outliers", "--outliers"),
    ("resolution", "--resolution"),
    ("resume", "--resume"),
    ("scale", "--scale"),
    ("seed", "--seed"),
    ("skip_missing", "--skip-missing"),
    ("space.near_far", "--set space.near_far"),
    ("space.unbounded", "--set space.unbounded"),
    ("step_scale", "--step-scale"),
    ("steps", "--steps"),
    ("test_every", "--test-every"),
    ("thickness", "--thickness"),
    ("threshold", "--threshold"),
    ("transform", "--transform"),
    ("up", "--up"),
    ("voxel", "--voxel"),
];

/// The flag of the library's `option`.
fn flag_of(option: &str) -> Option<String> {
    FLAGS.iter().find(|(name, _)| *name == option).map(|(_, flag)| (*flag).to_owned())
}

/// The text of a `message` of the library, with flags for options. Options without a flag keep their names.
pub(super) fn with_flags(message: &dyn Display) -> String {
    named_by(flag_of, message)
}

#[cfg(test)]
mod tests {
    use strivec_format::{Invalid, Place};

    use super::*;

    #[test]
    fn files_of_other_formats_are_named() {
        for (bytes, name) in
            [(&b"ply\nform"[..], "PLY"), (b"\x89PNG\r\n", "PNG"), (b"{\"a\"", "JSON"), (b"PK\x03\x04", "ZIP")]
        {
            assert!(format_of(bytes).contains(name), "{}", format_of(bytes));
        }
        assert_eq!(format_of(b"This \xff"), "\"This \\xff\"");
    }

    #[test]
    fn options_become_flags() {
        let invalid = |option| Invalid::new(Place::option(option), "at least 1", 0);
        assert_eq!(with_flags(&invalid("budget")), "--max-params or --max-size must be at least 1; found 0");
        assert_eq!(with_flags(&invalid("min_points")), "--min-points must be at least 1; found 0");
        assert_eq!(with_flags(&invalid("top_k")), "`top_k` must be at least 1; found 0", "training has no such flag");
        let remedy = with_flags(&prior::Remedy::FewerCells);
        assert_eq!(remedy, "choose a larger --voxel, or a --crop");
        assert_eq!(prior::Remedy::FewerCells.to_string(), "choose a larger `voxel`, or a `crop`");
    }

    #[test]
    fn words_like_options_stay_as_they_are() {
        let key = Invalid::new(Place::Key("scale".into()), "one of `voxel` and `up`", "`force`");
        for message in ["set `voxel`", "run `strivec prior`; a ` alone", "`scale`"] {
            assert_eq!(with_flags(&message), message);
        }
        assert_eq!(with_flags(&key), "`scale` must be one of `voxel` and `up`; found `force`");
        // An option beside such words becomes a flag.
        let both = Invalid::new(Place::option("scale"), "one of `scale`", 0);
        assert_eq!(with_flags(&both), "--scale must be one of `scale`; found 0");
    }
}
