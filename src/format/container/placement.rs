//! PLACEMENT: the centers of a chunk's tensors (spec 3.9).
//!
//! On a lattice the cells that a chunk occupies are numbered x fastest, z slowest, within the smallest extent from cell
//! 0 that holds all cells of the scale. The first number, and then each number's distance to its predecessor, less one,
//! are written as LEB128 integers. Explicit centers are written as f64.

use glam::{DVec3, UVec3};

use super::error::Error;
use super::limits::Budget;
use super::payload::Payload;
use super::scale::{Shape, covered_by, extent_of};
use super::section::SectionKind;
use super::writer::{Compression, FinishedSection, SectionPlace};
use crate::digits::numbers;
use crate::geometry::{cell_at, index_of};
use crate::model::{Placement, TensorCloud};

/// Bytes of the longest LEB128 integer: numbers of cells are below 2^60.
const MAX_INTEGER: u64 = 9;

/// The centers of a chunk's tensors.
pub(super) enum Centers {
    Cells(Vec<UVec3>),
    Points(Vec<DVec3>),
}

pub(super) fn write(
    compression: Compression,
    index: u16,
    chunk: u32,
    cloud: &TensorCloud,
    tensors: &[u32],
) -> Result<FinishedSection, Error> {
    let mut body = Vec::new();
    match &cloud.placement {
        Placement::Lattice { cells, .. } => {
            let numbering = Numbering(extent_of(cells));
            // One past the previous cell's number.
            let mut next = 0;
            for &n in tensors {
                let number = numbering.number(cells[n as usize]);
                let distance = number.checked_sub(next);
                // The scene's check ensures ascending centers, and so ascending cells.
                let ascending = || Error::malformed("cells of PLACEMENT", "in ascending order", cells[n as usize]);
                write_integer(&mut body, distance.ok_or_else(ascending)?);
                next = number + 1;
            }
        }
        Placement::Explicit { centers } => {
            let coordinates = tensors.iter().flat_map(|&n| centers[n as usize].to_array());
            body.extend(coordinates.flat_map(f64::to_le_bytes));
        }
    }
    compression.finished(SectionPlace::in_chunk(SectionKind::Placement, index, chunk), Vec::new(), &body)
}

/// The centers of chunk `n`.
pub(super) fn read(payload: &Payload<'_>, shape: &Shape, n: usize, budget: &mut Budget) -> Result<Centers, Error> {
    let (name, chunk) = (payload.section, shape.chunks[n]);
    budget.spend(name, 24 * u64::from(chunk.tensors))?;
    let (centers, points) = if shape.record.placement == 0 {
        let cells = read_cells(payload, chunk.tensors, UVec3::from_array(shape.record.extent), budget)?;
        let lattice = shape.lattice();
        let points: Vec<DVec3> = cells.iter().map(|c| lattice.center(c.as_ivec3())).collect();
        (Centers::Cells(cells), points)
    } else {
        let bytes = payload.body()?.decode(24 * u64::from(chunk.tensors), budget)?;
        let coordinates: Vec<f64> = bytes.as_chunks().0.iter().map(|&b| f64::from_le_bytes(b)).collect();
        let points: Vec<DVec3> = coordinates.as_chunks().0.iter().map(|&c| DVec3::from_array(c)).collect();
        (Centers::Points(points.clone()), points)
    };
    if let Some(t) = points.iter().position(|p| !p.is_finite()) {
        let found = numbers(points[t].to_array());
        return Err(Error::invalid(format!("{name} center {t}"), "finite numbers", found));
    }
    Error::unless_equal(format!("box of {name}"), covered_by(points.into_iter(), shape.half_edge()), shape.covered(n))?;
    Ok(centers)
}

