//! Errors of exports.

use std::io;
use std::ops::RangeInclusive;

use strivec_format::model::OverMemory;
use strivec_format::{Invalid, OptionName, Place};

/// Why a scene was not exported.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A setting is out of its range.
    #[error(transparent)]
    Setting(Invalid),
    /// The scene has nothing to export.
    #[error("{what}; {instead}")]
    Empty {
        /// The missing part, as a clause.
        what: String,
        /// A remedy, as an imperative.
        instead: &'static str,
    },
    /// No density is as large as the threshold of the surface.
    #[error(
        "no density has a surface at an {} of {alpha}; set a smaller one, a larger {}, or keep smaller parts",
        OptionName("alpha"),
        OptionName("resolution")
    )]
    NoSurface {
        /// The opacity of a march step.
        alpha: f64,
    },
    /// The result would be too large.
    #[error("{what}: at most {limit} are exported, found {found}; set a smaller {}", OptionName("resolution"))]
    TooLarge {
        /// The counted things.
        what: &'static str,
        /// The limit.
        limit: u64,
        /// The count at which the export ended.
        found: u64,
    },
    /// The scene takes more memory than it may.
    #[error(transparent)]
    Memory(#[from] OverMemory),
    /// A coordinate is beyond those of the file's format.
    #[error("a coordinate of {found} is beyond the {limit} of {format}; write PLY, or export in model space")]
    TooFar {
        /// The file's format.
        format: &'static str,
        /// The largest coordinate of the format.
        limit: f64,
        /// The largest coordinate of the scene.
        found: f64,
    },
    /// The scene cannot be a checkpoint.
    #[error(transparent)]
    Checkpoint(#[from] strivec_checkpoints::Error),
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
        Err(Self::Setting(Invalid::new(Place::option(field), expected, found)))
    }

    /// Fails unless `found` of `what` are at most `limit`.
    pub(super) fn unless_within(what: &'static str, limit: u64, found: u64) -> Result<(), Self> {
        if found <= limit { Ok(()) } else { Err(Self::TooLarge { what, limit, found }) }
    }
}
