//! The fixed parts of a file as records, byte for byte as format-spec/v1.md tables them, and their limits.
//!
//! The one module that knows bincode: fields in order, little-endian, fixed width, no padding; a sequence or string
//! is preceded by its length as u64. Every record checks its own limits, on the way in and on the way out.

use std::fmt::Display;

use bincode::{BorrowDecode, Encode};

use super::{Error, limits};

const CONFIG: bincode::config::Configuration<
    bincode::config::LittleEndian,
    bincode::config::Fixint,
    bincode::config::Limit<{ limits::RECORD_BYTES }>,
> = bincode::config::standard().with_little_endian().with_fixed_int_encoding().with_limit::<{ limits::RECORD_BYTES }>();

/// A record with limits of its own.
pub(super) trait Limits {
    /// The first limit that the record at `place` exceeds.
    fn check(&self, place: &dyn Display) -> Result<(), Error>;
}

/// Reads the record at the start of `bytes`, within its limits; also returns the bytes that follow it.
pub(super) fn read<'a, T: BorrowDecode<'a, ()> + Limits>(
    place: &dyn Display,
    bytes: &'a [u8],
) -> Result<(T, &'a [u8]), Error> {
    use bincode::error::DecodeError;
    let (record, used): (T, usize) = bincode::borrow_decode_from_slice(bytes, CONFIG).map_err(|error| match error {
        DecodeError::UnexpectedEnd { additional } => {
            Error::malformed(place, format!("at least {additional} more bytes"), format!("{} bytes", bytes.len()))
        }
        DecodeError::LimitExceeded => {
            let found = "a length beyond them";
            Error::malformed(place, format!("at most {} bytes of record", limits::RECORD_BYTES), found)
        }
        DecodeError::Utf8 { inner } => Error::malformed(place, "UTF-8", inner),
        other => Error::malformed(place, "a record", other),
    })?;
    record.check(place)?;
    Ok((record, &bytes[used..]))
}

/// [`read`] of a record that is all there is.
pub(super) fn read_whole<'a, T: BorrowDecode<'a, ()> + Limits>(
    place: &dyn Display,
    bytes: &'a [u8],
) -> Result<T, Error> {
    let (record, rest) = read(place, bytes)?;
    Error::unless_equal(format!("{place} bytes after the record"), 0, rest.len())?;
    Ok(record)
}

/// The bytes of a record that is within its limits.
pub(super) fn write<T: Encode + Limits>(place: &dyn Display, record: &T) -> Result<Vec<u8>, Error> {
    record.check(place)?;
    bincode::encode_to_vec(record, CONFIG).map_err(|error| Error::malformed(place, "a record", error))
}

/// What follows the magic and the version's major number.
#[derive(Encode, BorrowDecode)]
pub(super) struct Header {
    pub(super) major: u16,
    pub(super) minor: u16,
    pub(super) sections: u32,
    pub(super) file_length: u64,
    pub(super) table_checksum: u32,
}

impl Limits for Header {
    fn check(&self, place: &dyn Display) -> Result<(), Error> {
        limits::check(format!("{place} section count"), limits::SECTIONS, self.sections)
    }
}

/// One entry of the section table.
#[derive(Encode, BorrowDecode)]
pub(super) struct Entry {
    pub(super) kind: [u8; 12],
    pub(super) flags: u16,
    pub(super) scale: u16,
    pub(super) codec: u16,
    pub(super) reserved: u16,
    pub(super) checksum: u32,
    pub(super) offset: u64,
    pub(super) length: u64,
    pub(super) decoded_length: u64,
}

impl Limits for Entry {
    fn check(&self, _: &dyn Display) -> Result<(), Error> {
        Ok(())
    }
}

/// FRAME.
#[derive(Encode, BorrowDecode)]
pub(super) struct Frame {
    pub(super) scale: f64,
    /// x, y, z, w.
    pub(super) rotation: [f64; 4],
    pub(super) translation: [f64; 3],
    /// All bits 0 where unknown.
    pub(super) metres_per_unit: f64,
    pub(super) near: f64,
    pub(super) far: f64,
    pub(super) background: [f32; 3],
    pub(super) up: u8,
    pub(super) color_space: u8,
}

impl Limits for Frame {
    fn check(&self, _: &dyn Display) -> Result<(), Error> {
        Ok(())
    }
}

/// RULES.
#[derive(Encode, BorrowDecode)]
pub(super) struct Rules {
    pub(super) scales: u16,
    pub(super) coverage: u8,
    pub(super) aggregation: u8,
    pub(super) density_reduction: u8,
    pub(super) appearance_reduction: u8,
    pub(super) bounds_min: [f64; 3],
    pub(super) bounds_max: [f64; 3],
    pub(super) density_shift: f64,
    pub(super) distance_scale: f64,
    pub(super) step: f64,
    pub(super) min_transmittance: f64,
    pub(super) min_weight: f64,
}

impl Limits for Rules {
    fn check(&self, place: &dyn Display) -> Result<(), Error> {
        limits::check(format!("{place} scales"), limits::SCALES, self.scales)
    }
}

