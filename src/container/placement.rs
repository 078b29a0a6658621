//! SCALE and PLACEMENT: a scale's shape, its chunks, and where each chunk's tensors are.
//!
//! On a lattice the cells that a chunk occupies are numbered x fastest, z slowest, within the smallest extent from cell 0
//! that holds all cells of the scale; the first number and then each number's distance to its predecessor, less one, are
//! written as LEB128 integers. Elsewhere the centers are written as they are.

use glam::{DVec3, UVec3};

use super::limits::Budget;
use super::payload::Payload;
use super::section::SectionKind;
use super::writer::{Finished, Place, Writer};
use super::{Error, records};
use crate::geometry::{Aabb, Lattice};
use crate::model::{FactorKind, Placement, Scale, TensorCloud};

/// Bytes of the longest LEB128 integer: numbers of cells are below 2^60.
const LONGEST: u64 = 9;
/// Bytes of what SCALE says of a chunk.
const CHUNK_BYTES: usize = 52;

/// What SCALE says.
pub(super) struct Shape {
    pub(super) record: records::Scale,
    pub(super) chunks: Vec<records::Chunk>,
}

impl Shape {
    /// Half edges.
    pub(super) fn half(&self) -> DVec3 {
        DVec3::from_array(self.record.half)
    }

    /// What chunk `n` covers.
    pub(super) fn covered(&self, n: usize) -> Aabb {
        let [min, max] = [self.chunks[n].covered_min, self.chunks[n].covered_max].map(DVec3::from_array);
        Aabb { min, max }
    }

    fn lattice(&self) -> Lattice {
        Lattice { origin: DVec3::from_array(self.record.origin), pitch: DVec3::from_array(self.record.pitch) }
    }
}

/// The centers of a chunk's tensors.
pub(super) enum Centers {
    Cells(Vec<UVec3>),
    Points(Vec<DVec3>),
}

/// Cuts `cloud` into chunks of at most `most` tensors that lie near each other; each holds its tensors' numbers,
/// ascending.
pub(super) fn chunks_of(cloud: &TensorCloud, most: usize) -> Vec<Vec<u32>> {
    let bounds = cloud.bounds();
    let size = bounds.size().max(DVec3::splat(f64::MIN_POSITIVE));
    let key = |n: u32| {
        let at = ((cloud.center(n as usize) - bounds.min) / size * 1023.0).as_uvec3().min(UVec3::splat(1023));
        let spread = |v: u32| (0..10).fold(0u32, |bits, b| bits | (v >> b & 1) << (3 * b));
        spread(at.x) | spread(at.y) << 1 | spread(at.z) << 2
    };
    let mut order: Vec<(u32, u32)> = (0..cloud.len() as u32).map(|n| (key(n), n)).collect();
    order.sort_unstable();
    let count = cloud.len().div_ceil(most.max(1));
    let each = cloud.len().div_ceil(count.max(1)).max(1);
    let mut chunks: Vec<Vec<u32>> = order.chunks(each).map(|part| part.iter().map(|o| o.1).collect()).collect();
    chunks.iter_mut().for_each(|chunk| chunk.sort_unstable());
    chunks
}

pub(super) fn write_scale(writer: &mut Writer, index: u16, scale: &Scale, chunks: &[Vec<u32>]) -> Result<(), Error> {
    let name = format!("SCALE of scale {index}");
    let cloud = &scale.cloud;
    let (placement, lattice, extent) = match &cloud.placement {
        Placement::Lattice { lattice, cells } => (0, *lattice, extent_of(cells)),
        Placement::Explicit { .. } => (1, Lattice { origin: DVec3::ZERO, pitch: DVec3::ZERO }, UVec3::ZERO),
    };
    let record = records::Scale {
        tensors: cloud.len().try_into().unwrap_or(u32::MAX),
        top_k: scale.top_k,
        half: cloud.half.to_array(),
        resolution: cloud.resolution,
        factor_kind: match scale.factors.kind {
            FactorKind::Cp => 0,
            FactorKind::Vm => 1,
        },
        placement,
        reserved: 0,
        density_rank: scale.factors.density_rank,
        appearance_rank: scale.factors.appearance_rank,
        chunks: chunks.len().try_into().unwrap_or(u32::MAX),
        reserved_too: 0,
        origin: lattice.origin.to_array(),
        pitch: lattice.pitch.to_array(),
        extent: extent.to_array(),
    };
    let mut body = Vec::new();
    for tensors in chunks {
        let covered = covered_by(tensors.iter().map(|&n| cloud.center(n as usize)), cloud.half);
        let chunk = records::Chunk {
            tensors: tensors.len().try_into().unwrap_or(u32::MAX),
            covered_min: covered.min.to_array(),
            covered_max: covered.max.to_array(),
        };
        body.extend(records::write(&name, &chunk)?);
    }
    writer.compressed(Place::of_scale(SectionKind::Scale, index), records::write(&name, &record)?, &body)
}

