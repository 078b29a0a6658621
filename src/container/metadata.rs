//! What a file may hold besides its scene: for people, for viewers, and for checking readers.

use std::collections::BTreeMap;

use glam::{DQuat, DVec3};

use super::Error;
use super::limits::{self, Budget};
use super::payload::Payload;
use super::prefix::Prefix;
use super::records;
pub use super::records::Probe;
use super::section::{Section, SectionKind};
use super::writer::{Place, Writer};
use crate::geometry::Camera;

/// The ancillary parts of a file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Metadata {
    /// The terms of its use, and who made it.
    pub license: Option<String>,
    /// What was measured.
    pub quality: Option<Quality>,
    /// Where to look from.
    pub views: Option<Views>,
    /// A small picture.
    pub thumbnail: Option<Thumbnail>,
    /// \[scale\] how a scene that ends with it is corrected; for all but the last.
    pub prefixes: Vec<Option<Prefix>>,
    /// Rays with what they see.
    pub probes: Option<Probes>,
    /// The cameras that it was trained from.
    pub cameras: Vec<TrainingCamera>,
    /// Keys and values.
    pub notes: BTreeMap<String, String>,
    /// Sections of kinds that this version does not define.
    pub unknown: Vec<UnknownSection>,
}

/// What was measured of a scene; PSNRs in dB.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Quality {
    /// Of its pictures against those before its numbers were encoded.
    pub encoded: Option<f64>,
    /// Mean over the test views of `dataset`.
    pub test: Option<f64>,
    /// The same before its numbers were encoded.
    pub test_before: Option<f64>,
    /// \[scale\] of the pictures of the scene that ends with it against those of all scales; nothing for the last.
    pub prefixes: Vec<Option<f64>>,
    /// Which dataset and views.
    pub dataset: String,
}

/// Where a camera is and how it is turned.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct Pose {
    /// In model units.
    pub position: DVec3,
    /// From the camera's axes to the model's.
    pub rotation: DQuat,
}

/// Where a viewer begins, and a path.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct Views {
    /// Vertical, in radians.
    pub angle_of_view: f64,
    /// Where a viewer begins.
    pub first: Pose,
    /// What it turns around, in model units.
    pub center: DVec3,
    /// How long the path takes.
    pub seconds: f64,
    /// Whether the path ends where it begins.
    pub is_closed: bool,
    /// At equal distances in time.
    pub path: Vec<Pose>,
}

/// A small picture.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Thumbnail {
    /// How `file` is written.
    pub format: ThumbnailFormat,
    /// In pixels.
    pub size: [u16; 2],
    /// The picture's file.
    pub file: Vec<u8>,
}

/// Formats of pictures.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ThumbnailFormat {
    /// Portable Network Graphics.
    Png,
    /// JPEG.
    Jpeg,
}

/// Rays with what they see.
#[derive(Clone, Debug, PartialEq)]
pub struct Probes {
    /// Of colors and opacity, absolute.
    pub color_tolerance: f64,
    /// In model units.
    pub depth_tolerance: f64,
    /// Relative to the larger of 1 and the density feature.
    pub density_tolerance: f64,
    /// At least 64 in a file of ours.
    pub probes: Vec<Probe>,
}

/// A camera that a scene was trained from.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct TrainingCamera {
    /// In the model's space.
    pub pose: Pose,
    /// Focal lengths in pixels.
    pub focal: [f64; 2],
    /// Principal point in pixels.
    pub principal: [f64; 2],
    /// In pixels.
    pub size: [u32; 2],
}

/// A section of a kind that this version does not define, kept as it was.
#[derive(Clone, Debug, PartialEq)]
pub struct UnknownSection {
    /// Its entry; its offset is 0.
    pub section: Section,
    /// Its payload as it was in the file.
    pub payload: Vec<u8>,
}

/// Bytes of a probe, and of a training camera.
const PROBE_BYTES: usize = 144;
const CAMERA_BYTES: usize = 96;

impl TrainingCamera {
    /// Of a `camera` in the model's space.
    pub fn of(camera: &Camera) -> Self {
        let size = [camera.width, camera.height];
        Self { pose: Pose::of(camera), focal: camera.focal, principal: camera.principal, size }
    }
}

