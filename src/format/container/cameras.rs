//! CAMERAS: the cameras of the training photographs (spec 3.17).

use std::fmt::Display;
use std::ops::Range;

use super::error::Error;
use super::limits::{self, Budget};
use super::payload::Payload;
use super::pose::{Pose, PoseRecord};
use super::record::{self, BorrowDecode, Count, Encode, Record};
use super::section::SectionKind;
use super::writer::{SectionPlace, Writer};
use crate::digits::numbers;
use crate::geometry::{Camera, Coefficients, Distortion, Lens, Projection};

/// Bytes of a camera.
const CAMERA_BYTES: usize = 192;
/// The byte of a camera that holds the code of its projection.
const PROJECTION: usize = 96;
/// The reserved bytes of a camera.
const RESERVED: Range<usize> = 97..104;

/// A camera that a scene was trained from, in model space.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct TrainingCamera {
    /// Pose of the camera, in model units.
    pub pose: Pose,
    /// Focal lengths in pixels, along columns and rows.
    pub focal: [f64; 2],
    /// Principal point in pixels from the top left corner of the photograph.
    pub principal: [f64; 2],
    /// Columns and rows of the photograph.
    pub size: [u32; 2],
    /// Projection and distortion.
    #[cfg_attr(feature = "serde", serde(default))]
    pub lens: Lens,
}

#[derive(Encode, BorrowDecode)]
struct CameraRecord {
    pose: PoseRecord,
    focal: [f64; 2],
    principal: [f64; 2],
    size: [u32; 2],
    projection: u8,
    reserved: [u8; 7],
    radial: [f64; 4],
    divisor: [f64; 3],
    tangential: [f64; 2],
    prism: [f64; 2],
}

impl Record for CameraRecord {
    fn check(&self, place: &dyn Display) -> Result<(), Error> {
        if !self.focal.iter().all(|f| f.is_finite() && *f > 0.0) {
            return Err(Error::invalid(format!("{place} focal length"), "positive numbers", numbers(self.focal)));
        }
        if !self.principal.iter().all(|v| v.is_finite()) {
            return Err(Error::invalid(format!("{place} principal point"), "finite numbers", numbers(self.principal)));
        }
        if self.size.contains(&0) {
            let [width, height] = self.size;
            let found = format!("{width} and {height}");
            return Err(Error::invalid(format!("{place} width and height"), "at least 1", found));
        }
        Ok(())
    }
}

/// The projection of the camera in these bytes; [`Error::Unsupported`] if that or a reserved byte belongs to a later version.
fn projection(place: &dyn Display, camera: &[u8]) -> Result<Projection, Error> {
    Error::unless_reserved(place, &camera[RESERVED])?;
    match camera[PROJECTION] {
        0 => Ok(Projection::Perspective),
        1 => Ok(Projection::Fisheye),
        2 => Ok(Projection::Equirectangular),
        code => Err(Error::unknown_code(place, "projection", code)),
    }
}

impl CameraRecord {
    fn lens(&self, place: &dyn Display, projection: Projection) -> Result<Lens, Error> {
        let &Self { radial, divisor, tangential, prism, .. } = self;
        let distortion = Distortion::new(radial, divisor, tangential, prism).ok_or_else(|| {
            let found = numbers(radial.into_iter().chain(divisor).chain(tangential).chain(prism));
            Error::invalid(format!("{place} distortion"), "finite numbers", found)
        })?;
        Ok(Lens { projection, distortion })
    }
}

impl From<&Camera> for TrainingCamera {
    /// `camera` must be in model space.
    fn from(camera: &Camera) -> Self {
        let size = [camera.width, camera.height];
        Self { pose: camera.into(), focal: camera.focal, principal: camera.principal, size, lens: camera.lens }
    }
}

pub(super) fn write(writer: &mut Writer, cameras: &[TrainingCamera]) -> Result<(), Error> {
    limits::check("CAMERAS cameras", limits::ITEMS, cameras.len())?;
    let mut body = Vec::with_capacity(CAMERA_BYTES * cameras.len());
    for &TrainingCamera { ref pose, focal, principal, size, lens } in cameras {
        let projection = match lens.projection {
            Projection::Perspective => 0,
            Projection::Fisheye => 1,
            Projection::Equirectangular => 2,
        };
        let Coefficients { radial, divisor, tangential, prism } = lens.distortion.into();
        let (pose, reserved) = (pose.into(), [0; 7]);
        let record =
            CameraRecord { pose, focal, principal, size, projection, reserved, radial, divisor, tangential, prism };
        body.extend(record::write(&"CAMERAS", &record)?);
    }
    let record = record::write(&"CAMERAS", &Count { count: cameras.len() as u64 })?;
    writer.compressed(SectionPlace::whole(SectionKind::Cameras), record, &body)
}

pub(super) fn read(payload: &Payload<'_>, budget: &mut Budget) -> Result<Vec<TrainingCamera>, Error> {
    let name = payload.section;
    let (record, body): (Count, _) = payload.record_and_body()?;
    limits::check(format!("{name} cameras"), limits::ITEMS, record.count)?;
    let length = record.count * CAMERA_BYTES as u64;
    budget.spend(name, record.count * size_of::<TrainingCamera>() as u64)?;
    let bytes = body.decode(length, budget)?;
    // Additions of later versions come before other faults.
    for (n, bytes) in bytes.chunks_exact(CAMERA_BYTES).enumerate() {
        projection(&format!("{name} camera {n}"), bytes)?;
    }
    let camera = |(n, bytes): (usize, _)| -> Result<TrainingCamera, Error> {
        let place = format!("{name} camera {n}");
        let record: CameraRecord = record::read_whole(&place, bytes)?;
        let pose = record.pose.pose(&place)?;
        let lens = record.lens(&place, projection(&place, bytes)?)?;
        let CameraRecord { focal, principal, size, .. } = record;
        Ok(TrainingCamera { pose, focal, principal, size, lens })
    };
    bytes.chunks_exact(CAMERA_BYTES).enumerate().map(camera).collect()
}