/// PROVENANCE.
#[derive(Encode, BorrowDecode)]
pub(super) struct Provenance<'a> {
    pub(super) steps: u64,
    pub(super) seed: u64,
    pub(super) dataset: &'a str,
    pub(super) preset: &'a str,
    pub(super) tool: &'a str,
}

impl Limits for Provenance<'_> {
    fn check(&self, place: &dyn Display) -> Result<(), Error> {
        for (name, string) in [("dataset", self.dataset), ("preset", self.preset), ("tool", self.tool)] {
            limits::check(format!("{place} {name} bytes"), limits::STRING_BYTES, string.len())?;
        }
        Ok(())
    }
}

/// DECODER, before the weights.
#[derive(Encode, BorrowDecode)]
pub(super) struct Decoder {
    pub(super) mode: u8,
    pub(super) feature_frequencies: u32,
    pub(super) direction_frequencies: u32,
    pub(super) layers: Vec<Layer>,
}

/// The shape of a layer.
#[derive(Clone, Copy, Encode, BorrowDecode)]
pub(super) struct Layer {
    pub(super) inputs: u32,
    pub(super) outputs: u32,
}

impl Limits for Decoder {
    fn check(&self, place: &dyn Display) -> Result<(), Error> {
        limits::check(format!("{place} feature frequencies"), limits::FREQUENCIES, self.feature_frequencies)?;
        limits::check(format!("{place} direction frequencies"), limits::FREQUENCIES, self.direction_frequencies)?;
        limits::check(format!("{place} layers"), limits::LAYERS, self.layers.len())?;
        for (i, layer) in self.layers.iter().enumerate() {
            limits::check(format!("{place} layer {i} inputs"), limits::LAYER_WIDTH, layer.inputs)?;
            limits::check(format!("{place} layer {i} outputs"), limits::LAYER_WIDTH, layer.outputs)?;
        }
        Ok(())
    }
}

/// OCCUPANCY, before the bits.
#[derive(Encode, BorrowDecode)]
pub(super) struct Occupancy {
    pub(super) bounds_min: [f64; 3],
    pub(super) bounds_max: [f64; 3],
    pub(super) vertices: [u32; 3],
}

impl Limits for Occupancy {
    fn check(&self, place: &dyn Display) -> Result<(), Error> {
        for vertices in self.vertices {
            limits::check(format!("{place} vertices of an axis"), limits::OCCUPANCY_AXIS, vertices)?;
        }
        // At most 2^36 after the check above.
        let vertices = self.vertices.iter().map(|&v| u64::from(v)).product::<u64>();
        limits::check(format!("{place} vertices"), limits::OCCUPANCY_VERTICES, vertices)
    }
}

/// PLACEMENT, before what depends on the kind.
#[derive(Encode, BorrowDecode)]
pub(super) struct Placement {
    pub(super) kind: u8,
    pub(super) tensors: u32,
    pub(super) top_k: u32,
    pub(super) half: [f64; 3],
}

impl Limits for Placement {
    fn check(&self, place: &dyn Display) -> Result<(), Error> {
        limits::check(format!("{place} tensors"), limits::TENSORS, self.tensors)?;
        limits::check(format!("{place} top_k"), limits::TOP_K, self.top_k)
    }
}

/// What follows in PLACEMENT on a lattice, before the cells.
#[derive(Encode, BorrowDecode)]
pub(super) struct Lattice {
    pub(super) origin: [f64; 3],
    pub(super) pitch: [f64; 3],
    /// One more than the largest cell coordinate, per axis.
    pub(super) extent: [u32; 3],
}

impl Limits for Lattice {
    fn check(&self, place: &dyn Display) -> Result<(), Error> {
        self.extent
            .iter()
            .try_for_each(|&e| limits::check(format!("{place} cells along an axis"), limits::CELL_EXTENT, e))
    }
}

/// APPEARANCE, before the weights.
#[derive(Encode, BorrowDecode)]
pub(super) struct Appearance {
    pub(super) features: u32,
    pub(super) rank: u32,
}

impl Limits for Appearance {
    fn check(&self, place: &dyn Display) -> Result<(), Error> {
        limits::check(format!("{place} features"), limits::FEATURES, self.features)?;
        limits::check(format!("{place} rank"), limits::RANK, self.rank)
    }
}

/// FACTORS, before the values.
#[derive(Encode, BorrowDecode)]
pub(super) struct Factors {
    pub(super) kind: u8,
    pub(super) encoding: u8,
    pub(super) resolution: [u32; 3],
    pub(super) density_rank: u32,
    pub(super) appearance_rank: u32,
}

impl Limits for Factors {
    fn check(&self, place: &dyn Display) -> Result<(), Error> {
        for resolution in self.resolution {
            limits::check(format!("{place} resolution"), limits::RESOLUTION, resolution)?;
        }
        limits::check(format!("{place} density rank"), limits::RANK, self.density_rank)?;
        limits::check(format!("{place} appearance rank"), limits::RANK, self.appearance_rank)
    }
}
