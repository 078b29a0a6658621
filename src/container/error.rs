//! Errors of reading and writing files (spec 7).

use std::fmt::Display;
use std::ops::Range;

use super::version::Version;
use crate::model::BrokenInvariant;

/// Why a file was not read or a scene not written.
///
/// The variants tell who must act. The file is not one of ours, or not of this version: [`Error::NotStrivec`],
/// [`Error::UnsupportedVersion`], [`Error::UnknownCritical`], [`Error::Unsupported`]. It was damaged on its way and
/// should be fetched again: [`Error::LineEndingDamage`], [`Error::Truncated`], [`Error::Corrupt`]. It was written
/// wrongly: [`Error::Malformed`], [`Error::MissingSection`]. It, or the scene, exceeds what the format allows:
/// [`Error::Limit`]; or what the caller allows: [`Error::Budget`]. Its bytes could not be had: [`Error::Source`]. The scene itself is not valid: [`Error::Scene`]. The caller asked for what
/// cannot be: [`Error::Overflow`], [`Error::Level`], [`Error::Compression`].
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The first bytes are no `.strivec` magic.
    #[error("not a .strivec file: it begins with {found:02x?}")]
    NotStrivec {
        /// The first bytes, at most 8.
        found: Vec<u8>,
    },
    /// The magic went through a conversion of line endings, or lost its high bits: the rest of the file is lost too.
    #[error("damaged by a transfer as text: the magic arrived as {found:02x?}; transfer the file as binary")]
    LineEndingDamage {
        /// The first bytes, at most 8.
        found: Vec<u8>,
    },
    /// A major version that this reader does not know.
    #[error("version {found} of the format; this reader knows major version {supported}")]
    UnsupportedVersion {
        /// The file's.
        found: Version,
        /// The major version read here.
        supported: u16,
    },
    /// The file ends early.
    #[error("truncated: {part} needs bytes {} to {}, which are missing", missing.start, missing.end)]
    Truncated {
        /// What is incomplete.
        part: String,
        /// The missing bytes of the file.
        missing: Range<u64>,
    },
    /// Bytes are not those that were written.
    #[error(
        "corrupt: {section} (bytes {} to {}) has checksum {found:08x} where {expected:08x} was written",
        range.start, range.end
    )]
    Corrupt {
        /// Which part.
        section: String,
        /// Its bytes in the file.
        range: Range<u64>,
        /// The checksum in the file.
        expected: u32,
        /// The checksum of the bytes.
        found: u32,
    },
    /// A section that this reader does not know and that the scene means nothing without.
    #[error("section {name} is unknown to this reader, and the scene cannot be understood without it")]
    UnknownCritical {
        /// Its name.
        name: String,
    },
    /// A named choice that this reader does not know, or knows and does not support.
    #[error("{place}: {found} is not supported")]
    Unsupported {
        /// Where.
        place: String,
        /// The choice.
        found: String,
    },
    /// Bytes that the format does not allow.
    #[error("malformed: {place}: expected {expected}, found {found}")]
    Malformed {
        /// Where.
        place: String,
        /// What the format demands.
        expected: String,
        /// What is there.
        found: String,
    },
    /// A section that every file must have.
    #[error("section {name} is missing")]
    MissingSection {
        /// Its name and scale.
        name: String,
    },
    /// A number beyond the format's limits, which reader and writer enforce alike.
    #[error("{place}: {found} is not in the format's range of {min} to {max}")]
    Limit {
        /// Which number.
        place: String,
        /// The smallest allowed.
        min: u64,
        /// The largest allowed.
        max: u64,
        /// The number.
        found: u64,
    },
    /// What is to be decoded takes more memory than the caller allows.
    #[error("{place} needs {needed} bytes of memory where {left} are left of what is allowed")]
    Budget {
        /// What needs it.
        place: String,
        /// Bytes that it needs.
        needed: u64,
        /// Bytes that are left.
        left: u64,
    },
    /// The source did not give bytes of the file.
    #[error("reading bytes {} to {}: {message}", range.start, range.end)]
    Source {
        /// The bytes asked for.
        range: Range<u64>,
        /// What it says.
        message: String,
    },
    /// A number too large for the encoding that was asked for: write the scene with 32-bit numbers.
    #[error("{place}: {value} exceeds {largest}, the largest number of this encoding; encode it as f32")]
    Overflow {
        /// Which number.
        place: String,
        /// Its value.
        value: f32,
        /// The largest value that the encoding has.
        largest: f32,
    },
    /// A compression level outside 1 to 22.
    #[error("compression level {found} is not between 1 and 22")]
    Level {
        /// The level asked for.
        found: i32,
    },
    /// The compressor failed.
    #[error("compressing {section}: {message}")]
    Compression {
        /// What was compressed.
        section: String,
        /// The compressor's message.
        message: String,
    },
    /// The scene breaks an invariant: before writing, or after everything in the file was read.
    #[error("not a valid scene: {0}")]
    Scene(#[from] BrokenInvariant),
}

impl Error {
    pub(super) fn malformed(place: impl Display, expected: impl Display, found: impl Display) -> Self {
        Self::Malformed { place: place.to_string(), expected: expected.to_string(), found: found.to_string() }
    }

    pub(super) fn unsupported(place: impl Display, found: impl Display) -> Self {
        Self::Unsupported { place: place.to_string(), found: found.to_string() }
    }

    /// [`Error::Malformed`] unless all `bytes` are 0.
    pub(super) fn unless_zero(place: impl Display, bytes: &[u8]) -> Result<(), Self> {
        match bytes.iter().find(|&&b| b != 0) {
            None => Ok(()),
            Some(byte) => Err(Self::malformed(place, "zeros", byte)),
        }
    }

    /// [`Error::Malformed`] unless both are equal.
    pub(super) fn unless_equal<T: PartialEq + Display>(place: impl Display, expected: T, found: T) -> Result<(), Self> {
        if expected == found { Ok(()) } else { Err(Self::malformed(place, expected, found)) }
    }
}
