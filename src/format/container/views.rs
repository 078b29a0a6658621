//! VIEWS: the initial pose of a viewer, and a camera path (spec 3.13).

use std::fmt::Display;

use glam::DVec3;

use super::error::Error;
use super::limits;
use super::payload::Payload;
use super::pose::{Pose, PoseRecord};
use super::record::{self, BorrowDecode, Encode, List, Record};
use super::section::SectionKind;
use super::writer::{SectionPlace, Writer};
use crate::digits::{number, numbers};

/// The initial pose of a viewer, and a camera path.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct Views {
    /// Vertical angle of view, in radians.
    pub angle_of_view: f64,
    /// The initial pose of a viewer.
    pub first: Pose,
    /// The point that a viewer orbits, in model units.
    pub center: DVec3,
    /// Duration of the path.
    pub seconds: f64,
    /// Whether the path returns to its first pose.
    pub is_closed: bool,
    /// Poses at equal intervals of time.
    pub path: Vec<Pose>,
}

#[derive(Encode, BorrowDecode)]
struct ViewsRecord {
    angle_of_view: f64,
    first: PoseRecord,
    center: [f64; 3],
    seconds: f64,
    is_closed: u8,
    path: List<PoseRecord, { *limits::ITEMS.end() }>,
}

impl Record for ViewsRecord {
    fn check(&self, place: &dyn Display) -> Result<(), Error> {
        limits::check(format!("{place} poses"), limits::ITEMS, self.path.0.len())
    }
}

pub(super) fn write(writer: &mut Writer, views: &Views) -> Result<(), Error> {
    let record = ViewsRecord {
        angle_of_view: views.angle_of_view,
        first: (&views.first).into(),
        center: views.center.to_array(),
        seconds: views.seconds,
        is_closed: u8::from(views.is_closed),
        path: List(views.path.iter().map(PoseRecord::from).collect()),
    };
    writer.record(SectionPlace::whole(SectionKind::Views), record::write(&"VIEWS", &record)?);
    Ok(())
}

pub(super) fn read(payload: &Payload<'_>) -> Result<Views, Error> {
    let name = payload.section;
    let record: ViewsRecord = payload.record()?;
    let is_closed = match record.is_closed {
        0 => false,
        1 => true,
        other => return Err(Error::invalid(format!("{name} closed"), "0 or 1", other)),
    };
    if record.center.iter().any(|v| !v.is_finite()) {
        return Err(Error::invalid(format!("{name} target"), "finite numbers", numbers(record.center)));
    }
    let valid = 0.0 < record.angle_of_view
        && record.angle_of_view < std::f64::consts::PI
        && record.seconds > 0.0
        && record.seconds.is_finite();
    if !valid {
        let found = format!("{} and {} s", number(record.angle_of_view), number(record.seconds));
        return Err(Error::invalid(
            format!("{name} angle and duration"),
            "an angle in (0, π) and positive seconds",
            found,
        ));
    }
    Ok(Views {
        angle_of_view: record.angle_of_view,
        first: record.first.pose(name)?,
        center: DVec3::from_array(record.center),
        seconds: record.seconds,
        is_closed,
        path: record.path.0.iter().map(|p| p.pose(name)).collect::<Result<_, _>>()?,
    })
}
