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
    pub(super) file_checksum: u32,
    pub(super) reserved: [u8; 28],
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
    pub(super) chunk: u32,
    pub(super) codec: u16,
    pub(super) reserved: u16,
    pub(super) checksum: u32,
    pub(super) reserved_too: u32,
    pub(super) offset: u64,
    pub(super) length: u64,
    pub(super) decoded_length: u64,
    pub(super) reserved_last: u64,
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
    pub(super) meters_per_unit: f64,
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
    pub(super) contraction: u8,
    pub(super) reserved: u8,
    pub(super) bounds_min: [f64; 3],
    pub(super) bounds_max: [f64; 3],
    pub(super) density_shift: f64,
    pub(super) distance_scale: f64,
    pub(super) step: f64,
    pub(super) min_transmittance: f64,
    pub(super) min_weight: f64,
    /// All bits 0 where nothing is contracted.
    pub(super) contracted_length: f64,
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
    pub(super) head: ArrayHead,
}

/// How an array is written.
#[derive(Clone, Copy, Debug, PartialEq, Encode, BorrowDecode)]
pub(super) struct ArrayHead {
    pub(super) encoding: u8,
    pub(super) bits: u8,
    pub(super) filter: u8,
    pub(super) reserved: u8,
    /// No number differs by more from the writer's.
    pub(super) error: f32,
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

/// SCALE, before its chunks.
#[derive(Encode, BorrowDecode)]
pub(super) struct Scale {
    pub(super) tensors: u32,
    pub(super) top_k: u32,
    pub(super) half: [f64; 3],
    pub(super) resolution: [u32; 3],
    pub(super) factor_kind: u8,
    pub(super) placement: u8,
    pub(super) reserved: u16,
    pub(super) density_rank: u32,
    pub(super) appearance_rank: u32,
    pub(super) chunks: u32,
    pub(super) reserved_too: u32,
    /// Zeros where centers are explicit, like what follows.
    pub(super) origin: [f64; 3],
    pub(super) pitch: [f64; 3],
    /// One more than the largest cell coordinate, per axis.
    pub(super) extent: [u32; 3],
}

impl Limits for Scale {
    fn check(&self, place: &dyn Display) -> Result<(), Error> {
        limits::check(format!("{place} tensors"), limits::TENSORS, self.tensors)?;
        limits::check(format!("{place} top_k"), limits::TOP_K, self.top_k)?;
        for resolution in self.resolution {
            limits::check(format!("{place} resolution"), limits::RESOLUTION, resolution)?;
        }
        limits::check(format!("{place} density rank"), limits::RANK, self.density_rank)?;
        limits::check(format!("{place} appearance rank"), limits::RANK, self.appearance_rank)?;
        limits::check(format!("{place} chunks"), limits::CHUNKS, self.chunks)?;
        // Of centers that are explicit it is 0.
        let cells = if self.placement == 1 { 0..=0 } else { limits::CELL_EXTENT };
        self.extent.iter().try_for_each(|&e| limits::check(format!("{place} cells along an axis"), cells.clone(), e))
    }
}

/// What SCALE says of a chunk.
#[derive(Clone, Copy, Debug, PartialEq, Encode, BorrowDecode)]
pub(super) struct Chunk {
    pub(super) tensors: u32,
    pub(super) covered_min: [f64; 3],
    pub(super) covered_max: [f64; 3],
}

impl Limits for Chunk {
    fn check(&self, place: &dyn Display) -> Result<(), Error> {
        limits::check(format!("{place} tensors"), limits::TENSORS, self.tensors)
    }
}

/// MATRIX, before the weights.
#[derive(Encode, BorrowDecode)]
pub(super) struct Matrix {
    pub(super) features: u32,
    pub(super) rank: u32,
    pub(super) head: ArrayHead,
}

impl Limits for Matrix {
    fn check(&self, place: &dyn Display) -> Result<(), Error> {
        limits::check(format!("{place} features"), limits::FEATURES, self.features)?;
        limits::check(format!("{place} rank"), limits::RANK, self.rank)
    }
}

/// DENSITY or APPEARANCE, before masks and numbers.
#[derive(Encode, BorrowDecode)]
pub(super) struct Factors {
    /// 1 where tensors have only some of the components.
    pub(super) is_ragged: u8,
    pub(super) reserved: [u8; 7],
    pub(super) head: ArrayHead,
}

impl Limits for Factors {
    fn check(&self, _: &dyn Display) -> Result<(), Error> {
        Ok(())
    }
}

/// PREFIX, before the matrices.
#[derive(Encode, BorrowDecode)]
pub(super) struct Prefix {
    pub(super) gain: f64,
    pub(super) offset: f64,
    pub(super) features: u32,
    pub(super) rank: u32,
    pub(super) head: ArrayHead,
}

impl Limits for Prefix {
    fn check(&self, place: &dyn Display) -> Result<(), Error> {
        limits::check(format!("{place} features"), limits::FEATURES, self.features)?;
        limits::check(format!("{place} sum of ranks"), limits::RANK_SUM, self.rank)
    }
}

/// A text that is all there is of something.
#[derive(Encode, BorrowDecode)]
pub(super) struct Text<'a> {
    pub(super) text: &'a str,
}

impl Limits for Text<'_> {
    fn check(&self, place: &dyn Display) -> Result<(), Error> {
        limits::check(format!("{place} bytes of text"), limits::TEXT_BYTES, self.text.len())
    }
}

