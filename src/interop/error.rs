//! Errors of exports.

use std::io;
use std::ops::RangeInclusive;

/// Why a scene was not exported.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A setting is out of its range.
    #[error("`{field}` is {found}; expected {expected}")]
    Setting {
        /// The setting.
        field: &'static str,
        /// The allowed values.
        expected: String,
        /// The value.
        found: String,
    },
    /// The scene has nothing to export.
    #[error("{what}; {instead}")]
    Empty {
        /// The missing part, as a clause.
        what: String,
        /// A remedy, as an imperative.
        instead: &'static str,
    },
    /// The result would be too large.
    #[error("{what}: at most {limit} are exported, found {found}; set a smaller `resolution`")]
    TooLarge {
        /// The counted things.
        what: &'static str,
        /// The limit.
        limit: u64,
        /// The count at which the export ended.
        found: u64,
    },
    /// The scene has what the other program has not.
    #[error("the scene cannot be expressed there: expected {expected}, found {found}")]
    NotExpressible {
        /// What the other program has.
        expected: &'static str,
        /// What the scene has.
        found: String,
    },
    /// The file cannot be written.
    #[error("cannot write it: {0}")]
    Io(#[from] io::Error),
}

impl Error {
    /// Fails unless the setting `field` is in `range`.
    pub(super) fn unless_setting(field: &'static str, range: RangeInclusive<u32>, found: u32) -> Result<(), Self> {
        if range.contains(&found) {
            return Ok(());
        }
        let expected = format!("{} to {}", range.start(), range.end());
        Err(Self::Setting { field, expected, found: found.to_string() })
    }

    /// Fails unless `found` of `what` are at most `limit`.
    pub(super) fn unless_within(what: &'static str, limit: u64, found: u64) -> Result<(), Self> {
        if found <= limit { Ok(()) } else { Err(Self::TooLarge { what, limit, found }) }
    }

    /// Fails at the first condition that is not met; each has the expected and the found value.
    pub(super) fn unless_expressible(
        conditions: impl IntoIterator<Item = (bool, &'static str, String)>,
    ) -> Result<(), Self> {
        match conditions.into_iter().find(|(is_met, ..)| !is_met) {
            Some((_, expected, found)) => Err(Self::NotExpressible { expected, found }),
            None => Ok(()),
        }
    }
}
