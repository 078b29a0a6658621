//! SCALE: the shape of a scale, its chunks, and the box that each chunk covers (spec 3.7).

use std::fmt::Display;

use glam::{DVec3, UVec3};

use super::error::Error;
use super::limits::{self, Budget};
use super::payload::Payload;
use super::record::{self, BorrowDecode, Encode, Optional, Record};
use super::section::SectionKind;
use super::writer::{SectionPlace, Writer};
use crate::digits::numbers;
use crate::geometry::{Aabb, Lattice};
use crate::model::{Block, Form, Placement, Scale};

/// Bytes of a chunk's entry in the body.
const CHUNK_BYTES: usize = 52;

#[derive(Encode, BorrowDecode)]
pub(super) struct ScaleRecord {
    pub(super) tensors: u32,
    pub(super) top_k: u32,
    pub(super) half_edge: [f64; 3],
    pub(super) resolution: [u32; 3],
    pub(super) factor_kind: u8,
    pub(super) placement: u8,
    pub(super) reserved: u16,
    pub(super) density_rank: u32,
    pub(super) appearance_rank: u32,
    pub(super) chunks: u32,
    pub(super) reserved_too: u32,
    /// Zeros if centers are explicit, like the fields that follow.
    pub(super) origin: [f64; 3],
    pub(super) pitch: [f64; 3],
    /// One more than the largest cell coordinate, per axis.
    pub(super) extent: [u32; 3],
}

/// The components along each axis, of the factor kind vm.
#[derive(Clone, Copy, Debug, PartialEq, Encode, BorrowDecode)]
pub(super) struct AxisRanks {
    density: [u32; 3],
    appearance: [u32; 3],
}

/// The record of SCALE.
pub(super) type WholeRecord = Optional<ScaleRecord, AxisRanks>;

impl record::HasMore for ScaleRecord {
    fn has_more(&self) -> bool {
        self.factor_kind == 1
    }
}

impl Record for WholeRecord {
    fn check(&self, place: &dyn Display) -> Result<(), Error> {
        let Self { first, more } = self;
        first.check(place)?;
        let Some(AxisRanks { density, appearance }) = more else { return Ok(()) };
        for (name, rank, of_axes) in
            [("density", first.density_rank, density), ("appearance", first.appearance_rank, appearance)]
        {
            let sum: u64 = of_axes.iter().map(|&rank| u64::from(rank)).sum();
            Error::unless_equal(format!("{place} {name} components along all axes"), u64::from(rank), sum)?;
        }
        Ok(())
    }
}

impl Record for ScaleRecord {
    fn check(&self, place: &dyn Display) -> Result<(), Error> {
        for (field, code, most) in [("factor kind", self.factor_kind, 1), ("placement", self.placement, 1)] {
            if code > most {
                return Err(Error::unknown_code(place, field, code));
            }
        }
        let reserved = [&self.reserved.to_le_bytes()[..], &self.reserved_too.to_le_bytes()].concat();
        Error::unless_reserved(place, &reserved)?;
        limits::check(format!("{place} tensors"), limits::TENSORS, self.tensors)?;
        limits::check(format!("{place} top_k"), limits::TOP_K, self.top_k)?;
        positive(&format!("{place} half edges"), self.half_edge)?;
        for resolution in self.resolution {
            limits::check(format!("{place} resolution"), limits::RESOLUTION, resolution)?;
        }
        limits::check(format!("{place} density rank"), limits::RANK, self.density_rank)?;
        limits::check(format!("{place} appearance rank"), limits::RANK, self.appearance_rank)?;
        limits::check(format!("{place} chunks"), limits::CHUNKS, self.chunks)?;
        if self.placement == 1 {
            let has_lattice = self.origin.iter().chain(&self.pitch).any(|v| v.to_bits() != 0) || self.extent != [0; 3];
            if has_lattice {
                let place = format!("{place} origin, pitch and extent");
                return Err(Error::malformed(place, "zeros, as centers are explicit", "another number"));
            }
            return Ok(());
        }
        if self.origin.iter().any(|v| !v.is_finite()) {
            return Err(Error::invalid(format!("{place} origin"), "finite numbers", numbers(self.origin)));
        }
        positive(&format!("{place} pitch"), self.pitch)?;
        self.extent
            .iter()
            .try_for_each(|&e| limits::check(format!("{place} cells along an axis"), limits::CELL_EXTENT, e))
    }
}

/// [`Error::Scene`] unless `lengths` are positive and finite.
fn positive(place: &str, lengths: [f64; 3]) -> Result<(), Error> {
    if lengths.iter().all(|v| v.is_finite() && *v > 0.0) {
        return Ok(());
    }
    Err(Error::invalid(place, "positive finite numbers", numbers(lengths)))
}

/// An entry of the body of SCALE: a chunk.
#[derive(Clone, Copy, Debug, PartialEq, Encode, BorrowDecode)]
pub(super) struct ChunkRecord {
    pub(super) tensors: u32,
    pub(super) covered_min: [f64; 3],
    pub(super) covered_max: [f64; 3],
}

impl Record for ChunkRecord {
    fn check(&self, place: &dyn Display) -> Result<(), Error> {
        limits::check(format!("{place} tensors"), limits::TENSORS, self.tensors)
    }
}

/// SCALE: the shape of a scale and its chunks.
pub(super) struct Shape {
    pub(super) record: ScaleRecord,
    axis_ranks: Option<AxisRanks>,
    pub(super) chunks: Vec<ChunkRecord>,
}

