//! Walks through the payloads of a file in their order, after everything that can be checked without understanding
//! them was checked.

use std::borrow::Cow;

use super::limits::{self, ExpansionAllowance};
use super::section::{Section, SectionKind};
use super::{Codec, Contents, Error, codec};

/// The payload of a section of known kind.
pub(super) struct Payload<'a> {
    /// Its entry in the table.
    pub(super) section: &'a Section,
    bytes: &'a [u8],
}

impl<'a> Payload<'a> {
    /// The payload of a section that may not be compressed.
    pub(super) fn stored(&self) -> Result<&'a [u8], Error> {
        Error::unless_equal(format!("{} codec", self.section), Codec::Stored, self.section.codec)?;
        Ok(self.bytes)
    }

    /// The payload as it is in the file: a record, then a body to be passed to [`Payload::body`].
    pub(super) fn encoded(&self) -> &'a [u8] {
        self.bytes
    }

    /// The length that the table declares for the body, once decoded, whose stored bytes are `stored`.
    pub(super) fn declared_body_length(&self, stored: &[u8]) -> Result<u64, Error> {
        let record = (self.bytes.len() - stored.len()) as u64;
        self.section.decoded_length.checked_sub(record).ok_or_else(|| {
            let place = format!("{} decoded length", self.section);
            Error::malformed(place, format!("at least {record}"), self.section.decoded_length)
        })
    }

    /// The decoded body whose stored bytes are `stored` and which must have `length` bytes, as its record implies.
    pub(super) fn body(&self, stored: &'a [u8], length: u64) -> Result<Cow<'a, [u8]>, Error> {
        let place = format!("{} body length", self.section);
        Error::unless_equal(&place, length, self.declared_body_length(stored)?)?;
        match self.section.codec {
            Codec::Stored => Ok(Cow::Borrowed(stored)),
            Codec::Zstd => {
                // Only where addresses have 32 bits can this fail: the sum of all lengths was checked.
                limits::check(&place, 0..=usize::MAX as u64, length)?;
                codec::decompress(self.section, stored, length as usize).map(Cow::Owned)
            }
            Codec::Other(_) => Err(Error::unsupported(self.section, self.section.codec)),
        }
    }
}

/// The sections of known kind that are still to be read.
pub(super) struct Cursor<'a> {
    payloads: Vec<Payload<'a>>,
    next: usize,
}

impl<'a> Cursor<'a> {
    /// Checks that `bytes` are all that `contents` describe and nothing else, that every section is intact, and that
    /// the known ones may be decoded.
    pub(super) fn new(bytes: &'a [u8], contents: &'a Contents) -> Result<Self, Error> {
        check_length(bytes, contents)?;
        let unknown = |s: &&Section| matches!(s.kind, SectionKind::Other(_));
        if let Some(section) = contents.sections.iter().filter(unknown).find(|s| s.critical) {
            return Err(Error::UnknownCritical { name: section.to_string() });
        }
        let mut payloads = Vec::new();
        let mut allowance = ExpansionAllowance::new();
        let mut decoded: u64 = 0;
        let mut end = contents.table_end() as usize;
        for section in &contents.sections {
            // In range: the table was checked, and the file has the length that it says.
            let range = section.offset as usize..(section.offset + section.length) as usize;
            if let Some(at) = bytes[end..range.start].iter().position(|&b| b != 0) {
                let place = format!("padding before {section}, byte {}", end + at);
                return Err(Error::malformed(place, 0, bytes[end + at]));
            }
            end = range.end;
            let payload = Payload { section, bytes: &bytes[range] };
            check_checksum(&payload)?;
            if unknown(&section) {
                continue;
            }
            decoded = decoded.saturating_add(section.decoded_length);
            limits::check("decoded bytes", limits::DECODED_BYTES, decoded)?;
            if section.codec == Codec::Zstd {
                allowance.spend(section.length, section.decoded_length).map_err(|allowed| Error::Expansion {
                    section: section.to_string(),
                    allowed,
                    found: section.decoded_length,
                })?;
            }
            payloads.push(payload);
        }
        Ok(Self { payloads, next: 0 })
    }

    /// The next section, if it is of this kind and scale.
    pub(super) fn take_if(&mut self, kind: SectionKind, scale: Option<u16>) -> Option<&Payload<'a>> {
        let payload = self.payloads.get(self.next).filter(|p| p.section.kind == kind && p.section.scale == scale)?;
        self.next += 1;
        Some(payload)
    }

    /// The next section, which must be of this kind and scale.
    pub(super) fn take(&mut self, kind: SectionKind, scale: Option<u16>) -> Result<&Payload<'a>, Error> {
        let at = self.next;
        if self.take_if(kind, scale).is_some() {
            return Ok(&self.payloads[at]);
        }
        let name = scale.map_or(kind.to_string(), |scale| format!("{kind} of scale {scale}"));
        let elsewhere = self.payloads.iter().any(|p| p.section.kind == kind && p.section.scale == scale);
        Err(match self.payloads.get(at) {
            Some(found) if elsewhere => Error::malformed("order of sections", name, found.section),
            _ => Error::MissingSection { name },
        })
    }

    /// Checks that every section was taken.
    pub(super) fn finish(&self) -> Result<(), Error> {
        match self.payloads.get(self.next) {
            None => Ok(()),
            Some(payload) => Err(Error::malformed("order of sections", "no further section", payload.section)),
        }
    }
}

fn check_length(bytes: &[u8], contents: &Contents) -> Result<(), Error> {
    let length = bytes.len() as u64;
    if length < contents.file_length {
        let cut = contents.sections.iter().find(|s| s.offset + s.length > length);
        let part = cut.map_or("file".into(), Section::to_string);
        return Err(Error::Truncated { part, missing: length..contents.file_length });
    }
    Error::unless_equal("bytes in the file", contents.file_length, length)
}

fn check_checksum(payload: &Payload<'_>) -> Result<(), Error> {
    let (section, found) = (payload.section, crc32fast::hash(payload.bytes));
    if found == section.checksum {
        return Ok(());
    }
    let range = section.offset..section.offset + section.length;
    Err(Error::Corrupt { section: section.to_string(), range, expected: section.checksum, found })
}
