//! The header, the first 64 bytes of a file: magic, version, section count, file length, checksums (spec 2.1).

use std::fmt::Display;

use super::error::Error;
use super::limits;
use super::record::{self, BorrowDecode, Encode, Record};
use super::version::{VERSION, Version};

/// The first bytes of every file: a byte with its high bit set, letters, CR LF, SUB, LF. Any conversion of line
/// endings or to seven bits changes them, and SUB stops a listing on systems where it ends a text.
pub const MAGIC: [u8; 8] = [0xB3, b'S', b'T', b'V', b'\r', b'\n', 0x1A, b'\n'];

/// Bytes of the header.
pub(super) const LENGTH: usize = 64;
/// Bytes that the header's own checksum covers: all before it.
const CHECKED: usize = LENGTH - 4;

/// The fields between the magic and the checksum of the header.
#[derive(Encode, BorrowDecode)]
pub(super) struct Header {
    pub(super) major: u16,
    pub(super) minor: u16,
    pub(super) sections: u32,
    pub(super) file_length: u64,
    pub(super) table_checksum: u32,
    pub(super) file_checksum: u32,
    pub(super) reserved: [u8; 28],
}

impl Record for Header {
    fn check(&self, place: &dyn Display) -> Result<(), Error> {
        limits::check(format!("{place} section count"), limits::SECTIONS, self.sections)
    }
}

/// Reads the header at the start of `bytes`.
pub(super) fn read(bytes: &[u8]) -> Result<Header, Error> {
    check_magic(bytes)?;
    // Before anything else: a later major version may lay out the rest differently.
    let major = u16_at(bytes, 8)?;
    if major != VERSION.major {
        let found = Version { major, minor: u16_at(bytes, 10)? };
        return Err(Error::UnsupportedVersion { found, supported: VERSION.major });
    }
    let header = bytes.get(..LENGTH).ok_or_else(|| truncated(bytes))?;
    let expected = u32::from_le_bytes([header[60], header[61], header[62], header[63]]);
    let found = crc32fast::hash(&header[..CHECKED]);
    if expected != found {
        return Err(Error::Corrupt { section: "header".into(), range: 0..LENGTH as u64, expected, found });
    }
    let header: Header = record::read_whole(&"header", &header[8..CHECKED])?;
    Error::unless_reserved("header", &header.reserved)?;
    Ok(header)
}

/// The bytes of the header.
pub(super) fn write(header: &Header) -> Result<Vec<u8>, Error> {
    let mut bytes = MAGIC.to_vec();
    bytes.extend(record::write(&"header", header)?);
    bytes.extend(crc32fast::hash(&bytes).to_le_bytes());
    Ok(bytes)
}

fn u16_at(bytes: &[u8], at: usize) -> Result<u16, Error> {
    let field = bytes.get(at..at + 2).ok_or_else(|| truncated(bytes))?;
    Ok(u16::from_le_bytes([field[0], field[1]]))
}

fn truncated(bytes: &[u8]) -> Error {
    Error::Truncated { part: "header".into(), missing: bytes.len() as u64..LENGTH as u64 }
}

fn check_magic(bytes: &[u8]) -> Result<(), Error> {
    if bytes.starts_with(&MAGIC) {
        return Ok(());
    }
    if MAGIC.starts_with(bytes) {
        return Err(truncated(bytes));
    }
    let found = bytes[..bytes.len().min(MAGIC.len())].to_vec();
    Err(if is_damaged_magic(bytes) { Error::LineEndingDamage { found } } else { Error::NotStrivec { found } })
}

/// Whether `bytes` begin with what a transfer as text makes of the magic: its first byte cut to seven bits or
/// re-encoded as UTF-8, its line endings replaced, doubled or dropped.
fn is_damaged_magic(bytes: &[u8]) -> bool {
    let first_bytes: [&[u8]; 4] = [&[0xB3], &[0x33], &[0xC2, 0xB3], &[0xEF, 0xBF, 0xBD]];
    let Some(rest) = first_bytes.iter().find_map(|first| bytes.strip_prefix(*first)?.strip_prefix(b"STV")) else {
        return false;
    };
    let endings = rest.iter().take_while(|b| matches!(b, b'\r' | b'\n')).count();
    // The longest that CR LF becomes is CR CR CR LF.
    endings <= 4 && rest.get(endings) == Some(&0x1A)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn conversions_of_line_endings_are_named() {
        let magic = |ending: &[u8], last: &[u8]| [&[0xB3], b"STV".as_slice(), ending, &[0x1A], last, &[1, 0]].concat();
        let intact = magic(b"\r\n", b"\n");
        assert_eq!(check_magic(&intact), Ok(()));
        for (ending, last) in [("\n", "\n"), ("\r\r\n", "\r\n"), ("\r", "\r"), ("\n\n", "\n"), ("\r\r", "\r"), ("", "")]
        {
            let damaged = magic(ending.as_bytes(), last.as_bytes());
            assert!(matches!(check_magic(&damaged), Err(Error::LineEndingDamage { .. })), "{ending:?} {last:?}");
        }
        let as_utf8 = [&[0xC2], intact.as_slice()].concat();
        let seven_bits = intact.iter().map(|b| b & 0x7F).collect::<Vec<_>>();
        for damaged in [as_utf8, seven_bits] {
            assert!(matches!(check_magic(&damaged), Err(Error::LineEndingDamage { .. })), "{damaged:02x?}");
        }
    }
}
