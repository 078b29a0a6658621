//! FRAME: the map from dataset space to model space, and how pictures are meant (spec 3.1).

use glam::{DQuat, DVec3};

use super::error::Error;
use super::payload::Payload;
use super::record::{self, BorrowDecode, Encode, Record};
use crate::geometry::Similarity;
use crate::model::{ColorSpace, Frame, UpAxis};

#[derive(Encode, BorrowDecode)]
struct FrameRecord {
    scale: f64,
    /// x, y, z, w.
    rotation: [f64; 4],
    translation: [f64; 3],
    /// All bits 0 if unknown.
    meters_per_unit: f64,
    near: f64,
    far: f64,
    background: [f32; 3],
    up: u8,
    color_space: u8,
}

impl Record for FrameRecord {}

pub(super) fn write(frame: &Frame) -> Result<Vec<u8>, Error> {
    let record = FrameRecord {
        scale: frame.model_from_dataset.scale,
        rotation: frame.model_from_dataset.rotation.to_array(),
        translation: frame.model_from_dataset.translation.to_array(),
        // A known one is positive.
        meters_per_unit: frame.meters_per_unit.unwrap_or(0.0),
        near: frame.near,
        far: frame.far,
        background: frame.background,
        up: match frame.up {
            UpAxis::X => 0,
            UpAxis::Y => 1,
            UpAxis::Z => 2,
            UpAxis::MinusX => 3,
            UpAxis::MinusY => 4,
            UpAxis::MinusZ => 5,
        },
        color_space: match frame.color_space {
            ColorSpace::Srgb => 0,
        },
    };
    record::write(&"FRAME", &record)
}

pub(super) fn read(payload: &Payload<'_>) -> Result<Frame, Error> {
    let record: FrameRecord = payload.record()?;
    Ok(Frame {
        model_from_dataset: Similarity {
            scale: record.scale,
            rotation: DQuat::from_array(record.rotation),
            translation: DVec3::from_array(record.translation),
        },
        up: match record.up {
            0 => UpAxis::X,
            1 => UpAxis::Y,
            2 => UpAxis::Z,
            3 => UpAxis::MinusX,
            4 => UpAxis::MinusY,
            5 => UpAxis::MinusZ,
            code => return Err(Error::unsupported("FRAME up axis", format!("code {code}"))),
        },
        meters_per_unit: (record.meters_per_unit.to_bits() != 0).then_some(record.meters_per_unit),
        near: record.near,
        far: record.far,
        background: record.background,
        color_space: match record.color_space {
            0 => ColorSpace::Srgb,
            code => return Err(Error::unsupported("FRAME color space", format!("code {code}"))),
        },
    })
}
