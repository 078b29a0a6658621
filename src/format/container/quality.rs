//! QUALITY: measurements of the scene (spec 3.12).

use std::fmt::Display;

use super::error::Error;
use super::limits;
use super::payload::Payload;
use super::record::{self, BorrowDecode, Encode, Record, Str};
use super::section::SectionKind;
use super::writer::{SectionPlace, Writer};
use crate::digits::number;

/// Measurements of a scene: PSNR in dB, infinite if there is no difference, `None` if not measured.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Quality {
    /// PSNR of this scene's pictures against those before its numbers were encoded, over all pixels.
    pub encoded: Option<f64>,
    /// Mean over photographs, for this scene.
    pub test: Option<f64>,
    /// Mean over photographs, for the scene before its numbers were encoded.
    pub test_before: Option<f64>,
    /// \[scale\] of the pictures of scales 0 to this one against those of all scales; `None` for the last.
    pub prefixes: Vec<Option<f64>>,
    /// The dataset and the photographs of `test` and `test_before`: how many of which split.
    pub dataset: String,
}

/// The bytes of the number of prefixes in the record.
const PREFIXES: std::ops::Range<usize> = 24..32;

/// All bits of a number are set if it was not measured.
#[derive(Encode, BorrowDecode)]
struct QualityRecord<'a> {
    encoded: f64,
    test: f64,
    test_before: f64,
    prefixes: Vec<f64>,
    dataset: Str<'a, { *limits::STRING_BYTES.end() }>,
}

impl Record for QualityRecord<'_> {
    fn check(&self, place: &dyn Display) -> Result<(), Error> {
        let valid = |v: f64| v.to_bits() == u64::MAX || v > f64::NEG_INFINITY;
        for (name, values) in [
            ("PSNR against before", &[self.encoded][..]),
            ("PSNR of the test views", &[self.test, self.test_before]),
            ("PSNR of prefixes", &self.prefixes),
        ] {
            if let Some(found) = values.iter().find(|v| !valid(**v)) {
                return Err(Error::invalid(
                    format!("{place} {name}"),
                    "a finite number, +infinity or all bits set",
                    number(*found),
                ));
            }
        }
        limits::check(format!("{place} dataset bytes"), limits::STRING_BYTES, self.dataset.0.len())
    }
}

/// [`Error::Malformed`] unless there are 0 prefixes or `scales`.
fn check_prefixes(found: u64, scales: usize) -> Result<(), Error> {
    if found == 0 || found == scales as u64 {
        return Ok(());
    }
    Err(Error::malformed("QUALITY number of prefixes", format!("0 or {scales}, the number of scales"), found))
}

/// `quality` of a scene of `scales` scales.
pub(super) fn write(writer: &mut Writer, quality: &Quality, scales: usize) -> Result<(), Error> {
    check_prefixes(quality.prefixes.len() as u64, scales)?;
    let unknown = f64::from_bits(u64::MAX);
    let record = QualityRecord {
        encoded: quality.encoded.unwrap_or(unknown),
        test: quality.test.unwrap_or(unknown),
        test_before: quality.test_before.unwrap_or(unknown),
        prefixes: quality.prefixes.iter().map(|p| p.unwrap_or(unknown)).collect(),
        dataset: Str(&quality.dataset),
    };
    writer.record(SectionPlace::whole(SectionKind::Quality), record::write(&"QUALITY", &record)?);
    Ok(())
}

/// The measurements of a scene of `scales` scales.
pub(super) fn read(payload: &Payload<'_>, scales: usize) -> Result<Quality, Error> {
    payload.section.check_entry()?;
    // Before it is used.
    if let Some(count) = payload.bytes().get(PREFIXES).and_then(|bytes| bytes.try_into().ok()) {
        check_prefixes(u64::from_le_bytes(count), scales)?;
    }
    let record: QualityRecord<'_> = payload.record()?;
    let known = |v: f64| (v.to_bits() != u64::MAX).then_some(v);
    Ok(Quality {
        encoded: known(record.encoded),
        test: known(record.test),
        test_before: known(record.test_before),
        prefixes: record.prefixes.into_iter().map(known).collect(),
        dataset: record.dataset.0.into(),
    })
}
