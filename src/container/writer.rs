//! Collects payloads and lays them out after the section table.

use super::codec::{self, Codec};
use super::error::Error;
use super::payload::aligned;
use super::section::{Section, SectionKind};
use super::{limits, table};

/// The kind of a section, and the scale and chunk that it belongs to.
#[derive(Clone, Copy, Debug)]
pub(super) struct Place {
    pub(super) kind: SectionKind,
    pub(super) scale: Option<u16>,
    pub(super) chunk: Option<u32>,
}

impl Place {
    /// Of the whole scene.
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

/// A section that is ready to be laid out.
pub(super) struct Finished {
    section: Section,
    payload: Vec<u8>,
}

/// A file in the making.
pub(super) struct Writer {
    /// zstd's; nothing is compressed, by other codecs neither, if there is none.
    zstd_level: Option<i32>,
    sections: Vec<Section>,
    payloads: Vec<Vec<u8>>,
}

impl Writer {
    pub(super) fn new(zstd_level: Option<i32>) -> Self {
        Self { zstd_level, sections: Vec::new(), payloads: Vec::new() }
    }

    /// Adds a section that is a record alone.
    pub(super) fn record(&mut self, place: Place, record: Vec<u8>) {
        self.add(Finished::new(place, Codec::Stored, record.len() as u64, record));
    }

    /// Adds a section whose `body` follows its record uncompressed.
    pub(super) fn stored(&mut self, place: Place, record: Vec<u8>, body: &[u8]) {
        self.add(Finished::stored(place, record, body));
    }

    /// Adds a section whose `body`, after its record, is compressed if that makes it smaller.
    pub(super) fn compressed(&mut self, place: Place, record: Vec<u8>, body: &[u8]) -> Result<(), Error> {
        let finished = self.finished(place, record, body)?;
        self.add(finished);
        Ok(())
    }

    /// As [`Writer::compressed`], in the codec *adaptive*, in which `body` is what `coded` returns.
    pub(super) fn adaptive(&mut self, place: Place, record: Vec<u8>, body: &[u8], coded: impl FnOnce() -> Vec<u8>) {
        let finished = self.finished_adaptive(place, record, body, coded);
        self.add(finished);
    }

    /// The section that [`Writer::adaptive`] would add.
    pub(super) fn finished_adaptive(
        &self,
        place: Place,
        record: Vec<u8>,
        body: &[u8],
        coded: impl FnOnce() -> Vec<u8>,
    ) -> Finished {
        match self.zstd_level.map(|_| coded()).filter(|coded| coded.len() < body.len()) {
            Some(coded) => Finished::coded(place, Codec::Adaptive, record, &coded, body.len()),
            None => Finished::stored(place, record, body),
        }
    }

    /// The section that [`Writer::compressed`] would add.
    pub(super) fn finished(&self, place: Place, record: Vec<u8>, body: &[u8]) -> Result<Finished, Error> {
        let compressed = match self.zstd_level {
            None => None,
            Some(level) => Some(codec::compress(&place.kind, body, level)?).filter(|c| c.len() < body.len()),
        };
        let Some(compressed) = compressed else { return Ok(Finished::stored(place, record, body)) };
        Ok(Finished::coded(place, Codec::Zstd, record, &compressed, body.len()))
    }

    /// Adds a section that was in another file.
    pub(super) fn verbatim(&mut self, section: &Section, payload: &[u8]) {
        self.add(Finished { section: section.clone(), payload: payload.to_vec() });
    }

    /// Adds a section.
    pub(super) fn add(&mut self, Finished { section, payload }: Finished) {
        self.sections.push(section);
        self.payloads.push(payload);
    }

    /// The whole file.
    pub(super) fn finish(mut self) -> Result<Vec<u8>, Error> {
        limits::check("sections", limits::SECTIONS, self.sections.len())?;
        table::write(&mut self.sections, &self.payloads)
    }
}

impl Finished {
    fn stored(place: Place, record: Vec<u8>, body: &[u8]) -> Self {
        let payload = with_body(record, body);
        Self::new(place, Codec::Stored, payload.len() as u64, payload)
    }

    /// A section whose body is `coded` in `codec`, and has `length` bytes once it is decoded.
    fn coded(place: Place, codec: Codec, record: Vec<u8>, coded: &[u8], length: usize) -> Self {
        let payload = with_body(record, coded);
        let decoded = payload.len() - coded.len() + length;
        Self::new(place, codec, decoded as u64, payload)
    }

    fn new(place: Place, codec: Codec, decoded_length: u64, payload: Vec<u8>) -> Self {
        let Place { kind, scale, chunk } = place;
        let (length, checksum) = (payload.len() as u64, crc32fast::hash(&payload));
        let critical = kind.is_critical();
        Self {
            section: Section { kind, critical, scale, chunk, codec, offset: 0, length, decoded_length, checksum },
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
