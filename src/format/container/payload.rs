//! Payloads: a record, then a body at the next multiple of 64 bytes (spec 2.2).

use std::borrow::Cow;

use super::codec::{self, Codec};
use super::error::Error;
use super::limits::{self, Budget};
use super::record::{self, BorrowDecode, Record};
use super::section::Section;

/// Payloads, and bodies within them, begin at multiples of this.
const ALIGNMENT: u64 = 64;

/// The first multiple of 64 that is at least `end`.
pub(super) fn aligned(end: u64) -> Option<u64> {
    end.checked_next_multiple_of(ALIGNMENT)
}

/// The payload of a section, as it is in the file.
pub(super) struct Payload<'a> {
    /// Entry of the section in the table.
    pub(super) section: &'a Section,
    bytes: &'a [u8],
}

/// The part of a payload after its record, still encoded.
pub(super) struct Body<'a> {
    pub(super) section: &'a Section,
    stored: &'a [u8],
    /// Bytes that the table declares for it, once decoded.
    pub(super) length: u64,
}

impl<'a> Payload<'a> {
    /// Checks `bytes` against the checksum in the table.
    pub(super) fn new(section: &'a Section, bytes: &'a [u8]) -> Result<Self, Error> {
        let found = crc32fast::hash(bytes);
        if found == section.checksum {
            return Ok(Self { section, bytes });
        }
        let range = section.offset..section.offset + section.length;
        Err(Error::Corrupt { section: section.to_string(), range, expected: section.checksum, found })
    }

    /// The whole payload, as it is in the file.
    pub(super) fn bytes(&self) -> &'a [u8] {
        self.bytes
    }

    /// The record of a section that has no body.
    pub(super) fn record<T: BorrowDecode<'a, ()> + Record>(&self) -> Result<T, Error> {
        self.section.check_entry()?;
        record::read_whole(self.section, self.bytes)
    }

    /// The fixed fields of the record of a section that has no body, and the rest of the record.
    pub(super) fn record_and_tail<T: BorrowDecode<'a, ()> + Record>(&self) -> Result<(T, &'a [u8]), Error> {
        self.section.check_entry()?;
        record::read(self.section, self.bytes)
    }

    /// The record, and the body after it.
    pub(super) fn record_and_body<T: BorrowDecode<'a, ()> + Record>(&self) -> Result<(T, Body<'a>), Error> {
        self.section.check_entry()?;
        let (record, rest) = record::read(self.section, self.bytes)?;
        Ok((record, self.body_after(self.bytes.len() - rest.len())?))
    }

    /// The body of a section that has no record.
    pub(super) fn body(&self) -> Result<Body<'a>, Error> {
        self.section.check_entry()?;
        self.body_after(0)
    }

    /// The body that follows the first `record` bytes.
    fn body_after(&self, record: usize) -> Result<Body<'a>, Error> {
        let section = self.section;
        let start = aligned(record as u64).filter(|&start| start <= self.bytes.len() as u64);
        let start = start.ok_or_else(|| {
            let expected = format!("at least the {record} bytes of its record, padded to a multiple of {ALIGNMENT}");
            Error::malformed(format!("{section} length"), expected, self.bytes.len())
        })?;
        Error::unless_zero(format!("{section} padding before the body"), &self.bytes[record..start as usize])?;
        let length = section.decoded_length.checked_sub(start).ok_or_else(|| {
            Error::malformed(format!("{section} decoded length"), format!("at least {start}"), section.decoded_length)
        })?;
        Ok(Body { section, stored: &self.bytes[start as usize..], length })
    }
}

impl<'a> Body<'a> {
    /// The decoded body, which must have `length` bytes, as its record implies, of a kind without the codec *adaptive*.
    pub(super) fn decode(&self, length: u64, budget: &mut Budget) -> Result<Cow<'a, [u8]>, Error> {
        let unsupported = |_: &[u8], _: &mut Budget| Err(Error::unsupported(self.section, self.section.codec));
        self.decode_by(length, budget, unsupported)
    }

    /// Decodes the body like [`Body::decode`]; `adaptive` decodes the codec *adaptive*, and spends the memory that it
    /// takes besides the result.
    pub(super) fn decode_by(
        &self,
        length: u64,
        budget: &mut Budget,
        adaptive: impl FnOnce(&[u8], &mut Budget) -> Result<Vec<u8>, Error>,
    ) -> Result<Cow<'a, [u8]>, Error> {
        let place = format!("{} body length", self.section);
        Error::unless_equal(&place, length, self.length)?;
        match self.section.codec {
            Codec::Stored => Ok(Cow::Borrowed(self.stored)),
            codec @ (Codec::Zstd | Codec::Adaptive) => {
                budget.spend(self.section, length)?;
                // This can fail only if addresses have 32 bits.
                limits::check(&place, 0..=usize::MAX as u64, length)?;
                let decoded = match codec {
                    Codec::Zstd => codec::decompress(self.section, self.stored, length as usize),
                    _ => adaptive(self.stored, budget),
                };
                decoded.map(Cow::Owned)
            }
            Codec::Other(_) => Err(Error::unsupported(self.section, self.section.codec)),
        }
    }
}
