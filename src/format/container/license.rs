//! LICENCE: the terms of use of the scene, and its authors (spec 3.15).

use super::error::Error;
use super::payload::Payload;
use super::record::{self, Str, Text};
use super::section::SectionKind;
use super::writer::{SectionPlace, Writer};

pub(super) fn write(writer: &mut Writer, text: &str) -> Result<(), Error> {
    let record = record::write(&"LICENCE", &Text { text: Str(text) })?;
    writer.record(SectionPlace::whole(SectionKind::License), record);
    Ok(())
}

pub(super) fn read(payload: &Payload<'_>) -> Result<String, Error> {
    let record: Text<'_> = payload.record()?;
    Ok(record.text.0.into())
}