impl Shape {
    /// The forms of density and of appearance components, each with its rank.
    pub(super) fn forms(&self) -> [Vec<(Form, u32)>; 2] {
        let Some(AxisRanks { density, appearance }) = self.axis_ranks else {
            return [self.record.density_rank, self.record.appearance_rank].map(|rank| vec![(Form::Cp, rank)]);
        };
        [density, appearance].map(|ranks| (0..3).map(|axis| (Form::Vm(axis), ranks[axis])).collect())
    }

    /// Half edges of the tensors, in model units.
    pub(super) fn half_edge(&self) -> DVec3 {
        DVec3::from_array(self.record.half_edge)
    }

    /// The box that chunk `n` covers.
    pub(super) fn covered(&self, n: usize) -> Aabb {
        let [min, max] = [self.chunks[n].covered_min, self.chunks[n].covered_max].map(DVec3::from_array);
        Aabb { min, max }
    }

    pub(super) fn lattice(&self) -> Lattice {
        Lattice { origin: DVec3::from_array(self.record.origin), pitch: DVec3::from_array(self.record.pitch) }
    }
}

/// The components of `scale` along each axis, if they are of the kind vm.
fn axis_ranks(scale: &Scale) -> Option<AxisRanks> {
    let of = |blocks: &[Block]| {
        let mut ranks = [0; 3];
        for block in blocks {
            match block.form {
                Form::Cp => return None,
                Form::Vm(axis) => ranks[axis] = block.rank,
            }
        }
        Some(ranks)
    };
    Some(AxisRanks { density: of(&scale.factors.density)?, appearance: of(&scale.factors.appearance)? })
}

pub(super) fn write(writer: &mut Writer, index: u16, scale: &Scale, chunks: &[Vec<u32>]) -> Result<(), Error> {
    let name = format!("SCALE of scale {index}");
    let cloud = &scale.cloud;
    let (placement, lattice, extent) = match &cloud.placement {
        Placement::Lattice { lattice, cells } => (0, *lattice, extent_of(cells)),
        Placement::Explicit { .. } => (1, Lattice { origin: DVec3::ZERO, pitch: DVec3::ZERO }, UVec3::ZERO),
    };
    let axis_ranks = axis_ranks(scale);
    let record = ScaleRecord {
        tensors: cloud.len().try_into().unwrap_or(u32::MAX),
        top_k: scale.top_k,
        half_edge: cloud.half_edge.to_array(),
        resolution: cloud.resolution,
        factor_kind: axis_ranks.is_some().into(),
        placement,
        reserved: 0,
        density_rank: scale.factors.density_rank(),
        appearance_rank: scale.factors.appearance_rank(),
        chunks: chunks.len().try_into().unwrap_or(u32::MAX),
        reserved_too: 0,
        origin: lattice.origin.to_array(),
        pitch: lattice.pitch.to_array(),
        extent: extent.to_array(),
    };
    let record = WholeRecord { first: record, more: axis_ranks };
    let mut body = Vec::new();
    for tensors in chunks {
        let covered = covered_by(tensors.iter().map(|&n| cloud.center(n as usize)), cloud.half_edge);
        let chunk = ChunkRecord {
            tensors: tensors.len().try_into().unwrap_or(u32::MAX),
            covered_min: covered.min.to_array(),
            covered_max: covered.max.to_array(),
        };
        body.extend(record::write(&name, &chunk)?);
    }
    writer.compressed(SectionPlace::in_scale(SectionKind::Scale, index), record::write(&name, &record)?, &body)
}

pub(super) fn read(payload: &Payload<'_>, budget: &mut Budget) -> Result<Shape, Error> {
    let name = payload.section;
    let (WholeRecord { first: record, more: axis_ranks }, body) = payload.record_and_body()?;
    let length = u64::from(record.chunks) * CHUNK_BYTES as u64;
    budget.spend(name, length)?;
    let bytes = body.decode(length, budget)?;
    let mut tensors = 0;
    let mut chunks = Vec::with_capacity(record.chunks as usize);
    for (n, chunk) in bytes.chunks_exact(CHUNK_BYTES).enumerate() {
        let chunk: ChunkRecord = record::read_whole(&format!("{name} chunk {n}"), chunk)?;
        tensors += u64::from(chunk.tensors);
        chunks.push(chunk);
    }
    Error::unless_equal(format!("{name} sum of the tensors of all chunks"), u64::from(record.tensors), tensors)?;
    Ok(Shape { record, axis_ranks, chunks })
}

/// Checks that `placement`, of all chunks, fills the extent of SCALE.
pub(super) fn check_extent(name: &str, shape: &Shape, placement: &Placement) -> Result<(), Error> {
    let Placement::Lattice { cells, .. } = placement else { return Ok(()) };
    Error::unless_equal(format!("{name} extent"), extent_of(cells), UVec3::from_array(shape.record.extent))
}

/// The box that tensors with these centers cover.
pub(super) fn covered_by(centers: impl Iterator<Item = DVec3>, half_edge: DVec3) -> Aabb {
    let centers = Aabb::from_points(centers);
    Aabb { min: centers.min - half_edge, max: centers.max + half_edge }
}

/// One more than the largest coordinates.
pub(super) fn extent_of(cells: &[UVec3]) -> UVec3 {
    cells.iter().fold(UVec3::ZERO, |largest, cell| largest.max(*cell)).saturating_add(UVec3::ONE)
}
