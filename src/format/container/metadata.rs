//! What a file may hold besides its scene, for people, viewers and checks: the ancillary sections of spec 3.11 to
//! 3.18, each in its own file, and the sections of unknown kinds.

use std::collections::BTreeMap;
use std::fmt;

use super::cameras::{self, TrainingCamera};
use super::error::Error;
use super::limits::Budget;
use super::payload::Payload;
use super::prefix::Prefix;
use super::probes::{self, Probes};
use super::quality::{self, Quality};
use super::section::{Section, SectionKind};
use super::thumbnail::{self, Thumbnail};
use super::views::{self, Views};
use super::writer::{Rewriter, SectionPlace};
use super::{license, notes};

/// The ancillary parts of a file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Metadata {
    /// The terms of use of the scene, and its authors.
    pub license: Option<String>,
    /// Measurements.
    pub quality: Option<Quality>,
    /// The initial pose of a viewer, and a camera path.
    pub views: Option<Views>,
    /// A small picture.
    pub thumbnail: Option<Thumbnail>,
    /// \[scale\] the correction of the scene of scales 0 to this one; none for the last scale.
    pub prefixes: Vec<Option<Prefix>>,
    /// Rays and their pixels.
    pub probes: Option<Probes>,
    /// The cameras of the training photographs.
    pub cameras: Vec<TrainingCamera>,
    /// Keys and values.
    pub notes: BTreeMap<String, String>,
    /// Sections of kinds that this version does not define.
    pub unknown: Vec<UnknownSection>,
    /// The sections that were skipped because the reader could not use them. Writing the scene drops them.
    pub skipped: Vec<SkippedSection>,
}

/// An ancillary section that was taken as absent because the reader could not use it: it is damaged, breaks a rule, or
/// has a code of a later version (spec 1).
#[derive(Clone, Debug, PartialEq)]
pub struct SkippedSection {
    /// Kind and scale of the section.
    pub name: String,
    /// Why it cannot be used.
    pub error: Error,
}

impl SkippedSection {
    /// True if the file follows the specification: the section only has a code of a later version.
    pub fn is_valid(&self) -> bool {
        matches!(self.error, Error::Unsupported { .. })
    }
}

impl fmt::Display for SkippedSection {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "section {} is skipped: {}", self.name, self.error)
    }
}

/// A section of a kind that this version does not define, kept as it was.
#[derive(Clone, Debug, PartialEq)]
pub struct UnknownSection {
    /// Entry of the section in the table, with offset 0.
    pub section: Section,
    /// The bytes of its payload in the file.
    pub payload: Vec<u8>,
}

impl Metadata {
    /// Writes the sections before DECODER, for a scene of `scales` scales. `before` is what the original has.
    pub(super) fn write_head(&self, out: &mut Rewriter<'_>, scales: usize, before: Option<&Self>) -> Result<(), Error> {
        let is_same = |same: &dyn Fn(&Self) -> bool| before.is_some_and(same);
        if let Some(text) = &self.license {
            let same = is_same(&|b| b.license == self.license);
            out.put(SectionPlace::whole(SectionKind::License), same, |writer| license::write(writer, text))?;
        }
        if let Some(quality) = &self.quality {
            let same = is_same(&|b| b.quality == self.quality);
            out.put(SectionPlace::whole(SectionKind::Quality), same, |writer| quality::write(writer, quality, scales))?;
        }
        if let Some(views) = &self.views {
            let same = is_same(&|b| b.views == self.views);
            out.put(SectionPlace::whole(SectionKind::Views), same, |writer| views::write(writer, views))?;
        }
        Ok(())
    }

    /// Writes the sections after the scales. `before` is what the original has.
    pub(super) fn write_tail(&self, out: &mut Rewriter<'_>, before: Option<&Self>) -> Result<(), Error> {
        let is_same = |same: &dyn Fn(&Self) -> bool| before.is_some_and(same);
        if let Some(probes) = &self.probes {
            let same = is_same(&|b| b.probes == self.probes);
            out.put(SectionPlace::whole(SectionKind::Probes), same, |writer| probes::write(writer, probes))?;
        }
        if !self.cameras.is_empty() {
            let same = is_same(&|b| b.cameras == self.cameras);
            out.put(SectionPlace::whole(SectionKind::Cameras), same, |writer| cameras::write(writer, &self.cameras))?;
        }
        if let Some(thumbnail) = &self.thumbnail {
            let same = is_same(&|b| b.thumbnail == self.thumbnail);
            out.put(SectionPlace::whole(SectionKind::Thumbnail), same, |writer| thumbnail::write(writer, thumbnail))?;
        }
        if !self.notes.is_empty() {
            let same = is_same(&|b| b.notes == self.notes);
            out.put(SectionPlace::whole(SectionKind::Notes), same, |writer| notes::write(writer, &self.notes))?;
        }
        for unknown in &self.unknown {
            out.writer.verbatim(&unknown.section, &unknown.payload);
        }
        Ok(())
    }

    /// Reads an ancillary section before DECODER or after the scales, in the file of a scene of `scales` scales.
    pub(super) fn read(&mut self, payload: &Payload<'_>, scales: usize, budget: &mut Budget) -> Result<(), Error> {
        match payload.section.kind {
            SectionKind::License => self.license = Some(license::read(payload)?),
            SectionKind::Quality => self.quality = Some(quality::read(payload, scales)?),
            SectionKind::Views => self.views = Some(views::read(payload)?),
            SectionKind::Probes => self.probes = Some(probes::read(payload, budget)?),
            SectionKind::Cameras => self.cameras = cameras::read(payload, budget)?,
            SectionKind::Thumbnail => self.thumbnail = Some(thumbnail::read(payload, budget)?),
            SectionKind::Notes => self.notes = notes::read(payload, budget)?,
            _ => {}
        }
        Ok(())
    }
}
