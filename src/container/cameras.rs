//! CAMERAS: the cameras of the training photographs (spec 3.17).

use std::fmt::Display;

use super::error::Error;
use super::limits::{self, Budget};
use super::payload::Payload;
use super::pose::{Pose, PoseRecord};
use super::record::{self, BorrowDecode, Count, Encode, Record};
use super::section::SectionKind;
use super::writer::{Place, Writer};
use crate::geometry::Camera;

/// Bytes of a camera.
const CAMERA_BYTES: usize = 96;

/// A camera that a scene was trained from, in model space.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct TrainingCamera {
    /// In model units.
    pub pose: Pose,
    /// Focal lengths in pixels, along columns and rows.
    pub focal: [f64; 2],
    /// Principal point in pixels from the top left corner of the photograph.
    pub principal: [f64; 2],
    /// Columns and rows of the photograph.
    pub size: [u32; 2],
}

#[derive(Encode, BorrowDecode)]
struct CameraRecord {
    pose: PoseRecord,
    focal: [f64; 2],
    principal: [f64; 2],
    size: [u32; 2],
}

impl Record for CameraRecord {
    fn check(&self, place: &dyn Display) -> Result<(), Error> {
        let finite = self.focal.iter().chain(&self.principal).all(|v| v.is_finite());
        if finite && self.focal.iter().all(|&f| f > 0.0) && self.size.iter().all(|&s| s > 0) {
            return Ok(());
        }
        let found = format!("{:?}, {:?}, {:?}", self.focal, self.principal, self.size);
        Err(Error::invalid(place, "positive focal lengths and sizes and a finite principal point", found))
    }
}

impl From<&Camera> for TrainingCamera {
    /// `camera` must be in model space.
    fn from(camera: &Camera) -> Self {
        let size = [camera.width, camera.height];
        Self { pose: camera.into(), focal: camera.focal, principal: camera.principal, size }
    }
}

pub(super) fn write(writer: &mut Writer, cameras: &[TrainingCamera]) -> Result<(), Error> {
    let mut body = Vec::with_capacity(CAMERA_BYTES * cameras.len());
    for TrainingCamera { pose, focal, principal, size } in cameras {
        let record = CameraRecord { pose: pose.into(), focal: *focal, principal: *principal, size: *size };
        body.extend(record::write(&"CAMERAS", &record)?);
    }
    let record = record::write(&"CAMERAS", &Count { count: cameras.len() as u64 })?;
    writer.compressed(Place::whole(SectionKind::Cameras), record, &body)
}

pub(super) fn read(payload: &Payload<'_>, budget: &mut Budget) -> Result<Vec<TrainingCamera>, Error> {
    let name = payload.section;
    let (record, body): (Count, _) = payload.record_and_body()?;
    limits::check(format!("{name} cameras"), limits::ITEMS, record.count)?;
    let length = record.count * CAMERA_BYTES as u64;
    budget.spend(name, 2 * length)?;
    let bytes = body.decode(length, budget)?;
    let camera = |(n, bytes): (usize, _)| -> Result<TrainingCamera, Error> {
        let place = format!("{name} camera {n}");
        let CameraRecord { pose, focal, principal, size } = record::read_whole(&place, bytes)?;
        Ok(TrainingCamera { pose: pose.pose(&place)?, focal, principal, size })
    };
    bytes.chunks_exact(CAMERA_BYTES).enumerate().map(camera).collect()
}