/// QUALITY; all bits 1 where nothing was measured.
#[derive(Encode, BorrowDecode)]
pub(super) struct Quality<'a> {
    pub(super) encoded: f64,
    pub(super) test: f64,
    pub(super) test_before: f64,
    pub(super) prefixes: Vec<f64>,
    pub(super) dataset: &'a str,
}

impl Limits for Quality<'_> {
    fn check(&self, place: &dyn Display) -> Result<(), Error> {
        limits::check(format!("{place} prefixes"), 0..=*limits::SCALES.end(), self.prefixes.len())?;
        // All bits set is nothing, infinity is no error.
        let valid = |v: f64| v.to_bits() == u64::MAX || v > f64::NEG_INFINITY;
        for (name, values) in [
            ("PSNR against before", &[self.encoded][..]),
            ("PSNR of the test views", &[self.test, self.test_before]),
            ("PSNR of prefixes", &self.prefixes),
        ] {
            if let Some(found) = values.iter().find(|v| !valid(**v)) {
                return Err(Error::malformed(format!("{place} {name}"), "a number, infinity or nothing", found));
            }
        }
        limits::check(format!("{place} dataset bytes"), limits::STRING_BYTES, self.dataset.len())
    }
}

/// Where a camera is and how it is turned.
#[derive(Clone, Copy, Encode, BorrowDecode)]
pub(super) struct Pose {
    pub(super) position: [f64; 3],
    /// x, y, z, w.
    pub(super) rotation: [f64; 4],
}

/// VIEWS.
#[derive(Encode, BorrowDecode)]
pub(super) struct Views {
    pub(super) angle_of_view: f64,
    pub(super) first: Pose,
    pub(super) center: [f64; 3],
    pub(super) seconds: f64,
    pub(super) is_closed: u8,
    pub(super) path: Vec<Pose>,
}

impl Limits for Views {
    fn check(&self, place: &dyn Display) -> Result<(), Error> {
        limits::check(format!("{place} poses"), limits::ITEMS, self.path.len())
    }
}

/// THUMBNAIL, before the picture.
#[derive(Encode, BorrowDecode)]
pub(super) struct Thumbnail {
    pub(super) format: u8,
    pub(super) reserved: u8,
    pub(super) width: u16,
    pub(super) height: u16,
}

impl Limits for Thumbnail {
    fn check(&self, place: &dyn Display) -> Result<(), Error> {
        Error::unless_equal(format!("{place} reserved byte"), 0, self.reserved)
    }
}

/// PROBES, before them.
#[derive(Encode, BorrowDecode)]
pub(super) struct Probes {
    pub(super) color_tolerance: f64,
    pub(super) depth_tolerance: f64,
    pub(super) density_tolerance: f64,
    pub(super) count: u64,
}

impl Limits for Probes {
    fn check(&self, place: &dyn Display) -> Result<(), Error> {
        let valid = |v: f64| v > 0.0 && v.is_finite();
        for tolerance in [self.color_tolerance, self.depth_tolerance, self.density_tolerance] {
            if !valid(tolerance) {
                return Err(Error::malformed(format!("{place} tolerance"), "a positive number", tolerance));
            }
        }
        Ok(())
    }
}

/// A ray with what it sees, and a point with its density.
#[derive(Clone, Copy, Debug, PartialEq, Encode, BorrowDecode)]
pub struct Probe {
    /// In model units.
    pub origin: [f64; 3],
    /// Of length 1.
    pub direction: [f64; 3],
    /// Of the pixel.
    pub color: [f64; 3],
    /// 1 − T.
    pub opacity: f64,
    /// Σ w·t/Σ w.
    pub depth: f64,
    /// In model units.
    pub point: [f64; 3],
    /// The density feature there.
    pub density_feature: f64,
    /// The smallest along the ray, in model units.
    pub margin: f64,
    /// Zeros.
    pub reserved: [u64; 2],
}

impl Limits for Probe {
    fn check(&self, place: &dyn Display) -> Result<(), Error> {
        let numbers = [self.origin, self.direction, self.color, self.point].into_iter().flatten();
        let finite = numbers.chain([self.opacity, self.depth, self.density_feature, self.margin]).all(f64::is_finite);
        let length = self.direction.iter().map(|v| v * v).sum::<f64>().sqrt();
        if finite && (length - 1.0).abs() <= 1e-6 {
            return Ok(());
        }
        Err(Error::malformed(place, "finite numbers and a direction of length 1", format!("{self:?}")))
    }
}

/// How many items follow.
#[derive(Encode, BorrowDecode)]
pub(super) struct Count {
    pub(super) count: u64,
}

impl Limits for Count {
    fn check(&self, _: &dyn Display) -> Result<(), Error> {
        Ok(())
    }
}

/// A camera of CAMERAS.
#[derive(Encode, BorrowDecode)]
pub(super) struct TrainingCamera {
    pub(super) pose: Pose,
    pub(super) focal: [f64; 2],
    pub(super) principal: [f64; 2],
    pub(super) size: [u32; 2],
}

impl Limits for TrainingCamera {
    fn check(&self, place: &dyn Display) -> Result<(), Error> {
        let finite = self.focal.iter().chain(&self.principal).all(|v| v.is_finite());
        if finite && self.focal.iter().all(|&f| f > 0.0) && self.size.iter().all(|&s| s > 0) {
            return Ok(());
        }
        let found = format!("{:?}, {:?}, {:?}", self.focal, self.principal, self.size);
        Err(Error::malformed(place, "positive focal lengths and sizes, finite principal point", found))
    }
}