pub(super) fn read_scale(payload: &Payload<'_>, budget: &mut Budget) -> Result<Shape, Error> {
    let name = payload.section;
    let (record, body): (records::Scale, _) = payload.record_and_body()?;
    match record.factor_kind {
        0 => {}
        1 => return Err(Error::unsupported(format!("{name} factor kind"), "vm")),
        code => return Err(Error::unsupported(format!("{name} factor kind"), format!("code {code}"))),
    }
    if record.placement > 1 {
        return Err(Error::unsupported(format!("{name} placement"), format!("code {}", record.placement)));
    }
    Error::unless_equal(format!("{name} reserved fields"), 0, u32::from(record.reserved) | record.reserved_too)?;
    if record.placement == 1 {
        let of_lattice = record.origin.iter().chain(&record.pitch).map(|v| v.to_bits());
        Error::unless_equal(format!("{name} lattice of explicit centers"), 0, of_lattice.fold(0, |bits, v| bits | v))?;
    }
    let length = u64::from(record.chunks) * CHUNK_BYTES as u64;
    budget.spend(name, length)?;
    let bytes = body.decode(length, budget)?;
    let mut tensors = 0;
    let mut chunks = Vec::with_capacity(record.chunks as usize);
    for (n, chunk) in bytes.chunks_exact(CHUNK_BYTES).enumerate() {
        let chunk: records::Chunk = records::read_whole(&format!("{name} chunk {n}"), chunk)?;
        tensors += u64::from(chunk.tensors);
        chunks.push(chunk);
    }
    Error::unless_equal(format!("{name} tensors of all chunks"), u64::from(record.tensors), tensors)?;
    Ok(Shape { record, chunks })
}

pub(super) fn write(
    writer: &Writer,
    index: u16,
    chunk: u32,
    cloud: &TensorCloud,
    tensors: &[u32],
) -> Result<Finished, Error> {
    let mut body = Vec::new();
    match &cloud.placement {
        Placement::Lattice { cells, .. } => {
            let numbering = Numbering(extent_of(cells));
            // One past the previous cell's number.
            let mut next = 0;
            for &n in tensors {
                let number = numbering.number(cells[n as usize]);
                let distance = number.checked_sub(next);
                // Ascending centers, which the scene's check saw, are ascending cells.
                let ascending = || Error::malformed("PLACEMENT", "ascending cells", cells[n as usize]);
                write_integer(&mut body, distance.ok_or_else(ascending)?);
                next = number + 1;
            }
        }
        Placement::Explicit { centers } => {
            let coordinates = tensors.iter().flat_map(|&n| centers[n as usize].to_array());
            body.extend(coordinates.flat_map(f64::to_le_bytes));
        }
    }
    writer.finished(Place::of_chunk(SectionKind::Placement, index, chunk), Vec::new(), &body)
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
    let covered = covered_by(points.iter().copied(), shape.half());
    let (found, said) = (format!("{covered:?}"), format!("{:?}", shape.covered(n)));
    Error::unless_equal(format!("{name}: what it covers"), said, found)?;
    Ok(centers)
}

/// A scale's placement from those of its chunks, and where each chunk's tensors are in it.
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
    let mut places: Vec<Vec<u32>> = chunks.iter().map(|chunk| vec![0; chunk.len()]).collect();
    for (place, &(_, c, n)) in order.iter().enumerate() {
        places[c as usize][n as usize] = place as u32;
    }
    for (c, places) in places.iter().enumerate() {
        if !places.is_sorted() {
            return Err(Error::malformed(format!("PLACEMENT of chunk {c} of {name}"), "ascending centers", "others"));
        }
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
    Ok((placement, places))
}

/// Checks that `placement`, which is of all chunks, fills the extent that SCALE says.
pub(super) fn check_extent(name: &str, shape: &Shape, placement: &Placement) -> Result<(), Error> {
    let Placement::Lattice { cells, .. } = placement else { return Ok(()) };
    Error::unless_equal(format!("{name} extent"), extent_of(cells), UVec3::from_array(shape.record.extent))
}

impl Centers {
    fn len(&self) -> usize {
        match self {
            Self::Cells(cells) => cells.len(),
            Self::Points(points) => points.len(),
        }
    }
}

fn covered_by(centers: impl Iterator<Item = DVec3>, half: DVec3) -> Aabb {
    let centers = Aabb::from_points(centers);
    Aabb { min: centers.min - half, max: centers.max + half }
}

/// One more than the largest coordinates.
fn extent_of(cells: &[UVec3]) -> UVec3 {
    cells.iter().fold(UVec3::ZERO, |largest, cell| largest.max(*cell)).saturating_add(UVec3::ONE)
}

fn read_cells(payload: &Payload<'_>, tensors: u32, extent: UVec3, budget: &mut Budget) -> Result<Vec<UVec3>, Error> {
    let place = payload.section;
    let body = payload.body()?;
    let length = body.length;
    let tensors = u64::from(tensors);
    if !(tensors..=LONGEST * tensors).contains(&length) {
        let expected = format!("{tensors} to {}", LONGEST * tensors);
        return Err(Error::malformed(format!("{place} bytes of cells"), expected, length));
    }
    let body = body.decode(length, budget)?;
    let numbering = Numbering(extent);
    let mut bytes = body.as_ref();
    let mut cells = Vec::with_capacity(tensors as usize);
    let mut next: u64 = 0;
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
        cells.push(cell);
        next = number + 1;
    }
    Error::unless_equal(format!("{place} bytes after the cells"), 0, bytes.len())?;
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
