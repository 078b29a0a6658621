//! A scan: its fields, its pose, and the map from records to points.

use e57::{PointCloud, Record, RecordDataType, RecordName, RecordValue};
use glam::{DMat3, DQuat, DVec3};

use super::packets::{self, NumberStream};
use super::pages::Pages;
use crate::input::bytes_at;
use crate::{Fault, Point, Visitor};

/// Fields of a scan.
const MAX_FIELDS: u64 = 255;

/// A field: its stream and the type of its numbers.
#[derive(Clone, Debug)]
struct FieldStream {
    stream: usize,
    kind: NumberKind,
}

#[derive(Clone, Copy, Debug)]
enum NumberKind {
    Single,
    Double,
    /// Stored as the difference from `min`.
    Integer {
        min: i64,
        scale: f64,
        offset: f64,
    },
}

impl FieldStream {
    fn of(record: &Record, stream: usize) -> Self {
        let kind = match record.data_type {
            RecordDataType::Single { .. } => NumberKind::Single,
            RecordDataType::Double { .. } => NumberKind::Double,
            RecordDataType::Integer { min, .. } => NumberKind::Integer { min, scale: 1.0, offset: 0.0 },
            RecordDataType::ScaledInteger { min, scale, offset, .. } => NumberKind::Integer { min, scale, offset },
        };
        Self { stream, kind }
    }

    fn value(&self, streams: &[NumberStream], at: usize) -> f64 {
        let number = streams[self.stream].number(at);
        match self.kind {
            NumberKind::Single => f32::from_bits(number as u32).into(),
            NumberKind::Double => f64::from_bits(number),
            NumberKind::Integer { min, scale, offset } => {
                (i128::from(number) + i128::from(min)) as f64 * scale + offset
            }
        }
    }
}

/// Bits of a number of the field `record`.
fn bits(record: &Record) -> u32 {
    match record.data_type {
        RecordDataType::Single { .. } => 32,
        RecordDataType::Double { .. } => 64,
        RecordDataType::Integer { min, max } | RecordDataType::ScaledInteger { min, max, .. } => {
            64 - max.wrapping_sub(min).cast_unsigned().leading_zeros()
        }
    }
}

/// A color channel, and its values for 0 and 255.
#[derive(Clone, Debug)]
struct Channel {
    field: FieldStream,
    min: f64,
    max: f64,
}

impl Channel {
    /// Takes the range from the scan's limits, else from the field's. Limits that are empty or exceed 16 bits are
    /// ignored, and without limits the numbers are bytes.
    fn of(record: &Record, stream: usize, limits: Option<(&RecordValue, &RecordValue)>) -> Self {
        let field = FieldStream::of(record, stream);
        let number = |value: &RecordValue| match (value, field.kind) {
            (RecordValue::Single(value), _) => f64::from(*value),
            (RecordValue::Double(value), _) => *value,
            (RecordValue::ScaledInteger(value), NumberKind::Integer { scale, offset, .. }) => {
                *value as f64 * scale + offset
            }
            (RecordValue::ScaledInteger(value) | RecordValue::Integer(value), _) => *value as f64,
        };
        let of_type = match record.data_type {
            RecordDataType::Single { min, max } => min.zip(max).map(|(min, max)| (min.into(), max.into())),
            RecordDataType::Double { min, max } => min.zip(max),
            RecordDataType::Integer { min, max } => Some((min as f64, max as f64)),
            RecordDataType::ScaledInteger { min, max, scale, offset } => {
                Some((min as f64 * scale + offset, max as f64 * scale + offset))
            }
        };
        let range = |(min, max): &(f64, f64)| max - min > 0.0 && max - min <= 65535.0;
        let limits = limits.map(|(min, max)| (number(min), number(max)));
        let (min, max) = limits.filter(range).or(of_type.filter(range)).unwrap_or((0.0, 255.0));
        Self { field, min, max }
    }

    fn byte(&self, streams: &[NumberStream], at: usize) -> u8 {
        // NaN becomes 0.
        (255.0 * (self.field.value(streams, at) - self.min) / (self.max - self.min)).round() as u8
    }
}

/// The parts of a scan that are read.
pub(super) struct ScanParts {
    place: String,
    pub(super) records: u64,
    offset: u64,
    /// Bits of each stream's numbers.
    bits: Vec<u32>,
    /// x, y and z, and their state.
    cartesian: Option<([FieldStream; 3], Option<FieldStream>)>,
    /// Range, azimuth and elevation, and their state.
    spherical: Option<([FieldStream; 3], Option<FieldStream>)>,
    color: Option<([Channel; 3], Option<FieldStream>)>,
    /// Map to the file's space: rotation, then translation.
    rotation: DMat3,
    translation: DVec3,
}

