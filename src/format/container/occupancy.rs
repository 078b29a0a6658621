//! OCCUPANCY: one bit for each vertex of the occupancy grid (spec 3.6).

use std::fmt::Display;

use glam::{DVec3, UVec3};

use super::codec::adaptive;
use super::error::Error;
use super::limits::{self, Budget};
use super::payload::Payload;
use super::record::{self, BorrowDecode, Encode, Record};
use super::section::SectionKind;
use super::writer::{SectionPlace, Writer};
use crate::geometry::Aabb;
use crate::model::Occupancy;

#[derive(Encode, BorrowDecode)]
struct OccupancyRecord {
    bounds_min: [f64; 3],
    bounds_max: [f64; 3],
    vertices: [u32; 3],
}

impl Record for OccupancyRecord {
    fn check(&self, place: &dyn Display) -> Result<(), Error> {
        let bounds = self.bounds();
        if !bounds.is_solid() {
            return Err(Error::invalid(format!("{place} box"), "finite and of positive size", bounds));
        }
        for vertices in self.vertices {
            limits::check(format!("{place} vertices of an axis"), limits::OCCUPANCY_AXIS, vertices)?;
        }
        // At most 2^36 after the check above.
        let vertices = self.vertices.iter().map(|&v| u64::from(v)).product::<u64>();
        limits::check(format!("{place} vertices"), limits::OCCUPANCY_VERTICES, vertices)
    }
}

impl OccupancyRecord {
    fn bounds(&self) -> Aabb {
        Aabb { min: DVec3::from_array(self.bounds_min), max: DVec3::from_array(self.bounds_max) }
    }
}

pub(super) fn write(writer: &mut Writer, occupancy: &Occupancy) -> Result<(), Error> {
    let record = OccupancyRecord {
        bounds_min: occupancy.bounds.min.to_array(),
        bounds_max: occupancy.bounds.max.to_array(),
        vertices: occupancy.vertices.to_array(),
    };
    let record_bytes = record::write(&"OCCUPANCY", &record)?;
    let bits = occupancy.bytes();
    writer.adaptive(SectionPlace::whole(SectionKind::Occupancy), record_bytes, &bits, || {
        adaptive::compress_occupancy(record.vertices, &bits)
    })
}

pub(super) fn read(payload: &Payload<'_>, budget: &mut Budget) -> Result<Occupancy, Error> {
    let (record, body): (OccupancyRecord, _) = payload.record_and_body()?;
    let length = byte_count(record.vertices);
    budget.spend(payload.section, length + 8)?;
    let bits = body.decode_by(length, budget, |bytes, budget| {
        budget.spend(payload.section, adaptive::memory_of_occupancy(record.vertices))?;
        adaptive::decompress_occupancy(payload.section, record.vertices, bytes)
    })?;
    let used = record.vertices.iter().map(|&v| u64::from(v)).product::<u64>() % 8;
    if used != 0 && bits.last().is_some_and(|last| last >> used != 0) {
        return Err(Error::malformed("OCCUPANCY unused bits", "zeros", "a set bit past the last vertex"));
    }
    let words = bits.chunks(8).map(|bytes| {
        let mut word = [0; 8];
        word[..bytes.len()].copy_from_slice(bytes);
        u64::from_le_bytes(word)
    });
    Ok(Occupancy { bounds: record.bounds(), vertices: UVec3::from_array(record.vertices), words: words.collect() })
}

/// Bytes of one bit for each vertex; the numbers are within the limits, so their product is below 2^31.
fn byte_count(vertices: [u32; 3]) -> u64 {
    vertices.iter().map(|&v| u64::from(v)).product::<u64>().div_ceil(8)
}