impl Metadata {
    /// Writes what stands before the decoder.
    pub(super) fn write_head(&self, writer: &mut Writer) -> Result<(), Error> {
        if let Some(text) = &self.license {
            let record = records::write(&"LICENCE", &records::Text { text })?;
            writer.record(Place::of(SectionKind::License), record);
        }
        if let Some(quality) = &self.quality {
            let unknown = f64::from_bits(u64::MAX);
            let record = records::Quality {
                encoded: quality.encoded.unwrap_or(unknown),
                test: quality.test.unwrap_or(unknown),
                test_before: quality.test_before.unwrap_or(unknown),
                prefixes: quality.prefixes.iter().map(|p| p.unwrap_or(unknown)).collect(),
                dataset: &quality.dataset,
            };
            writer.record(Place::of(SectionKind::Quality), records::write(&"QUALITY", &record)?);
        }
        if let Some(views) = &self.views {
            let record = records::Views {
                angle_of_view: views.angle_of_view,
                first: views.first.record(),
                center: views.center.to_array(),
                seconds: views.seconds,
                is_closed: u8::from(views.is_closed),
                path: views.path.iter().map(Pose::record).collect(),
            };
            writer.record(Place::of(SectionKind::Views), records::write(&"VIEWS", &record)?);
        }
        if let Some(thumbnail) = &self.thumbnail {
            let [width, height] = thumbnail.size;
            let format = match thumbnail.format {
                ThumbnailFormat::Png => 0,
                ThumbnailFormat::Jpeg => 1,
            };
            limits::check("THUMBNAIL bytes", limits::THUMBNAIL_BYTES, thumbnail.file.len())?;
            let record = records::write(&"THUMBNAIL", &records::Thumbnail { format, reserved: 0, width, height })?;
            writer.stored(Place::of(SectionKind::Thumbnail), record, &thumbnail.file);
        }
        Ok(())
    }

    /// Writes what stands behind the scales.
    pub(super) fn write_tail(&self, writer: &mut Writer) -> Result<(), Error> {
        if let Some(probes) = &self.probes {
            let record = records::Probes {
                color_tolerance: probes.color_tolerance,
                depth_tolerance: probes.depth_tolerance,
                density_tolerance: probes.density_tolerance,
                count: probes.probes.len() as u64,
            };
            let mut body = Vec::with_capacity(PROBE_BYTES * probes.probes.len());
            for probe in &probes.probes {
                body.extend(records::write(&"PROBES", probe)?);
            }
            writer.stored(Place::of(SectionKind::Probes), records::write(&"PROBES", &record)?, &body);
        }
        if !self.cameras.is_empty() {
            let mut body = Vec::with_capacity(CAMERA_BYTES * self.cameras.len());
            for camera in &self.cameras {
                let TrainingCamera { pose, focal, principal, size } = *camera;
                let record = records::TrainingCamera { pose: pose.record(), focal, principal, size };
                body.extend(records::write(&"CAMERAS", &record)?);
            }
            let record = records::write(&"CAMERAS", &records::Count { count: self.cameras.len() as u64 })?;
            writer.compressed(Place::of(SectionKind::Cameras), record, &body)?;
        }
        if !self.notes.is_empty() {
            let mut body = Vec::new();
            for (key, value) in &self.notes {
                for text in [key, value] {
                    body.extend(records::write(&"NOTES", &records::Text { text })?);
                }
            }
            let record = records::write(&"NOTES", &records::Count { count: self.notes.len() as u64 })?;
            writer.compressed(Place::of(SectionKind::Notes), record, &body)?;
        }
        for unknown in &self.unknown {
            writer.as_it_was(&unknown.section, &unknown.payload);
        }
        Ok(())
    }

