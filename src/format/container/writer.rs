//! Collects payloads and lays them out after the section table.

use std::collections::HashMap;

use super::codec::{self, Codec};
use super::error::Error;
use super::payload::aligned;
use super::section::{Section, SectionKind};
use super::version::{VERSION, Version};
use super::{limits, table};

/// The kind of a section, and the scale and chunk that it belongs to.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) struct SectionPlace {
    pub(super) kind: SectionKind,
    pub(super) scale: Option<u16>,
    pub(super) chunk: Option<u32>,
}

impl SectionPlace {
    /// The place of a section that belongs to the whole scene.
    pub(super) fn whole(kind: SectionKind) -> Self {
        Self { kind, scale: None, chunk: None }
    }

    pub(super) fn in_scale(kind: SectionKind, scale: u16) -> Self {
        Self { kind, scale: Some(scale), chunk: None }
    }

    pub(super) fn in_chunk(kind: SectionKind, scale: u16, chunk: u32) -> Self {
        Self { kind, scale: Some(scale), chunk: Some(chunk) }
    }
}

/// How bodies are compressed; none that this would not make smaller.
#[derive(Clone, Copy, Debug)]
pub(super) enum Compression {
    /// Bodies are stored as they are.
    Stored,
    /// Bodies are compressed by zstd at this level.
    Zstd(i32),
    /// Sections that can have the codec *adaptive* by it, others by zstd at this level.
    Best(i32),
}

/// A section that is ready to be laid out.
pub(super) struct FinishedSection {
    section: Section,
    payload: Vec<u8>,
}

/// A file in the making.
pub(super) struct Writer {
    compression: Compression,
    sections: Vec<Section>,
    payloads: Vec<Vec<u8>>,
}

impl Writer {
    /// zstd's level; without any, nothing is compressed, by other codecs neither.
    pub(super) fn new(zstd_level: Option<i32>) -> Self {
        let compression = zstd_level.map_or(Compression::Stored, Compression::Best);
        Self { compression, sections: Vec::new(), payloads: Vec::new() }
    }

    pub(super) fn compression(&self) -> Compression {
        self.compression
    }

    /// Adds a section that is a record alone.
    pub(super) fn record(&mut self, place: SectionPlace, record: Vec<u8>) {
        self.add(FinishedSection::new(place, Codec::Stored, record.len() as u64, record));
    }

    /// Adds a section whose `body` follows its record uncompressed.
    pub(super) fn stored(&mut self, place: SectionPlace, record: Vec<u8>, body: &[u8]) {
        self.add(FinishedSection::stored(place, record, body));
    }

    /// Adds a section whose `body`, after its record, is compressed if that makes it smaller.
    pub(super) fn compressed(&mut self, place: SectionPlace, record: Vec<u8>, body: &[u8]) -> Result<(), Error> {
        let finished = self.compression.finished(place, record, body)?;
        self.add(finished);
        Ok(())
    }

    /// Writes a section like [`Writer::compressed`], in the codec *adaptive*, in which `body` is what `coded` returns.
    pub(super) fn adaptive(
        &mut self,
        place: SectionPlace,
        record: Vec<u8>,
        body: &[u8],
        coded: impl FnOnce() -> Vec<u8>,
    ) -> Result<(), Error> {
        let finished = self.compression.finished_adaptive(place, record, body, coded)?;
        self.add(finished);
        Ok(())
    }

    /// Adds a section that was in another file.
    pub(super) fn verbatim(&mut self, section: &Section, payload: &[u8]) {
        self.add(FinishedSection { section: section.clone(), payload: payload.to_vec() });
    }

    /// Adds a section.
    pub(super) fn add(&mut self, FinishedSection { section, payload }: FinishedSection) {
        self.sections.push(section);
        self.payloads.push(payload);
    }

    /// The whole file.
    pub(super) fn finish(self) -> Result<Vec<u8>, Error> {
        self.finish_as(VERSION)
    }

    /// The whole file, as one of this `version`.
    pub(super) fn finish_as(mut self, version: Version) -> Result<Vec<u8>, Error> {
        limits::check("sections", limits::SECTIONS, self.sections.len())?;
        table::write(&mut self.sections, &self.payloads, version)
    }
}

impl Compression {
    /// Without the codec *adaptive*.
    pub(super) fn by_zstd(self) -> Self {
        if let Self::Best(level) = self { Self::Zstd(level) } else { self }
    }

    /// A section of `record` and `body`.
    pub(super) fn finished(self, place: SectionPlace, record: Vec<u8>, body: &[u8]) -> Result<FinishedSection, Error> {
        let compressed = match self {
            Self::Stored => None,
            Self::Zstd(level) | Self::Best(level) => {
                Some(codec::compress(&place.kind, body, level)?).filter(|c| c.len() < body.len())
            }
        };
        let Some(compressed) = compressed else { return Ok(FinishedSection::stored(place, record, body)) };
        Ok(FinishedSection::coded(place, Codec::Zstd, record, &compressed, body.len()))
    }

