//! FACTORS: a scale's vectors, in single or half precision.

use half::f16;

use super::cursor::Payload;
use super::section::SectionKind;
use super::writer::Writer;
use super::{Error, floats, records};
use crate::model::{FactorKind, Factors, Scale};

/// How factors are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FactorEncoding {
    /// As they are.
    F32,
    /// Rounded to half precision, to nearest, ties to even: a relative error of at most 2^-11 down to 6.1e-5, an
    /// absolute one of at most 3e-8 below. A factor that would round to infinity is an error.
    F16,
}

impl FactorEncoding {
    fn code(self) -> u8 {
        match self {
            Self::F32 => 0,
            Self::F16 => 1,
        }
    }

    fn of_code(place: impl std::fmt::Display, code: u8) -> Result<Self, Error> {
        match code {
            0 => Ok(Self::F32),
            1 => Ok(Self::F16),
            code => Err(Error::unsupported(format!("{place} encoding"), format!("code {code}"))),
        }
    }

    fn bytes_per_value(self) -> u64 {
        match self {
            Self::F32 => 4,
            Self::F16 => 2,
        }
    }

    fn read(self, bytes: &[u8]) -> Vec<f32> {
        match self {
            Self::F32 => floats::read(bytes),
            Self::F16 => bytes.as_chunks().0.iter().map(|&b| f16::from_le_bytes(b).to_f32()).collect(),
        }
    }

    fn write(self, place: &str, values: &[f32]) -> Result<Vec<u8>, Error> {
        if self == Self::F32 {
            return Ok(floats::write(values).collect());
        }
        let mut bytes = Vec::with_capacity(2 * values.len());
        for (i, &value) in values.iter().enumerate() {
            let half = f16::from_f32(value);
            if half.is_infinite() {
                return Err(Error::HalfOverflow { place: format!("{place} entry {i}"), value });
            }
            bytes.extend(half.to_le_bytes());
        }
        Ok(bytes)
    }
}

pub(super) fn write(writer: &mut Writer, index: u16, scale: &Scale, encoding: FactorEncoding) -> Result<(), Error> {
    let factors = &scale.factors;
    let place = format!("FACTORS of scale {index}");
    let record = records::Factors {
        kind: match factors.kind {
            FactorKind::Cp => 0,
            FactorKind::Vm => 1,
        },
        encoding: encoding.code(),
        resolution: scale.cloud.resolution,
        density_rank: factors.density_rank,
        appearance_rank: factors.appearance_rank,
    };
    let record = records::write(&place, &record)?;
    let mut body = encoding.write(&format!("{place} density"), &factors.density)?;
    body.extend(encoding.write(&format!("{place} appearance"), &factors.appearance)?);
    writer.compressed(SectionKind::Factors, Some(index), record, &body)
}

/// The resolution and the factors of `tensors` tensors.
pub(super) fn read(payload: &Payload<'_>, tensors: u32) -> Result<([u32; 3], Factors), Error> {
    let (record, stored): (records::Factors, _) = records::read(payload.section, payload.encoded())?;
    if record.kind != 0 {
        let found = if record.kind == 1 { "vm".into() } else { format!("code {}", record.kind) };
        return Err(Error::unsupported(format!("{} kind", payload.section), found));
    }
    let encoding = FactorEncoding::of_code(payload.section, record.encoding)?;
    // Within the limits: 2^24 tensors, 2^12 rows, 2^9 components, 2^2 bytes.
    let rows = Factors::rows(record.resolution) as u64;
    let bytes = |rank: u32| u64::from(tensors) * rows * u64::from(rank) * encoding.bytes_per_value();
    let (density, appearance) = (bytes(record.density_rank), bytes(record.appearance_rank));
    let body = payload.body(stored, density + appearance)?;
    let (density, appearance) = body.split_at(density as usize);
    let factors = Factors {
        kind: FactorKind::Cp,
        density_rank: record.density_rank,
        appearance_rank: record.appearance_rank,
        density: encoding.read(density),
        appearance: encoding.read(appearance),
    };
    Ok((record.resolution, factors))
}
