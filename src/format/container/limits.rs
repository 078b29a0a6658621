//! The format's limits (spec 5). Reader and writer check every record against them before they allocate anything whose
//! size a file or a scene declares.

use std::fmt::Display;
use std::ops::RangeInclusive;

use super::error::Error;
use crate::model::{MAX_STEPS, MAX_TOP_K};

/// Sections in a file, of any kind.
pub const SECTIONS: RangeInclusive<u64> = 1..=65_536;
/// Scales of a scene.
pub const SCALES: RangeInclusive<u64> = 1..=16;
/// Tensors of a scale.
pub const TENSORS: RangeInclusive<u64> = 1..=1 << 22;
/// One more than the largest cell coordinate, per axis.
pub const CELL_EXTENT: RangeInclusive<u64> = 1..=1 << 20;
/// `top_k`, the largest number of neighbors of a point.
pub const TOP_K: RangeInclusive<u64> = 1..=MAX_TOP_K as u64;
/// Cells of a factor, per axis.
pub const RESOLUTION: RangeInclusive<u64> = 1..=1024;
/// Density or appearance components of a tensor.
pub const RANK: RangeInclusive<u64> = 1..=512;
/// P, the length of the appearance feature vector.
pub const FEATURES: RangeInclusive<u64> = 1..=256;
/// Frequencies of a positional encoding.
pub const FREQUENCIES: RangeInclusive<u64> = 0..=16;
/// Layers of the decoder.
pub const LAYERS: RangeInclusive<u64> = 1..=16;
/// Inputs or outputs of a layer.
pub const LAYER_WIDTH: RangeInclusive<u64> = 1..=1024;
/// Occupancy vertices, per axis.
pub const OCCUPANCY_AXIS: RangeInclusive<u64> = 2..=4096;
/// Occupancy vertices in all.
pub const OCCUPANCY_VERTICES: RangeInclusive<u64> = 8..=1 << 28;
/// Bytes of a string.
pub const STRING_BYTES: RangeInclusive<u64> = 0..=4096;
/// Chunks of a scale.
pub const CHUNKS: RangeInclusive<u64> = 1..=16_384;
/// Appearance ranks of several scales together.
pub const RANK_SUM: RangeInclusive<u64> = 1..=4096;
/// Bytes of a text: a license, a note.
pub const TEXT_BYTES: RangeInclusive<u64> = 0..=1 << 20;
/// Probes, views of a path, cameras, notes.
pub const ITEMS: RangeInclusive<u64> = 0..=65_536;
/// Probes, times the steps on the longest ray through the bounds.
pub const PROBE_STEPS: RangeInclusive<u64> = 0..=1 << 22;
/// Bytes of a thumbnail.
pub const THUMBNAIL_BYTES: RangeInclusive<u64> = 1..=1 << 22;

/// Steps along the diagonal of the bounds: samples of a ray.
pub const STEPS: RangeInclusive<u64> = 0..=MAX_STEPS;

/// Bytes of a section's record: bounds what decoding one can allocate.
pub const RECORD_BYTES: usize = 1 << 23;

/// What a reader may spend on an untrusted file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limits {
    /// Bytes of memory for all decoded data, besides the file's own bytes and 16 MiB.
    pub memory: u64,
}

impl Default for Limits {
    /// 4 GiB, four times the largest scenes that are trained; 1 GiB if addresses have 32 bits, as a renderer holds
    /// copies.
    fn default() -> Self {
        Self { memory: if cfg!(target_pointer_width = "32") { 1 << 30 } else { 1 << 32 } }
    }
}

impl Limits {
    /// The limits for a file of `length` bytes, unless the caller sets others: 512 MiB and 64 bytes for each of the
    /// file's, but at most the default. Packed scenes take 100 to 200 MiB, and a small file that is made to take as
    /// much as it can is still read within seconds.
    pub fn of_file(length: u64) -> Self {
        Self { memory: length.saturating_mul(64).saturating_add(512 << 20).min(Self::default().memory) }
    }
}

/// The memory left to a reader. Nothing is given back, so its peak is at most what was spent.
pub(super) struct Budget {
    left: u64,
}

impl Budget {
    pub(super) fn new(limits: Limits) -> Self {
        // Whatever is spent can then be counted, and allocated, in `usize`.
        Self { left: limits.memory.min(isize::MAX as u64) }
    }

    /// Takes `bytes` for `place`, before they are allocated.
    pub(super) fn spend(&mut self, place: impl Display, bytes: u64) -> Result<(), Error> {
        self.left = self.left.checked_sub(bytes).ok_or_else(|| Error::Budget {
            place: place.to_string(),
            needed: bytes,
            left: self.left,
        })?;
        Ok(())
    }

    /// Takes `bytes` for `place`, which then has a budget of its own.
    pub(super) fn set_aside(&mut self, place: impl Display, bytes: u64) -> Result<Self, Error> {
        self.spend(place, bytes)?;
        Ok(Self { left: bytes })
    }
}

/// [`Error::Limit`] unless `found` lies within `range`.
pub(super) fn check(
    place: impl Display,
    range: RangeInclusive<u64>,
    found: impl TryInto<u64> + Copy,
) -> Result<(), Error> {
    let found = found.try_into().unwrap_or(u64::MAX);
    if range.contains(&found) {
        return Ok(());
    }
    Err(Error::Limit { place: place.to_string(), min: *range.start(), max: *range.end(), found })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_budget_is_spent_once() {
        let mut budget = Budget::new(Limits { memory: 10 });
        assert_eq!(budget.spend("a", 7), Ok(()));
        assert_eq!(budget.spend("b", 4), Err(Error::Budget { place: "b".into(), needed: 4, left: 3 }));
        assert_eq!(budget.spend("c", 3), Ok(()));
    }

    #[test]
    fn both_ends_of_a_range_belong_to_it() {
        assert!(check("rank", RANK, 1u32).is_ok() && check("rank", RANK, 512u32).is_ok());
        assert!(check("rank", RANK, 0u32).is_err() && check("rank", RANK, 513u32).is_err());
    }
}
