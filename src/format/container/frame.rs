//! FRAME: the map from dataset space to model space, and how pictures are meant (spec 3.1).

use std::fmt::Display;

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

impl Record for FrameRecord {
    fn check(&self, place: &dyn Display) -> Result<(), Error> {
        self.up(place).and(self.color_space(place)).map(drop)
    }
}

impl FrameRecord {
    fn up(&self, place: &dyn Display) -> Result<UpAxis, Error> {
        match self.up {
            0 => Ok(UpAxis::X),
            1 => Ok(UpAxis::Y),
            2 => Ok(UpAxis::Z),
            3 => Ok(UpAxis::MinusX),
            4 => Ok(UpAxis::MinusY),
            5 => Ok(UpAxis::MinusZ),
            code => Err(Error::unknown_code(place, "up axis", code)),
        }
    }

    fn color_space(&self, place: &dyn Display) -> Result<ColorSpace, Error> {
        match self.color_space {
            0 => Ok(ColorSpace::Srgb),
            code => Err(Error::unknown_code(place, "color space", code)),
        }
    }
}

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
        up: record.up(payload.section)?,
        meters_per_unit: (record.meters_per_unit.to_bits() != 0).then_some(record.meters_per_unit),
        near: record.near,
        far: record.far,
        background: record.background,
        color_space: record.color_space(payload.section)?,
    })
}
