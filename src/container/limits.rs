//! The format's limits (format-spec/v1.md, section "Limits"). Reader and writer both pass every record through them
//! before they allocate anything whose size a file or a scene declares.

use std::fmt::Display;
use std::ops::RangeInclusive;

use super::Error;
use crate::model::MAX_TOP_K;

/// Sections in a file, of any kind.
pub const SECTIONS: RangeInclusive<u64> = 1..=65_536;
/// Scales of a scene.
pub const SCALES: RangeInclusive<u64> = 1..=16;
/// Tensors of a scale.
pub const TENSORS: RangeInclusive<u64> = 1..=1 << 24;
/// One more than the largest cell coordinate, per axis.
pub const CELL_EXTENT: RangeInclusive<u64> = 1..=1 << 20;
/// M, the neighbours that a point aggregates.
pub const TOP_K: RangeInclusive<u64> = 1..=MAX_TOP_K as u64;
/// Cells of a factor, per axis.
pub const RESOLUTION: RangeInclusive<u64> = 1..=1024;
/// Density or appearance components of a tensor.
pub const RANK: RangeInclusive<u64> = 1..=256;
/// P, the length of the appearance feature vector.
pub const FEATURES: RangeInclusive<u64> = 1..=256;
/// Frequencies of a positional encoding.
pub const FREQUENCIES: RangeInclusive<u64> = 0..=16;
/// Layers of the decoder.
pub const LAYERS: RangeInclusive<u64> = 1..=16;
/// Inputs or outputs of a layer.
pub const LAYER_WIDTH: RangeInclusive<u64> = 1..=16_384;
/// Occupancy vertices, per axis.
pub const OCCUPANCY_AXIS: RangeInclusive<u64> = 2..=4096;
/// Occupancy vertices in all.
pub const OCCUPANCY_VERTICES: RangeInclusive<u64> = 8..=1 << 30;
/// Bytes of a string.
pub const STRING_BYTES: RangeInclusive<u64> = 0..=4096;
/// Bytes of all sections of known kind together once they are decoded.
pub const DECODED_BYTES: RangeInclusive<u64> = 0..=1 << 32;

/// Bytes of a section's record: bounds what decoding one can allocate.
pub const RECORD_BYTES: usize = 1 << 16;
/// Decoded bytes that compressed sections may have whatever their stored size.
pub const FREE_EXPANSION: u64 = 32 << 20;
/// Decoded bytes that every stored byte of a compressed section allows for besides.
pub const EXPANSION_RATIO: u64 = 64;

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

/// How much compressed sections may still expand: what keeps a small file from filling the memory.
///
/// Spent in table order, by the writer to decide what to compress and by the reader to refuse.
pub(super) struct ExpansionAllowance(u64);

impl ExpansionAllowance {
    pub(super) fn new() -> Self {
        Self(FREE_EXPANSION)
    }

    /// Spends what a compressed section of these sizes needs; where the allowance does not suffice nothing changes and
    /// the error is what would have been allowed.
    pub(super) fn spend(&mut self, stored: u64, decoded: u64) -> Result<(), u64> {
        let allowed = self.0.saturating_add(stored.saturating_mul(EXPANSION_RATIO));
        self.0 = allowed.checked_sub(decoded).ok_or(allowed)?;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_allowance_is_shared_by_all_sections() {
        let mut allowance = ExpansionAllowance::new();
        assert_eq!(allowance.spend(10, FREE_EXPANSION), Ok(()));
        assert_eq!(allowance.spend(1, 10 * EXPANSION_RATIO + EXPANSION_RATIO), Ok(()));
        assert_eq!(allowance.spend(1, EXPANSION_RATIO + 1), Err(EXPANSION_RATIO));
        assert_eq!(allowance.spend(1, EXPANSION_RATIO), Ok(()));
    }

    #[test]
    fn both_ends_of_a_range_belong_to_it() {
        assert!(check("rank", RANK, 1u32).is_ok() && check("rank", RANK, 256u32).is_ok());
        assert!(check("rank", RANK, 0u32).is_err() && check("rank", RANK, 257u32).is_err());
    }
}
