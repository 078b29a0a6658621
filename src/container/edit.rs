//! Changes of one section, which leave the payloads of all others as they are.

use std::collections::BTreeMap;

use super::codec::Codec;
use super::error::Error;
use super::section::{Section, SectionKind};
use super::table::{Contents, sections};
use super::writer::{Place, Writer};
use super::{frame, notes};
use crate::model::Frame;

/// The level at which notes are compressed, in files that compress anything.
const LEVEL: i32 = 19;

/// The file `bytes` with another FRAME. All other sections stay byte for byte, in their places; so does the version.
///
/// # Errors
///
/// If `bytes` are not a whole file, or if a number of `frame` is out of range.
pub fn with_frame(bytes: &[u8], frame: &Frame) -> Result<Vec<u8>, Error> {
    let contents = whole(bytes)?;
    let mut writer = Writer::new(None);
    for section in &contents.sections {
        if section.kind == SectionKind::Frame {
            writer.record(Place::whole(SectionKind::Frame), frame::write(frame)?);
        } else {
            writer.verbatim(section, payload(bytes, section));
        }
    }
    writer.finish_as(contents.version)
}

/// The file `bytes` with other notes. The payloads of all other sections stay as they are; so does the version.
///
/// # Errors
///
/// If `bytes` are not a whole file, or if the notes exceed the format's limits.
pub fn with_notes(bytes: &[u8], notes: &BTreeMap<String, String>) -> Result<Vec<u8>, Error> {
    let contents = whole(bytes)?;
    let is_compressed = contents.sections.iter().any(|section| section.codec != Codec::Stored);
    let mut writer = Writer::new(is_compressed.then_some(LEVEL));
    let is_unknown = |section: &&Section| matches!(section.kind, SectionKind::Other(_));
    let (unknown, known): (Vec<&Section>, Vec<&Section>) = contents.sections.iter().partition(is_unknown);
    known
        .iter()
        .filter(|s| s.kind != SectionKind::Notes)
        .for_each(|section| writer.verbatim(section, payload(bytes, section)));
    if !notes.is_empty() {
        notes::write(&mut writer, notes)?;
    }
    unknown.iter().for_each(|section| writer.verbatim(section, payload(bytes, section)));
    writer.finish_as(contents.version)
}

fn whole(bytes: &[u8]) -> Result<Contents, Error> {
    let contents = sections(bytes)?;
    contents.check_whole(bytes)?;
    Ok(contents)
}

/// The payload of a `section` of a whole file.
fn payload<'a>(bytes: &'a [u8], section: &Section) -> &'a [u8] {
    &bytes[section.offset as usize..(section.offset + section.length) as usize]
}