/// A scale's placement from those of its chunks, and \[chunk\]\[tensor\] the numbers of their tensors in it.
pub(super) fn merge(name: &str, shape: &Shape, chunks: Vec<Centers>) -> Result<(Placement, Vec<Vec<u32>>), Error> {
    let lattice = shape.lattice();
    let mut order: Vec<([f64; 3], u32, u32)> = Vec::new();
    for (c, chunk) in chunks.iter().enumerate() {
        let key = |p: DVec3| [p.z, p.y, p.x];
        match chunk {
            Centers::Cells(cells) => {
                order.extend(cells.iter().zip(0..).map(|(c_, n)| (key(lattice.center(c_.as_ivec3())), c as u32, n)));
            }
            Centers::Points(points) => order.extend(points.iter().zip(0..).map(|(&p, n)| (key(p), c as u32, n))),
        }
    }
    let ascends = |a: &[f64; 3], b: &[f64; 3]| a.iter().zip(b).map(|(a, b)| a.total_cmp(b)).find(|o| o.is_ne());
    order.sort_by(|a, b| ascends(&a.0, &b.0).unwrap_or(std::cmp::Ordering::Equal));
    let mut numbers: Vec<Vec<u32>> = chunks.iter().map(|chunk| vec![0; chunk.len()]).collect();
    for (number, &(_, c, n)) in order.iter().enumerate() {
        numbers[c as usize][n as usize] = number as u32;
    }
    if let Some(c) = numbers.iter().position(|numbers| !numbers.is_sorted()) {
        let place = format!("centers of PLACEMENT of chunk {c} of {name}");
        return Err(Error::malformed(place, "in ascending order", "another order"));
    }
    // With −0 equal to 0; the order above has −0 before 0.
    if let Some(pair) = order.windows(2).find(|pair| pair[0].0 >= pair[1].0) {
        let found = format!("{} after {}", backwards(pair[1].0), backwards(pair[0].0));
        return Err(Error::malformed(format!("centers of {name}"), "strictly ascending by z, y, x", found));
    }
    let placement = if shape.record.placement == 0 {
        let mut cells = vec![UVec3::ZERO; order.len()];
        for (&(_, c, n), cell) in order.iter().zip(&mut cells) {
            if let Centers::Cells(of_chunk) = &chunks[c as usize] {
                *cell = of_chunk[n as usize];
            }
        }
        Placement::Lattice { lattice, cells }
    } else {
        Placement::Explicit { centers: order.iter().map(|&([z, y, x], ..)| DVec3::new(x, y, z)).collect() }
    };
    Ok((placement, numbers))
}

/// A center of these z, y and x as text.
fn backwards([z, y, x]: [f64; 3]) -> String {
    numbers([x, y, z])
}

impl Centers {
    fn len(&self) -> usize {
        match self {
            Self::Cells(cells) => cells.len(),
            Self::Points(points) => points.len(),
        }
    }
}

fn read_cells(payload: &Payload<'_>, tensors: u32, extent: UVec3, budget: &mut Budget) -> Result<Vec<UVec3>, Error> {
    let place = payload.section;
    let body = payload.body()?;
    let length = body.length;
    let tensors = u64::from(tensors);
    if !(tensors..=MAX_INTEGER * tensors).contains(&length) {
        let expected = format!("{tensors} to {}", MAX_INTEGER * tensors);
        return Err(Error::malformed(format!("{place} number of bytes of cells"), expected, length));
    }
    let body = body.decode(length, budget)?;
    let numbering = Numbering(extent);
    let mut bytes = body.as_ref();
    let mut cells = Vec::with_capacity(tensors as usize);
    let mut next: u64 = 0;
    for n in 0..tensors {
        let distance = read_integer(&mut bytes).ok_or_else(|| {
            Error::malformed(format!("{place} cell {n}"), "a shortest LEB128 integer below 2^63", "none")
        })?;
        // Both are below 2^63.
        let number = next + distance;
        let cell = numbering.cell(number).ok_or_else(|| {
            let expected = format!("a number below {}", numbering.count());
            Error::malformed(format!("{place} cell {n}"), expected, number)
        })?;
        cells.push(cell);
        next = number + 1;
    }
    Error::unless_equal(format!("{place} number of bytes after the cells"), 0, bytes.len())?;
    Ok(cells)
}

/// The numbers of the cells of a box of this extent, which is within the limits.
struct Numbering(UVec3);

impl Numbering {
    fn count(&self) -> u64 {
        self.0.to_array().iter().map(|&e| u64::from(e)).product()
    }

    fn number(&self, cell: UVec3) -> u64 {
        index_of(cell, self.0)
    }

    fn cell(&self, number: u64) -> Option<UVec3> {
        (number < self.count()).then(|| cell_at(number, self.0))
    }
}

/// LEB128: seven bits in each byte, least significant first, the high bit set in all but the last.
fn write_integer(bytes: &mut Vec<u8>, mut value: u64) {
    while value >= 0x80 {
        bytes.push(value as u8 | 0x80);
        value >>= 7;
    }
    bytes.push(value as u8);
}

/// The integer at the start of `bytes`, which then begin after it; `None` if there is none of at most [`MAX_INTEGER`]
/// bytes, or if it could be shorter.
fn read_integer(bytes: &mut &[u8]) -> Option<u64> {
    let length = 1 + bytes.iter().take(MAX_INTEGER as usize).position(|b| b & 0x80 == 0)?;
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