impl ScanParts {
    /// The scan that the XML section describes; `place` names it in errors.
    ///
    /// # Errors
    ///
    /// If it has no coordinates or an invalid pose.
    pub(super) fn new(described: &PointCloud, place: String) -> Result<Self, Fault> {
        let prototype = &described.prototype;
        Fault::unless_within(&format!("fields of {place}"), MAX_FIELDS, prototype.len() as u64)?;
        let bits: Vec<u32> = prototype.iter().map(bits).collect();
        if bits.iter().all(|bits| *bits == 0) {
            return Err(Fault::broken(place, "all numbers of every field are equal"));
        }
        let find = |name: &RecordName| prototype.iter().position(|record| record.name == *name);
        let field = |name: RecordName| find(&name).map(|at| FieldStream::of(&prototype[at], at));
        let all = |[a, b, c]: [RecordName; 3]| Some([field(a)?, field(b)?, field(c)?]);
        use RecordName as N;
        let cartesian = all([N::CartesianX, N::CartesianY, N::CartesianZ]);
        let spherical = all([N::SphericalRange, N::SphericalAzimuth, N::SphericalElevation]);
        if cartesian.is_none() && spherical.is_none() {
            return Err(Fault::broken(place, "it has neither Cartesian nor spherical coordinates"));
        }
        let limits = described.color_limits.as_ref();
        let channel = |name: N, limits: Option<(&RecordValue, &RecordValue)>| {
            find(&name).map(|at| Channel::of(&prototype[at], at, limits))
        };
        let color = || {
            Some([
                channel(N::ColorRed, limits.and_then(|l| l.red_min.as_ref().zip(l.red_max.as_ref())))?,
                channel(N::ColorGreen, limits.and_then(|l| l.green_min.as_ref().zip(l.green_max.as_ref())))?,
                channel(N::ColorBlue, limits.and_then(|l| l.blue_min.as_ref().zip(l.blue_max.as_ref())))?,
            ])
        };
        let pose = described.transform.clone().unwrap_or_default();
        let (rotation, translation) = (pose.rotation, pose.translation);
        let rotation = DQuat::from_xyzw(rotation.x, rotation.y, rotation.z, rotation.w);
        let translation = DVec3::new(translation.x, translation.y, translation.z);
        // Writers round, so a length of exactly 1 is not required.
        if !(0.99..1.01).contains(&rotation.length()) || !translation.is_finite() {
            let found = format!("rotation {rotation}, translation {translation}");
            return Err(Fault::malformed(place, "a pose of a unit quaternion and a finite translation", found));
        }
        Ok(Self {
            place,
            records: described.records,
            offset: described.file_offset,
            bits,
            cartesian: cartesian.map(|fields| (fields, field(N::CartesianInvalidState))),
            spherical: spherical.map(|fields| (fields, field(N::SphericalInvalidState))),
            color: color().map(|channels| (channels, field(N::IsColorInvalid))),
            rotation: DMat3::from_quat(rotation.normalize()),
            translation,
        })
    }

    /// Passes the points to `visitor`; `progress` receives the number of finished records.
    ///
    /// # Errors
    ///
    /// If there are fewer points than declared, a point is not finite, and those of `visitor`.
    pub(super) fn read(
        &self,
        pages: &mut Pages<'_, '_>,
        progress: &mut dyn FnMut(u64, &mut dyn Visitor) -> Result<(), Fault>,
        visitor: &mut dyn Visitor,
    ) -> Result<(), Fault> {
        if self.records == 0 {
            return Ok(());
        }
        let bits: u64 = self.bits.iter().map(|bits| u64::from(*bits)).sum();
        if self.records > pages.len() * 8 / bits {
            let expected = format!("at most {} records of {bits} bits", pages.len() * 8 / bits);
            return Err(Fault::malformed(&self.place, expected, self.records));
        }
        pages.go_to(self.offset, &self.place)?;
        let place = pages.place();
        let mut head = [0; 32];
        pages.fill(&mut head, "a scan's head")?;
        if head[0] != 1 {
            return Err(Fault::malformed(place, "a scan's head, of kind 1", head[0]));
        }
        pages.go_to(u64::from_le_bytes(bytes_at(&head, 16)), &self.place)?;
        let mut streams: Vec<NumberStream> = self.bits.iter().map(|bits| NumberStream::new(*bits)).collect();
        let mut done = 0;
        packets::read(pages, &mut streams, self.records, &mut |streams, count| {
            progress(done, visitor)?;
            for at in 0..count {
                if let Some(position) = self.position(streams, at) {
                    let color = self.color(streams, at);
                    let place = || format!("{}, point {}", self.place, done + at as u64);
                    let placed = Point::new(position, color, place).and_then(|Point { position, color }| {
                        Point::new(self.rotation * position + self.translation, color, place)
                    });
                    Point::pass(placed, visitor)?;
                }
            }
            done += count as u64;
            Ok(())
        })
    }

    /// Position of point `at` in the scan's space; `None` in state 1 (a direction) and 2 (invalid).
    fn position(&self, streams: &[NumberStream], at: usize) -> Option<DVec3> {
        let valid = |fields: &Option<([FieldStream; 3], Option<FieldStream>)>| {
            let (fields, state) = fields.as_ref()?;
            let valid = state.as_ref().is_none_or(|state| state.value(streams, at) == 0.0);
            valid.then(|| fields.each_ref().map(|field| field.value(streams, at)))
        };
        if let Some(position) = valid(&self.cartesian) {
            return Some(DVec3::from_array(position));
        }
        let [range, azimuth, elevation] = valid(&self.spherical)?;
        let flat = range * elevation.cos();
        Some(DVec3::new(flat * azimuth.cos(), flat * azimuth.sin(), range * elevation.sin()))
    }

    fn color(&self, streams: &[NumberStream], at: usize) -> Option<[u8; 3]> {
        let (channels, invalid) = self.color.as_ref()?;
        let valid = invalid.as_ref().is_none_or(|invalid| invalid.value(streams, at) == 0.0);
        valid.then(|| channels.each_ref().map(|channel| channel.byte(streams, at)))
    }
}
