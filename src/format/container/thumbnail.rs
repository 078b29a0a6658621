//! THUMBNAIL: a small picture of the scene (spec 3.14).

use std::fmt::Display;

use super::error::Error;
use super::limits::{self, Budget};
use super::payload::Payload;
use super::record::{self, BorrowDecode, Encode, Record};
use super::section::SectionKind;
use super::writer::{SectionPlace, Writer};

/// A small picture. Its bytes are untrusted, and its size is unchecked.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Thumbnail {
    /// The format of `file`.
    pub format: ThumbnailFormat,
    /// Columns and rows in pixels.
    pub size: [u16; 2],
    /// The bytes of the image file.
    pub file: Vec<u8>,
}

/// Formats of thumbnails.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ThumbnailFormat {
    /// Portable Network Graphics.
    Png,
    /// JPEG.
    Jpeg,
}

#[derive(Encode, BorrowDecode)]
struct ThumbnailRecord {
    format: u8,
    reserved: u8,
    width: u16,
    height: u16,
}

impl Record for ThumbnailRecord {
    fn check(&self, place: &dyn Display) -> Result<(), Error> {
        self.format(place)?;
        Error::unless_reserved(place, &[self.reserved])
    }
}

impl ThumbnailRecord {
    fn format(&self, place: &dyn Display) -> Result<ThumbnailFormat, Error> {
        match self.format {
            0 => Ok(ThumbnailFormat::Png),
            1 => Ok(ThumbnailFormat::Jpeg),
            code => Err(Error::unknown_code(place, "format", code)),
        }
    }
}

pub(super) fn write(writer: &mut Writer, thumbnail: &Thumbnail) -> Result<(), Error> {
    let [width, height] = thumbnail.size;
    let format = match thumbnail.format {
        ThumbnailFormat::Png => 0,
        ThumbnailFormat::Jpeg => 1,
    };
    limits::check("THUMBNAIL bytes", limits::THUMBNAIL_BYTES, thumbnail.file.len())?;
    let record = record::write(&"THUMBNAIL", &ThumbnailRecord { format, reserved: 0, width, height })?;
    writer.stored(SectionPlace::whole(SectionKind::Thumbnail), record, &thumbnail.file);
    Ok(())
}

pub(super) fn read(payload: &Payload<'_>, budget: &mut Budget) -> Result<Thumbnail, Error> {
    let name = payload.section;
    let (record, body): (ThumbnailRecord, _) = payload.record_and_body()?;
    let format = record.format(name)?;
    limits::check(format!("{name} bytes"), limits::THUMBNAIL_BYTES, body.length)?;
    let file = body.decode(body.length, budget)?.into_owned();
    Ok(Thumbnail { format, size: [record.width, record.height], file })
}
