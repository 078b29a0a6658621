//! The section table (spec 2.2). It is read, and compared with its checksum, before any payload.

use super::error::Error;
use super::limits::Limits;
use super::payload::{Payload, aligned};
use super::section::Section;
use super::version::Version;
use super::{header, record};

/// Bytes of an entry.
const ENTRY: usize = 64;

/// The header and section table of a file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Contents {
    /// The version of the format that it was written in.
    pub version: Version,
    /// Bytes of the whole file.
    pub file_length: u64,
    /// CRC-32 of all bytes after the header.
    pub file_checksum: u32,
    /// Sections of the file, in its order.
    pub sections: Vec<Section>,
}

impl Contents {
    /// Fails if the file, whose bytes arrive in pieces that are held in memory, is longer than a reader's memory.
    ///
    /// # Errors
    ///
    /// [`Error::Budget`].
    pub fn check_length(&self) -> Result<(), Error> {
        let (needed, left) = (self.file_length, Limits::default().memory);
        if needed <= left { Ok(()) } else { Err(Error::Budget { place: "the file".into(), needed, left }) }
    }

    /// Checks that `bytes` are the whole file and nothing else, and that only ancillary sections are damaged.
    pub(super) fn check_whole(&self, bytes: &[u8]) -> Result<(), Error> {
        let length = bytes.len() as u64;
        if length < self.file_length {
            let cut = self.sections.iter().find(|s| s.offset + s.length > length);
            let part = cut.map_or("file".into(), Section::to_string);
            return Err(Error::Truncated { part, missing: length..self.file_length });
        }
        Error::unless_equal("number of bytes in the file", self.file_length, length)?;
        let mut has_damage = false;
        for section in &self.sections {
            if let Err(error) = Payload::new(section, &bytes[section.range()]) {
                if section.critical {
                    return Err(error);
                }
                has_damage = true;
            }
        }
        // A damaged section changes the checksum of the file, too. The others of it were compared one by one.
        let found = crc32fast::hash(&bytes[header::LENGTH..]);
        if !has_damage && found != self.file_checksum {
            let range = header::LENGTH as u64..length;
            return Err(Error::Corrupt { section: "file".into(), range, expected: self.file_checksum, found });
        }
        let mut end = table_end(self.sections.len()) as usize;
        for section in &self.sections {
            let range = section.range();
            Error::unless_zero(format!("padding before {section}"), &bytes[end..range.start])?;
            end = range.end;
        }
        Ok(())
    }
}

fn table_end(sections: usize) -> u64 {
    header::LENGTH as u64 + sections as u64 * ENTRY as u64
}

/// The header and section table at the start of `bytes`, which may be a prefix of a file: nothing after the table is
/// read.
///
/// # Errors
///
/// If header or table are not those of a `.strivec` file of this major version, are damaged or beyond the limits, or
/// list sections that do not follow one another without a gap. Unknown sections are no error here.
pub fn sections(bytes: &[u8]) -> Result<Contents, Error> {
    let header = header::read(bytes)?;
    let count = header.sections as usize;
    let range = header::LENGTH as u64..table_end(count);
    let table = bytes
        .get(header::LENGTH..table_end(count) as usize)
        .ok_or_else(|| Error::Truncated { part: "section table".into(), missing: bytes.len() as u64..range.end })?;
    let found = crc32fast::hash(table);
    if found != header.table_checksum {
        let expected = header.table_checksum;
        return Err(Error::Corrupt { section: "section table".into(), range, expected, found });
    }
    let mut sections = Vec::with_capacity(count);
    let mut end = range.end;
    for (index, entry) in table.chunks_exact(ENTRY).enumerate() {
        let entry = record::read_whole(&format!("section table entry {index}"), entry)?;
        let section = Section::from_entry(&entry, index)?;
        let overflow =
            || Error::malformed(format!("{section} end"), "below 2^64", format!("length {}", section.length));
        Error::unless_equal(format!("{section} offset"), aligned(end).ok_or_else(overflow)?, section.offset)?;
        end = section.offset.checked_add(section.length).ok_or_else(overflow)?;
        sections.push(section);
    }
    Error::unless_equal("header file length", end, header.file_length)?;
    let version = Version { major: header.major, minor: header.minor };
    Ok(Contents { version, file_length: header.file_length, file_checksum: header.file_checksum, sections })
}

/// Bytes of header and table of the file whose header these bytes begin with.
pub(super) fn length(header: &[u8]) -> Result<u64, Error> {
    Ok(table_end(header::read(header)?.sections as usize))
}

/// The file of `version` of `sections`, whose offsets are set here, with these payloads.
pub(super) fn write(sections: &mut [Section], payloads: &[Vec<u8>], version: Version) -> Result<Vec<u8>, Error> {
    let mut end = table_end(sections.len());
    let mut table = Vec::new();
    for section in sections.iter_mut() {
        let overflow = || Error::malformed("file length", "below 2^64", "a larger one");
        section.offset = aligned(end).ok_or_else(overflow)?;
        end = section.offset.checked_add(section.length).ok_or_else(overflow)?;
        table.extend(record::write(&"section table", &section.entry())?);
    }
    let mut file = vec![0; header::LENGTH];
    file.extend_from_slice(&table);
    for (section, payload) in sections.iter().zip(payloads) {
        file.resize(section.offset as usize, 0);
        file.extend_from_slice(payload);
    }
    let header = header::Header {
        major: version.major,
        minor: version.minor,
        sections: sections.len().try_into().unwrap_or(u32::MAX),
        file_length: end,
        table_checksum: crc32fast::hash(&table),
        file_checksum: crc32fast::hash(&file[header::LENGTH..]),
        reserved: [0; 28],
    };
    file[..header::LENGTH].copy_from_slice(&header::write(&header)?);
    Ok(file)
}
