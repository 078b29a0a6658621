//! Errors of reading and writing files (spec 7).

use std::fmt::Display;
use std::ops::Range;

use super::version::Version;
use crate::Invalid;

/// The reason why a file was not read or a scene not written (spec 7).
///
/// | group | variants | remedy |
/// |---|---|---|
/// | foreign | [`Error::NotStrivec`] | open another file |
/// | damaged | [`Error::LineEndingDamage`], [`Error::Truncated`], [`Error::Corrupt`] | transfer the file again |
/// | unsupported | [`Error::UnsupportedVersion`], [`Error::UnknownCritical`], [`Error::Unsupported`] | use a newer reader |
/// | invalid | [`Error::Malformed`], [`Error::MissingSection`], [`Error::Limit`], [`Error::Scene`] | write the file again |
/// | over budget | [`Error::Budget`] | allow more memory |
/// | input | [`Error::Source`] | read again |
/// | options of the writer | [`Error::Overflow`], [`Error::Level`], [`Error::Compression`] | choose others |
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The file does not begin with the magic.
    #[error("not a .strivec file: it begins with {}", hex(found))]
    NotStrivec {
        /// The first bytes, at most 8.
        found: Vec<u8>,
    },
    /// The file begins with a damaged magic: a transfer as text changed it (spec 2.1).
    #[error("damaged by a transfer as text: the file begins with {}; transfer it as binary", hex(found))]
    LineEndingDamage {
        /// The first bytes, at most 8.
        found: Vec<u8>,
    },
    /// A major version that this reader does not support.
    #[error("version {found} of the format is not supported; this reader supports major version {supported}")]
    UnsupportedVersion {
        /// The version of the file.
        found: Version,
        /// The major version of this reader.
        supported: u16,
    },
    /// The file ends early.
    #[error("truncated: {part} needs bytes {} to {}, which are missing", missing.start, missing.end)]
    Truncated {
        /// The incomplete part.
        part: String,
        /// The missing bytes of the file.
        missing: Range<u64>,
    },
    /// A checksum is wrong.
    #[error(
        "corrupt: the checksum of {section} (bytes {} to {}) must be {expected:08x}; found {found:08x}",
        range.start, range.end
    )]
    Corrupt {
        /// The part of the file.
        section: String,
        /// The section's bytes in the file.
        range: Range<u64>,
        /// The checksum in the file.
        expected: u32,
        /// The checksum of the bytes.
        found: u32,
    },
    /// A critical section of an unknown kind.
    #[error("section {name} is unknown to this reader, and the scene cannot be read without it")]
    UnknownCritical {
        /// Name of the section.
        name: String,
    },
    /// A code that this version does not define, or a reserved field that is not 0.
    #[error("{place}: {found} is not supported")]
    Unsupported {
        /// The field.
        place: String,
        /// The code or its name.
        found: String,
    },
    /// A rule on the layout of bytes is broken.
    #[error("malformed: {0}")]
    Malformed(Invalid),
    /// A section that every file must have.
    #[error("section {name} is missing")]
    MissingSection {
        /// Name and scale of the section.
        name: String,
    },
    /// A number outside the limits of spec 5, which reader and writer enforce.
    #[error("{place} must be within the format's limits, {min} to {max}; found {found}")]
    Limit {
        /// The field.
        place: String,
        /// The smallest allowed.
        min: u64,
        /// The largest allowed.
        max: u64,
        /// The number.
        found: u64,
    },
    /// Decoding needs more memory than the caller allows.
    #[error("{place} needs {needed} bytes of memory, but {left} bytes of the budget are left")]
    Budget {
        /// The part of the file.
        place: String,
        /// Bytes of memory that it needs.
        needed: u64,
        /// Bytes of the budget that are left.
        left: u64,
    },
    /// The source failed to read bytes of the file.
    #[error("cannot read bytes {} to {}: {message}", range.start, range.end)]
    Source {
        /// The requested bytes.
        range: Range<u64>,
        /// The source's message.
        message: String,
    },
    /// A number is too large for its encoding.
    #[error("{place} is {value}, which exceeds {largest}, the largest number of this encoding; use f32")]
    Overflow {
        /// The position of the number.
        place: String,
        /// Value of the number.
        value: f32,
        /// The largest number of the encoding.
        largest: f32,
    },
    /// A compression level outside 1 to 22.
    #[error("the compression level must be from 1 to 22; found {found}")]
    Level {
        /// The requested level.
        found: i32,
    },
    /// The compressor failed.
    #[error("cannot compress {section}: {message}")]
    Compression {
        /// The section.
        section: String,
        /// The compressor's message.
        message: String,
    },
    /// A rule on values is broken: the scene breaks an invariant ([`crate::model::Scene::check`]), or a field of a
    /// section is outside its range (spec 3).
    #[error("not a valid scene: {0}")]
    Scene(#[from] Invalid),
}

impl Error {
    /// The class of the error by its name in section 7 of the specification; `None` if the error is not of a file.
    pub fn class(&self) -> Option<&'static str> {
        Some(match self {
            Self::NotStrivec { .. } => "foreign",
            Self::LineEndingDamage { .. } => "text-transfer",
            Self::Truncated { .. } => "truncated",
            Self::Corrupt { .. } => "corrupt",
            Self::UnsupportedVersion { .. } => "version",
            Self::UnknownCritical { .. } => "kind",
            Self::Unsupported { .. } => "code",
            Self::MissingSection { .. } => "missing",
            Self::Limit { .. } => "limit",
            Self::Malformed(_) => "malformed",
            Self::Scene(_) => "value",
            Self::Budget { .. } => "budget",
            Self::Source { .. } | Self::Overflow { .. } | Self::Level { .. } | Self::Compression { .. } => return None,
        })
    }

    /// True if another reader may open the file as it is: a newer one, or one that may take more memory.
    pub fn needs_another_reader(&self) -> bool {
        matches!(
            self,
            Self::UnsupportedVersion { .. }
                | Self::UnknownCritical { .. }
                | Self::Unsupported { .. }
                | Self::Budget { .. }
        )
    }

    pub(super) fn malformed(place: impl Display, expected: impl Display, found: impl Display) -> Self {
        Self::Malformed(Invalid::new(place.to_string(), expected, found))
    }

    /// [`Error::Scene`]: a field of a section that is outside its range.
    pub(super) fn invalid(place: impl Display, expected: impl Display, found: impl Display) -> Self {
        Self::Scene(Invalid::new(place.to_string(), expected, found))
    }

    /// [`Error::Unsupported`]: a code of the `field` of `place` that this version does not define.
    pub(super) fn unknown_code(place: impl Display, field: &str, code: impl Display) -> Self {
        Self::unsupported(format!("{place} {field}"), format!("code {code}"))
    }

    pub(super) fn unsupported(place: impl Display, found: impl Display) -> Self {
        Self::Unsupported { place: place.to_string(), found: found.to_string() }
    }

    /// [`Error::Unsupported`] unless the reserved `bytes` of `place` are 0: another value belongs to a later version
    /// (spec 1).
    pub(super) fn unless_reserved(place: impl Display, bytes: &[u8]) -> Result<(), Self> {
        if bytes.iter().all(|&b| b == 0) {
            return Ok(());
        }
        Err(Self::unsupported(format!("{place} reserved bytes"), "a value other than 0"))
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

/// Bytes in hexadecimal, as in b3 53.
pub(super) fn hex(bytes: &[u8]) -> String {
    if bytes.is_empty() {
        return "nothing".into();
    }
    bytes.iter().map(|b| format!("{b:02x}")).collect::<Vec<_>>().join(" ")
}
