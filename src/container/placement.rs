//! PLACEMENT: where a scale's tensors are.
//!
//! On a lattice the occupied cells are numbered x fastest, z slowest, within the smallest extent from cell 0 that
//! holds them all; the first number and then each number's distance to its predecessor, less one, are written as
//! LEB128 integers. Elsewhere the centres are written as they are.

use glam::{DVec3, UVec3};

use super::cursor::Payload;
use super::section::SectionKind;
use super::writer::Writer;
use super::{Error, records};
use crate::geometry::Lattice;
use crate::model::{Placement, Scale};

/// Bytes of the longest LEB128 integer: numbers of cells are below 2^60.
const LONGEST: u64 = 9;

/// What a PLACEMENT section says.
pub(super) struct Tensors {
    pub(super) placement: Placement,
    pub(super) half: DVec3,
    pub(super) top_k: u32,
    count: u32,
}

impl Tensors {
    /// Number of tensors.
    pub(super) fn placement_len(&self) -> u32 {
        self.count
    }
}

pub(super) fn write(writer: &mut Writer, index: u16, scale: &Scale) -> Result<(), Error> {
    let place = format!("PLACEMENT of scale {index}");
    let record = records::Placement {
        kind: match scale.cloud.placement {
            Placement::Lattice { .. } => 0,
            Placement::Explicit { .. } => 1,
        },
        tensors: scale.cloud.len().try_into().unwrap_or(u32::MAX),
        top_k: scale.top_k,
        half: scale.cloud.half.to_array(),
    };
    let mut head = records::write(&place, &record)?;
    let mut body = Vec::new();
    match &scale.cloud.placement {
        Placement::Lattice { lattice, cells } => {
            let largest = cells.iter().fold(UVec3::ZERO, |largest, cell| largest.max(*cell));
            let extent = largest.saturating_add(UVec3::ONE);
            let (origin, pitch) = (lattice.origin.to_array(), lattice.pitch.to_array());
            head.extend(records::write(&place, &records::Lattice { origin, pitch, extent: extent.to_array() })?);
            // One past the previous cell's number.
            let mut next = 0;
            for cell in cells {
                let number = Numbering(extent).number(*cell);
                let distance = number.checked_sub(next);
                // Ascending centres, which the scene's check saw, are ascending cells.
                write_integer(&mut body, distance.ok_or_else(|| Error::malformed(&place, "ascending cells", cell))?);
                next = number + 1;
            }
        }
        Placement::Explicit { centers } => {
            body.extend(centers.iter().flat_map(|c| c.to_array()).flat_map(f64::to_le_bytes));
        }
    }
    writer.compressed(SectionKind::Placement, Some(index), head, &body)
}

pub(super) fn read(payload: &Payload<'_>) -> Result<Tensors, Error> {
    let (record, rest): (records::Placement, _) = records::read(payload.section, payload.encoded())?;
    let placement = match record.kind {
        0 => {
            let (lattice, stored): (records::Lattice, _) = records::read(payload.section, rest)?;
            let cells = read_cells(payload, stored, record.tensors, UVec3::from_array(lattice.extent))?;
            let origin = DVec3::from_array(lattice.origin);
            Placement::Lattice { lattice: Lattice { origin, pitch: DVec3::from_array(lattice.pitch) }, cells }
        }
        1 => {
            let body = payload.body(rest, 24 * u64::from(record.tensors))?;
            let coordinates: Vec<f64> = body.as_chunks().0.iter().map(|&b| f64::from_le_bytes(b)).collect();
            let centers = coordinates.as_chunks().0.iter().map(|&c| DVec3::from_array(c)).collect();
            Placement::Explicit { centers }
        }
        code => return Err(Error::unsupported(format!("{} kind", payload.section), format!("code {code}"))),
    };
    Ok(Tensors { placement, half: DVec3::from_array(record.half), top_k: record.top_k, count: record.tensors })
}

