//! The public header, and the layout of records.

use glam::DVec3;

use crate::error::excerpt;
use crate::input::bytes_at;
use crate::{Fault, Input, LeftOut};
use strivec_format::Place;

/// Points of one read.
pub(super) const BATCH: u64 = 4096;

/// Classes of noise: low and high.
const NOISE: [u8; 2] = [7, 18];

/// Bytes of the header of LAS 1.0 to 1.2; later versions extend it.
const HEADER_BYTES: usize = 227;

/// Bytes of the header of LAS 1.4.
const LARGEST_HEADER: usize = 375;

/// For each point format: bytes of a record, and offset of its color.
const FORMATS: [(u16, Option<usize>); 11] = [
    (20, None),
    (28, None),
    (26, Some(20)),
    (34, Some(28)),
    (57, None),
    (63, Some(28)),
    (30, None),
    (36, Some(30)),
    (38, Some(30)),
    (59, None),
    (67, Some(30)),
];

/// From this point format on, the class has its own byte.
const EXTENDED: u8 = 6;

/// Points per byte of LAZ. Scans take some three bytes per point; the limit bounds the time for a file of a few bytes.
const MAX_POINTS_PER_BYTE: u64 = 100;

/// The header.
#[derive(Debug)]
pub(super) struct LasHeader {
    /// True for LAZ.
    pub(super) compressed: bool,
    /// Point format, 0 to 10.
    pub(super) format: u8,
    pub(super) points: u64,
    /// Bytes of a record.
    pub(super) record: u64,
    /// Bytes of the header.
    pub(super) header: u64,
    pub(super) records: u32,
    pub(super) offset_to_points: u64,
    scale: DVec3,
    offset: DVec3,
}

impl LasHeader {
    /// Reads the header, and checks that the file holds the declared points.
    pub(super) fn read(input: &mut Input<'_>) -> Result<Self, Fault> {
        let mut bytes = [0; LARGEST_HEADER];
        input.fill(&mut bytes[..HEADER_BYTES], "a LAS header")?;
        if &bytes[..4] != b"LASF" {
            return Err(Fault::malformed(Place::Offset(0), "LASF", excerpt(&bytes[..4])));
        }
        let version = (bytes[24], bytes[25]);
        if version.0 != 1 || version.1 > 4 {
            let found = format!("{}.{}", version.0, version.1);
            return Err(Fault::malformed(Place::Offset(24), "a version from 1.0 to 1.4", found));
        }
        let header = u16::from_le_bytes([bytes[94], bytes[95]]);
        let least = [HEADER_BYTES, HEADER_BYTES, HEADER_BYTES, 235, LARGEST_HEADER][usize::from(version.1)];
        if usize::from(header) < least {
            return Err(Fault::malformed(Place::Offset(94), format!("a header of at least {least} bytes"), header));
        }
        if version.1 == 4 {
            input.fill(&mut bytes[HEADER_BYTES..], "a LAS 1.4 header")?;
        }
        let offset_to_points = u64::from(word(&bytes, 96));
        if offset_to_points < header.into() || offset_to_points > input.len() {
            let expected = format!("an offset of the points from {header} to {}", input.len());
            return Err(Fault::malformed(Place::Offset(96), expected, offset_to_points));
        }
        let format = bytes[104] & 0x3f;
        let compressed = bytes[104] & 0x80 != 0;
        let Some((least, _)) = FORMATS.get(usize::from(format)).filter(|_| bytes[104] & 0x40 == 0) else {
            return Err(Fault::malformed(Place::Offset(104), "a point format from 0 to 10", bytes[104]));
        };
        let record = u16::from_le_bytes([bytes[105], bytes[106]]);
        if record < *least {
            let expected = format!("records of at least {least} bytes");
            return Err(Fault::malformed(Place::Offset(105), expected, record));
        }
        // In 1.4, the older field is used unless it is 0.
        let points = match (word(&bytes, 107), version.1) {
            (0, 4) => u64::from_le_bytes(bytes_at(&bytes, 247)),
            (points, _) => points.into(),
        };
        let vector = |at: usize| DVec3::new(number(&bytes, at), number(&bytes, at + 8), number(&bytes, at + 16));
        let found = Self {
            compressed,
            format,
            points,
            record: record.into(),
            header: header.into(),
            records: word(&bytes, 100),
            offset_to_points,
            scale: vector(131),
            offset: vector(155),
        };
        found.check(input.len())?;
        Ok(found)
    }

    fn check(&self, len: u64) -> Result<(), Fault> {
        if !self.scale.is_finite() || !self.offset.is_finite() {
            return Err(Fault::malformed(
                Place::Offset(131),
                "finite scales and offsets",
                format!("{} {}", self.scale, self.offset),
            ));
        }
        let left = len - self.offset_to_points;
        let most = if self.compressed { left.saturating_mul(MAX_POINTS_PER_BYTE) } else { left / self.record };
        if self.points <= most {
            return Ok(());
        }
        let expected = format!("at most {most} points in {left} bytes");
        Err(Fault::malformed("the number of points", expected, self.points))
    }

    /// The reason to leave out `record`, if there is one.
    pub(super) fn leaves_out(&self, record: &[u8]) -> Option<LeftOut> {
        let (withheld, class) = match self.format {
            EXTENDED.. => (record[15] & 4 != 0, record[16]),
            _ => (record[15] & 0x80 != 0, record[15] & 0x1f),
        };
        match (withheld, NOISE.contains(&class)) {
            (true, _) => Some(LeftOut::Withheld),
            (false, true) => Some(LeftOut::Noise),
            (false, false) => None,
        }
    }

    /// Position of `record`.
    pub(super) fn position(&self, record: &[u8]) -> DVec3 {
        let axis = |at: usize| f64::from(word(record, at) as i32);
        DVec3::new(axis(0), axis(4), axis(8)) * self.scale + self.offset
    }

    /// Color of `record`, 16 bits per channel.
    pub(super) fn color(&self, record: &[u8]) -> Option<[u16; 3]> {
        let start = FORMATS[usize::from(self.format)].1?;
        Some([0, 2, 4].map(|channel| u16::from_le_bytes([record[start + channel], record[start + channel + 1]])))
    }

    /// Bytes of a record beyond those of its format.
    pub(super) fn extra(&self) -> u16 {
        self.record as u16 - FORMATS[usize::from(self.format)].0
    }
}

fn word(bytes: &[u8], at: usize) -> u32 {
    u32::from_le_bytes(bytes_at(bytes, at))
}

fn number(bytes: &[u8], at: usize) -> f64 {
    f64::from_le_bytes(bytes_at(bytes, at))
}
