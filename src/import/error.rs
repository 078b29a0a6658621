//! Errors of reading geometry.

use std::fmt::Display;
use std::io;
use std::path::{Path, PathBuf};

use strivec_format::{Invalid, OptionName, Place};

/// Why reading failed, without the file's name, which readers of bytes do not have.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Fault {
    /// The system failed to read the file.
    #[error("cannot read it: {0}")]
    Io(#[from] io::Error),
    /// The file has a value that its format does not allow. The place is mostly the position at which the value begins.
    #[error("{}: expected {}, found {}", .0.place, .0.expected, .0.found)]
    Malformed(Invalid),
    /// A coordinate is not a finite number. Visitors may leave such records out.
    #[error("{}: expected {}, found {}", .0.place, .0.expected, .0.found)]
    NotFinite(Invalid),
    /// The file breaks its format in another way.
    #[error("{place}: {problem}")]
    Broken {
        /// A byte offset, a line, or the name of a part.
        place: String,
        /// The problem as a clause.
        problem: String,
    },
    /// A part of the format that is not supported.
    #[error("{what} is not supported: {instead}")]
    Unsupported {
        /// The unsupported part.
        what: String,
        /// A remedy, as an imperative.
        instead: String,
    },
    /// A grid in a file without its bounds, which the options do not give either.
    #[error("a grid without bounds is not supported: give its smallest and largest corner as {}", OptionName("bounds"))]
    NoBounds,
    /// A count or length exceeds a limit.
    #[error("{what}: at most {limit} are read, found {found}")]
    Limit {
        /// The limited quantity.
        what: String,
        /// The limit.
        limit: u64,
        /// The found or declared value.
        found: u64,
    },
    /// The visitor stopped the reading.
    #[error("interrupted")]
    Stopped,
}

impl From<Invalid> for Fault {
    fn from(invalid: Invalid) -> Self {
        Self::Malformed(invalid)
    }
}

impl Fault {
    /// [`Fault::Malformed`].
    pub fn malformed(place: impl Into<Place>, expected: impl Display, found: impl Display) -> Self {
        Self::Malformed(Invalid::new(place, expected, found))
    }

    /// [`Fault::Broken`] with the problem as a clause.
    pub fn broken(place: impl Into<String>, problem: impl Into<String>) -> Self {
        Self::Broken { place: place.into(), problem: problem.into() }
    }

    /// [`Fault::Unsupported`].
    pub fn unsupported(what: impl Into<String>, instead: impl Into<String>) -> Self {
        Self::Unsupported { what: what.into(), instead: instead.into() }
    }

    /// Checks that `found` is at most `limit`.
    ///
    /// # Errors
    ///
    /// [`Fault::Limit`] otherwise.
    pub fn unless_within(what: &str, limit: u64, found: u64) -> Result<(), Self> {
        if found <= limit { Ok(()) } else { Err(Self::Limit { what: what.into(), limit, found }) }
    }

    /// The error for the file `path`.
    pub fn of(self, path: &Path) -> ImportError {
        ImportError { path: path.to_path_buf(), fault: self }
    }
}

/// Why a file could not be read.
#[derive(Debug, thiserror::Error)]
#[error("{}: {fault}", path.display())]
pub struct ImportError {
    /// The file.
    pub path: PathBuf,
    /// The problem.
    #[source]
    pub fault: Fault,
}

/// The beginning of a text in quotation marks, with control characters escaped.
pub(super) fn excerpt(text: &[u8]) -> String {
    const CHARACTERS: usize = 40;
    // A character has at most four bytes, so only that much of a long text is decoded.
    let start = String::from_utf8_lossy(&text[..text.len().min(4 * CHARACTERS)]);
    let end = start.char_indices().nth(CHARACTERS).map_or(start.len(), |(end, _)| end);
    let more = if end < start.len() || text.len() > 4 * CHARACTERS { "…" } else { "" };
    format!("\"{}{more}\"", start[..end].escape_debug())
}