fn read_cells(payload: &Payload<'_>, stored: &[u8], tensors: u32, extent: UVec3) -> Result<Vec<UVec3>, Error> {
    let place = payload.section;
    let length = payload.declared_body_length(stored)?;
    let tensors = u64::from(tensors);
    if !(tensors..=LONGEST * tensors).contains(&length) {
        let expected = format!("{tensors} to {}", LONGEST * tensors);
        return Err(Error::malformed(format!("{place} bytes of cells"), expected, length));
    }
    let body = payload.body(stored, length)?;
    let numbering = Numbering(extent);
    let mut bytes = body.as_ref();
    let mut cells = Vec::with_capacity(tensors as usize);
    let mut next: u64 = 0;
    let mut largest = UVec3::ZERO;
    for n in 0..tensors {
        let distance = read_integer(&mut bytes).ok_or_else(|| {
            Error::malformed(format!("{place} cell {n}"), "a shortest LEB128 integer below 2^63", "another or none")
        })?;
        // Both are below 2^63.
        let number = next + distance;
        let cell = numbering.cell(number).ok_or_else(|| {
            let expected = format!("a number below {}", numbering.count());
            Error::malformed(format!("{place} cell {n}"), expected, number)
        })?;
        largest = largest.max(cell);
        cells.push(cell);
        next = number + 1;
    }
    Error::unless_equal(format!("{place} bytes after the cells"), 0, bytes.len())?;
    Error::unless_equal(format!("{place} extent"), largest + 1, extent)?;
    Ok(cells)
}

/// The numbers of the cells of a box from cell 0 to below this one, whose edges are within the limits.
struct Numbering(UVec3);

impl Numbering {
    fn count(&self) -> u64 {
        self.0.to_array().iter().map(|&e| u64::from(e)).product()
    }

    fn number(&self, cell: UVec3) -> u64 {
        let [x, y, z] = cell.to_array().map(u64::from);
        (z * u64::from(self.0.y) + y) * u64::from(self.0.x) + x
    }

    fn cell(&self, number: u64) -> Option<UVec3> {
        let (row, x) = (number / u64::from(self.0.x), number % u64::from(self.0.x));
        let (z, y) = (row / u64::from(self.0.y), row % u64::from(self.0.y));
        (number < self.count()).then(|| UVec3::new(x as u32, y as u32, z as u32))
    }
}

/// Seven bits a byte, least significant first, the high bit set on all but the last.
fn write_integer(bytes: &mut Vec<u8>, mut value: u64) {
    while value >= 0x80 {
        bytes.push(value as u8 | 0x80);
        value >>= 7;
    }
    bytes.push(value as u8);
}

/// The integer at the start of `bytes`, which then begin after it; `None` where there is none of at most [`LONGEST`]
/// bytes or it could have been shorter.
fn read_integer(bytes: &mut &[u8]) -> Option<u64> {
    let length = 1 + bytes.iter().take(LONGEST as usize).position(|b| b & 0x80 == 0)?;
    let (integer, rest) = bytes.split_at(length);
    if length > 1 && integer[length - 1] == 0 {
        return None;
    }
    *bytes = rest;
    Some(integer.iter().rev().fold(0, |value, b| value << 7 | u64::from(b & 0x7F)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn integers_come_back_and_longer_spellings_do_not() {
        for value in [0, 1, 127, 128, 16_383, 16_384, (1 << 60) - 1, (1 << 63) - 1] {
            let mut bytes = Vec::new();
            write_integer(&mut bytes, value);
            let mut rest = bytes.as_slice();
            assert_eq!((read_integer(&mut rest), rest.len()), (Some(value), 0));
            assert_eq!(read_integer(&mut &bytes[..bytes.len() - 1]), None, "cut short");
        }
        assert_eq!(read_integer(&mut [0x81, 0x00].as_slice()), None, "1 in two bytes");
        assert_eq!(read_integer(&mut [0xFF; 10].as_slice()), None, "too long");
    }
}
