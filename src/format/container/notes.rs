//! NOTES: keys and values that programs keep in a file (spec 3.18).

use std::collections::BTreeMap;

use super::error::Error;
use super::limits::{self, Budget};
use super::payload::Payload;
use super::record::{self, Count, Str, Text};
use super::section::SectionKind;
use super::writer::{SectionPlace, Writer};
use crate::escape::escaped;

pub(super) fn write(writer: &mut Writer, notes: &BTreeMap<String, String>) -> Result<(), Error> {
    limits::check("NOTES notes", limits::ITEMS, notes.len())?;
    let mut body = Vec::new();
    for (key, value) in notes {
        for text in [key, value] {
            body.extend(record::write(&"NOTES", &Text { text: Str(text) })?);
        }
    }
    limits::check("NOTES bytes", 0..=*limits::TEXT_BYTES.end(), body.len())?;
    let record = record::write(&"NOTES", &Count { count: notes.len() as u64 })?;
    writer.compressed(SectionPlace::whole(SectionKind::Notes), record, &body)
}

pub(super) fn read(payload: &Payload<'_>, budget: &mut Budget) -> Result<BTreeMap<String, String>, Error> {
    let name = payload.section;
    let (record, body): (Count, _) = payload.record_and_body()?;
    limits::check(format!("{name} notes"), limits::ITEMS, record.count)?;
    limits::check(format!("{name} bytes"), 0..=*limits::TEXT_BYTES.end(), body.length)?;
    budget.spend(name, 2 * body.length)?;
    let bytes = body.decode(body.length, budget)?;
    let mut rest = bytes.as_ref();
    let mut notes = BTreeMap::<String, String>::new();
    for n in 0..record.count {
        let place = format!("{name} note {n}");
        let (key, after): (Text<'_>, _) = record::read(&place, rest)?;
        if notes.last_key_value().is_some_and(|(last, _)| last.as_str() >= key.text.0) {
            return Err(Error::malformed(format!("{place} key"), "after the key before it", escaped(key.text.0)));
        }
        let (value, after): (Text<'_>, _) = record::read(&place, after)?;
        rest = after;
        notes.insert(key.text.0.into(), value.text.0.into());
    }
    Error::unless_equal(format!("{name} number of bytes after the notes"), 0, rest.len())?;
    Ok(notes)
}