    /// A section of `record` and `body`, which in the codec *adaptive* is what `coded` returns.
    pub(super) fn finished_adaptive(
        self,
        place: SectionPlace,
        record: Vec<u8>,
        body: &[u8],
        coded: impl FnOnce() -> Vec<u8>,
    ) -> Result<FinishedSection, Error> {
        let Self::Best(_) = self else { return self.finished(place, record, body) };
        Ok(match Some(coded()).filter(|coded| coded.len() < body.len()) {
            Some(coded) => FinishedSection::coded(place, Codec::Adaptive, record, &coded, body.len()),
            None => FinishedSection::stored(place, record, body),
        })
    }
}

/// A file that is written again: sections whose contents stay are copied from the original, if there is one.
pub(super) struct Rewriter<'a> {
    pub(super) writer: Writer,
    /// The original's bytes, and its sections by their places; `None` without an original.
    original: Option<(&'a [u8], HashMap<SectionPlace, &'a Section>)>,
}

impl<'a> Rewriter<'a> {
    /// `original` is the bytes of a whole file and its sections.
    pub(super) fn new(zstd_level: Option<i32>, original: Option<(&'a [u8], &'a [Section])>) -> Self {
        let place = |s: &Section| SectionPlace { kind: s.kind, scale: s.scale, chunk: s.chunk };
        let original = original.map(|(bytes, sections)| (bytes, sections.iter().map(|s| (place(s), s)).collect()));
        Self { writer: Writer::new(zstd_level), original }
    }

    /// Copies the section at `place` if `is_same` as in the original, in which it may be absent; else lets `write` add it.
    pub(super) fn put(
        &mut self,
        place: SectionPlace,
        is_same: bool,
        write: impl FnOnce(&mut Writer) -> Result<(), Error>,
    ) -> Result<(), Error> {
        match self.section(place) {
            Some((section, payload)) if is_same && section.check_entry().is_ok() => {
                self.writer.verbatim(section, payload);
                Ok(())
            }
            None if is_same && self.original.is_some() => Ok(()),
            _ => write(&mut self.writer),
        }
    }

    /// A copy of the original's section at `from`, to stand at `place`.
    pub(super) fn copied(&self, from: SectionPlace, place: SectionPlace) -> Option<FinishedSection> {
        let (section, payload) = self.section(from)?;
        let SectionPlace { kind, scale, chunk } = place;
        Some(FinishedSection { section: Section { kind, scale, chunk, ..section.clone() }, payload: payload.to_vec() })
    }

    /// The codec of the original's section at `place`.
    pub(super) fn codec(&self, place: SectionPlace) -> Option<Codec> {
        self.section(place).map(|(section, _)| section.codec)
    }

    fn section(&self, place: SectionPlace) -> Option<(&'a Section, &'a [u8])> {
        let (bytes, sections) = self.original.as_ref()?;
        let section = *sections.get(&place)?;
        Some((section, &bytes[section.offset as usize..(section.offset + section.length) as usize]))
    }
}

impl FinishedSection {
    fn stored(place: SectionPlace, record: Vec<u8>, body: &[u8]) -> Self {
        let payload = with_body(record, body);
        Self::new(place, Codec::Stored, payload.len() as u64, payload)
    }

    /// A section whose body is `coded` in `codec`, and has `length` bytes once it is decoded.
    fn coded(place: SectionPlace, codec: Codec, record: Vec<u8>, coded: &[u8], length: usize) -> Self {
        let payload = with_body(record, coded);
        let decoded = payload.len() - coded.len() + length;
        Self::new(place, codec, decoded as u64, payload)
    }

    fn new(place: SectionPlace, codec: Codec, decoded_length: u64, payload: Vec<u8>) -> Self {
        let SectionPlace { kind, scale, chunk } = place;
        let (length, checksum) = (payload.len() as u64, crc32fast::hash(&payload));
        let critical = kind.is_critical();
        Self {
            section: Section {
                kind,
                critical,
                scale,
                chunk,
                codec,
                offset: 0,
                length,
                decoded_length,
                checksum,
                uses_reserved: false,
            },
            payload,
        }
    }
}

/// `record`, and `body` at the next multiple of 64 bytes.
fn with_body(mut record: Vec<u8>, body: &[u8]) -> Vec<u8> {
    let start = aligned(record.len() as u64).unwrap_or(u64::MAX) as usize;
    record.resize(start, 0);
    record.extend_from_slice(body);
    record
}
