//! What can be wrong with a file of geometry.

use std::io;
use std::path::{Path, PathBuf};

/// Why a file was not read to its end, the file left open: readers do not know its name.
#[derive(Debug, thiserror::Error)]
pub enum Fault {
    /// The system.
    #[error("cannot read it: {0}")]
    Io(#[from] io::Error),
    /// The file breaks its format.
    #[error("{place}: {problem}")]
    Malformed {
        /// A byte offset, a line, or the name of a part.
        place: String,
        /// The problem as a clause, with the expected and the found value.
        problem: String,
    },
    /// A part of the format that is not read here.
    #[error("{what} is not supported: {instead}")]
    Unsupported {
        /// Its name.
        what: String,
        /// What to do about it.
        instead: String,
    },
    /// More than is read.
    #[error("{what}: at most {limit} are read, found {found}")]
    Limit {
        /// What there is too much of.
        what: String,
        /// The most that is read.
        limit: u64,
        /// How much there is, or is declared.
        found: u64,
    },
    /// The visitor asked to stop.
    #[error("interrupted")]
    Stopped,
}

impl Fault {
    /// [`Fault::Malformed`] with the problem "expected `expected`, found `found`", two noun phrases.
    pub fn malformed(place: impl Into<String>, expected: impl Into<String>, found: impl ToString) -> Self {
        Self::invalid(place, format!("expected {}, found {}", expected.into(), found.to_string()))
    }

    /// [`Fault::Malformed`] with the problem as a clause.
    pub fn invalid(place: impl Into<String>, problem: impl Into<String>) -> Self {
        Self::Malformed { place: place.into(), problem: problem.into() }
    }

    /// [`Fault::Unsupported`].
    pub fn unsupported(what: impl Into<String>, instead: impl Into<String>) -> Self {
        Self::Unsupported { what: what.into(), instead: instead.into() }
    }

    /// [`Fault::Limit`] where `found` is past `limit`.
    ///
    /// # Errors
    ///
    /// Exactly then.
    pub fn unless_within(what: &str, limit: u64, found: u64) -> Result<(), Self> {
        if found <= limit { Ok(()) } else { Err(Self::Limit { what: what.into(), limit, found }) }
    }

    /// With the file's name.
    pub fn of(self, path: &Path) -> ImportError {
        ImportError { path: path.to_path_buf(), fault: self }
    }
}

/// Why the file `path` was not read to its end.
#[derive(Debug, thiserror::Error)]
#[error("{}: {fault}", path.display())]
pub struct ImportError {
    /// The file.
    pub path: PathBuf,
    /// What is wrong with it.
    #[source]
    pub fault: Fault,
}

/// The beginning of a text, in quotation marks, with nothing in it that a terminal would obey.
pub(super) fn excerpt(text: &[u8]) -> String {
    const CHARACTERS: usize = 40;
    // A character is at most four bytes, so that a long text is not turned whole.
    let start = String::from_utf8_lossy(&text[..text.len().min(4 * CHARACTERS)]);
    let end = start.char_indices().nth(CHARACTERS).map_or(start.len(), |(end, _)| end);
    let more = if end < start.len() || text.len() > 4 * CHARACTERS { "…" } else { "" };
    format!("\"{}{more}\"", start[..end].escape_debug())
}
