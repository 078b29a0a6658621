//! Collects payloads and lays them out behind their table.

use super::limits::{self, ExpansionAllowance};
use super::section::{Section, SectionKind};
use super::{Codec, Error, codec, table};

/// A file in the making.
pub(super) struct Writer {
    zstd_level: i32,
    allowance: ExpansionAllowance,
    decoded: u64,
    sections: Vec<Section>,
    payloads: Vec<Vec<u8>>,
}

impl Writer {
    pub(super) fn new(zstd_level: i32) -> Self {
        Self {
            zstd_level,
            allowance: ExpansionAllowance::new(),
            decoded: 0,
            sections: Vec::new(),
            payloads: Vec::new(),
        }
    }

    /// Adds a section that is stored as it is.
    pub(super) fn stored(&mut self, kind: SectionKind, scale: Option<u16>, payload: Vec<u8>) -> Result<(), Error> {
        self.push(kind, scale, Codec::Stored, payload.len() as u64, payload)
    }

    /// Adds a section whose `body`, behind its record, is compressed where that makes it smaller and a reader's
    /// expansion allowance suffices.
    pub(super) fn compressed(
        &mut self,
        kind: SectionKind,
        scale: Option<u16>,
        record: Vec<u8>,
        body: &[u8],
    ) -> Result<(), Error> {
        let decoded = (record.len() + body.len()) as u64;
        let compressed = codec::compress(&kind, body, self.zstd_level)?;
        let stored = (record.len() + compressed.len()) as u64;
        if stored < decoded && self.allowance.spend(stored, decoded).is_ok() {
            self.push(kind, scale, Codec::Zstd, decoded, [record, compressed].concat())
        } else {
            self.push(kind, scale, Codec::Stored, decoded, [&record, body].concat())
        }
    }

    fn push(
        &mut self,
        kind: SectionKind,
        scale: Option<u16>,
        codec: Codec,
        decoded_length: u64,
        payload: Vec<u8>,
    ) -> Result<(), Error> {
        self.decoded = self.decoded.saturating_add(decoded_length);
        limits::check("decoded bytes", limits::DECODED_BYTES, self.decoded)?;
        self.sections.push(Section {
            kind,
            critical: kind.is_critical(),
            scale,
            codec,
            offset: 0,
            length: payload.len() as u64,
            decoded_length,
            checksum: crc32fast::hash(&payload),
        });
        self.payloads.push(payload);
        Ok(())
    }

    /// The whole file.
    pub(super) fn finish(mut self) -> Result<Vec<u8>, Error> {
        let mut file = table::write(&mut self.sections)?;
        for (section, payload) in self.sections.iter().zip(&self.payloads) {
            file.resize(section.offset as usize, 0);
            file.extend_from_slice(payload);
        }
        Ok(file)
    }
}