    /// Reads an ancillary section that is not one of the scene's.
    pub(super) fn read(&mut self, payload: &Payload<'_>, budget: &mut Budget) -> Result<(), Error> {
        let name = payload.section;
        match name.kind {
            SectionKind::License => {
                let record: records::Text<'_> = payload.record()?;
                self.license = Some(record.text.into());
            }
            SectionKind::Quality => {
                let record: records::Quality<'_> = payload.record()?;
                let known = |v: f64| (v.to_bits() != u64::MAX).then_some(v);
                self.quality = Some(Quality {
                    encoded: known(record.encoded),
                    test: known(record.test),
                    test_before: known(record.test_before),
                    prefixes: record.prefixes.into_iter().map(known).collect(),
                    dataset: record.dataset.into(),
                });
            }
            SectionKind::Views => {
                let record: records::Views = payload.record()?;
                let is_closed = match record.is_closed {
                    0 => false,
                    1 => true,
                    other => return Err(Error::malformed(format!("{name} closed"), "0 or 1", other)),
                };
                let valid = 0.0 < record.angle_of_view
                    && record.angle_of_view < std::f64::consts::PI
                    && record.seconds > 0.0
                    && record.seconds.is_finite();
                if record.center.iter().any(|v| !v.is_finite()) {
                    let found = format!("{:?}", record.center);
                    return Err(Error::malformed(format!("{name} center"), "finite numbers", found));
                }
                if !valid {
                    let found = format!("{} and {} s", record.angle_of_view, record.seconds);
                    return Err(Error::malformed(name, "an angle in (0, π) and positive seconds", found));
                }
                self.views = Some(Views {
                    angle_of_view: record.angle_of_view,
                    first: Pose::of_record(name, &record.first)?,
                    center: DVec3::from_array(record.center),
                    seconds: record.seconds,
                    is_closed,
                    path: record.path.iter().map(|p| Pose::of_record(name, p)).collect::<Result<_, _>>()?,
                });
            }
            SectionKind::Thumbnail => {
                let (record, body): (records::Thumbnail, _) = payload.record_and_body()?;
                let format = match record.format {
                    0 => ThumbnailFormat::Png,
                    1 => ThumbnailFormat::Jpeg,
                    code => return Err(Error::unsupported(format!("{name} format"), format!("code {code}"))),
                };
                limits::check(format!("{name} bytes"), limits::THUMBNAIL_BYTES, body.length)?;
                let file = body.decode(body.length, budget)?.into_owned();
                self.thumbnail = Some(Thumbnail { format, size: [record.width, record.height], file });
            }
            SectionKind::Probes => {
                let (record, body): (records::Probes, _) = payload.record_and_body()?;
                limits::check(format!("{name} probes"), limits::ITEMS, record.count)?;
                let length = record.count * PROBE_BYTES as u64;
                budget.spend(name, length)?;
                let bytes = body.decode(length, budget)?;
                let probe = |(n, bytes): (usize, _)| -> Result<Probe, Error> {
                    let probe: Probe = records::read_whole(&format!("{name} probe {n}"), bytes)?;
                    Error::unless_equal(format!("{name} probe {n} reserved fields"), [0; 2] == probe.reserved, true)?;
                    Ok(probe)
                };
                let probes = bytes.chunks_exact(PROBE_BYTES).enumerate().map(probe).collect::<Result<_, _>>()?;
                self.probes = Some(Probes {
                    color_tolerance: record.color_tolerance,
                    depth_tolerance: record.depth_tolerance,
                    density_tolerance: record.density_tolerance,
                    probes,
                });
            }
            SectionKind::Cameras => {
                let (record, body): (records::Count, _) = payload.record_and_body()?;
                limits::check(format!("{name} cameras"), limits::ITEMS, record.count)?;
                let length = record.count * CAMERA_BYTES as u64;
                budget.spend(name, 2 * length)?;
                let bytes = body.decode(length, budget)?;
                for (n, bytes) in bytes.chunks_exact(CAMERA_BYTES).enumerate() {
                    let place = format!("{name} camera {n}");
                    let camera: records::TrainingCamera = records::read_whole(&place, bytes)?;
                    let records::TrainingCamera { pose, focal, principal, size } = camera;
                    self.cameras.push(TrainingCamera { pose: Pose::of_record(&place, &pose)?, focal, principal, size });
                }
            }
            SectionKind::Notes => {
                let (record, body): (records::Count, _) = payload.record_and_body()?;
                limits::check(format!("{name} notes"), limits::ITEMS, record.count)?;
                limits::check(format!("{name} bytes"), 0..=*limits::TEXT_BYTES.end(), body.length)?;
                budget.spend(name, 2 * body.length)?;
                let bytes = body.decode(body.length, budget)?;
                let mut rest = bytes.as_ref();
                for n in 0..record.count {
                    let place = format!("{name} note {n}");
                    let (key, after): (records::Text<'_>, _) = records::read(&place, rest)?;
                    let (value, after): (records::Text<'_>, _) = records::read(&place, after)?;
                    rest = after;
                    if self.notes.last_key_value().is_some_and(|(last, _)| last.as_str() >= key.text) {
                        return Err(Error::malformed(place, "ascending keys", key.text));
                    }
                    self.notes.insert(key.text.into(), value.text.into());
                }
                Error::unless_equal(format!("{name} bytes after the notes"), 0, rest.len())?;
            }
            _ => {}
        }
        Ok(())
    }
}

impl Pose {
    /// A camera's.
    pub fn of(camera: &Camera) -> Self {
        Self { position: camera.position, rotation: DQuat::from_mat3(&camera.world_from_camera).normalize() }
    }

    fn record(&self) -> records::Pose {
        records::Pose { position: self.position.to_array(), rotation: self.rotation.to_array() }
    }

    fn of_record(place: &dyn std::fmt::Display, record: &records::Pose) -> Result<Self, Error> {
        let (position, rotation) = (DVec3::from_array(record.position), DQuat::from_array(record.rotation));
        if position.is_finite() && (rotation.length() - 1.0).abs() <= 1e-6 {
            return Ok(Self { position, rotation });
        }
        let found = format!("{position} and {rotation}");
        Err(Error::malformed(format!("{place} pose"), "a finite position and a quaternion of length 1", found))
    }
}
