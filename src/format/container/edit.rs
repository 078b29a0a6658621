//! Changes of one section, which leave the payloads of all others as they are.

use std::collections::BTreeMap;

use super::codec::Codec;
use super::error::Error;
use super::section::{Section, SectionKind};
use super::table::{Contents, sections};
use super::writer::{SectionPlace, Writer};
use super::{frame, notes};
use crate::model::Frame;

/// The level at which notes are compressed, in files that compress anything.
const LEVEL: i32 = 19;

/// The file `bytes` with another FRAME. All other sections stay byte for byte, in their places, damaged ones with their
/// checksums, so that they remain known as damaged; so does the version. Ancillary sections with reserved bits in their entries
/// are dropped.
///
/// # Errors
///
/// If `bytes` are not a whole file, if a critical section has a reserved bit in its entry, or if a number of `frame` is out of
/// range.
pub fn with_frame(bytes: &[u8], frame: &Frame) -> Result<Vec<u8>, Error> {
    let contents = whole(bytes)?;
    let mut writer = Writer::new(None);
    for section in contents.sections.iter().filter(|s| !s.uses_reserved) {
        if section.kind == SectionKind::Frame {
            writer.record(SectionPlace::whole(SectionKind::Frame), frame::write(frame)?);
        } else {
            writer.verbatim(section, &bytes[section.range()]);
        }
    }
    writer.finish_as(contents.version)
}

/// The file `bytes` with other notes. The payloads of all other sections stay, as [`with_frame`] keeps them; so does the version.
///
/// # Errors
///
/// If `bytes` are not a whole file, if a critical section has a reserved bit in its entry, or if the notes exceed the format's
/// limits.
pub fn with_notes(bytes: &[u8], notes: &BTreeMap<String, String>) -> Result<Vec<u8>, Error> {
    let contents = whole(bytes)?;
    let is_compressed = contents.sections.iter().any(|section| section.codec != Codec::Stored);
    let mut writer = Writer::new(is_compressed.then_some(LEVEL));
    let is_unknown = |section: &&Section| matches!(section.kind, SectionKind::Other(_));
    let (unknown, known): (Vec<&Section>, Vec<&Section>) = contents.sections.iter().partition(is_unknown);
    let kept = |s: &&&Section| s.kind != SectionKind::Notes && !s.uses_reserved;
    known.iter().filter(kept).for_each(|s| writer.verbatim(s, &bytes[s.range()]));
    if !notes.is_empty() {
        notes::write(&mut writer, notes)?;
    }
    unknown.iter().filter(kept).for_each(|s| writer.verbatim(s, &bytes[s.range()]));
    writer.finish_as(contents.version)
}

fn whole(bytes: &[u8]) -> Result<Contents, Error> {
    let contents = sections(bytes)?;
    contents.check_whole(bytes)?;
    contents.sections.iter().filter(|s| s.critical).try_for_each(Section::check_reserved)?;
    Ok(contents)
}
