//! Zip archives of NumPy and PyTorch, untrusted, through `zip`.
//!
//! `zip` searches for the directory byte by byte, over ranges that the file determines. Here the end of the directory
//! is checked first, so that `zip` finds it at once and the number of entries is bounded.

use std::io::{ErrorKind, Read};

use zip::read::ZipFile;
use zip::result::ZipError;
use zip::{CompressionMethod, ZipArchive};

use super::input::bytes_at;
use super::{Fault, Input};

/// Entries of an archive.
const MAX_ENTRIES: u64 = 1 << 16;
/// Bytes of an entry after decompression.
pub const MAX_ENTRY: u64 = 1 << 34;
/// Bytes of a directory entry without its name.
const DIRECTORY_ENTRY: u64 = 46;

/// Signatures of the end of the directory, of the zip64 locator and of the zip64 end.
const END: &[u8] = b"PK\x05\x06";
const LOCATOR: &[u8] = b"PK\x06\x07";
const END_64: &[u8] = b"PK\x06\x06";

/// An archive.
#[derive(Debug)]
pub struct Archive<'a, 'b> {
    zip: ZipArchive<&'a mut Input<'b>>,
}

impl<'a, 'b> Archive<'a, 'b> {
    /// True if a file with this beginning is an archive.
    pub fn begins(start: &[u8]) -> bool {
        start.starts_with(b"PK\x03\x04") || start.starts_with(END)
    }

    /// Reads the directory.
    ///
    /// # Errors
    ///
    /// If there is no directory, it has too many entries, or two entries have the same name.
    pub fn open(input: &'a mut Input<'b>) -> Result<Self, Fault> {
        let entries = check_end(input)?;
        let zip = ZipArchive::new(input).map_err(|e| fault("the archive", e))?;
        // `zip` keeps one entry of each name.
        if zip.len() as u64 != entries {
            return Err(Fault::broken("the archive", "two entries have the same name"));
        }
        Ok(Self { zip })
    }

    /// Names of the entries, sorted.
    pub fn names(&self) -> Vec<String> {
        let mut names: Vec<_> = self.zip.file_names().filter_map(|name| Some(name.ok()?.into_owned())).collect();
        names.sort_unstable();
        names
    }

    /// A reader of the entry `name`.
    ///
    /// # Errors
    ///
    /// If there is no such entry, or it is too long or neither stored nor deflated.
    pub fn entry(&mut self, name: &str) -> Result<ZipFile<'_, &'a mut Input<'b>>, Fault> {
        let entry = self.zip.by_name(name).map_err(|e| fault(name, e))?;
        match entry.compression() {
            CompressionMethod::Stored if entry.size() != entry.compressed_size() => {
                let (size, stored) = (entry.size(), entry.compressed_size());
                return Err(Fault::malformed(name, format!("{size} stored bytes"), stored));
            }
            CompressionMethod::Stored | CompressionMethod::Deflated => {}
            other => {
                return Err(Fault::unsupported(
                    format!("{name}: compression by {other:?}"),
                    "save it stored or deflated",
                ));
            }
        }
        Fault::unless_within(&format!("{name}: bytes"), MAX_ENTRY, entry.size())?;
        Ok(entry)
    }

    /// The bytes of the entry `name`, at most `most`.
    ///
    /// # Errors
    ///
    /// The errors of [`Archive::entry`], and if the entry is longer than `most` or contradicts its size or checksum.
    pub fn bytes(&mut self, name: &str, most: u64) -> Result<Vec<u8>, Fault> {
        let mut entry = self.entry(name)?;
        let size = entry.size();
        Fault::unless_within(&format!("{name}: bytes"), most, size)?;
        let mut bytes = Vec::new();
        entry.by_ref().take(size + 1).read_to_end(&mut bytes).map_err(|e| reading(name, e))?;
        if bytes.len() as u64 != size {
            return Err(Fault::malformed(name, format!("{size} bytes"), format!("{} bytes", bytes.len())));
        }
        Ok(bytes)
    }
}

/// Checks the directory's end before the library reads it, and returns the number of entries.
fn check_end(input: &mut Input<'_>) -> Result<u64, Fault> {
    let no_end = || Fault::broken("the archive's end", "there is no zip directory");
    let tail_len = input.len().min(22 + u64::from(u16::MAX));
    let tail_start = input.len() - tail_len;
    input.go_to(tail_start)?;
    let tail = input.peek(tail_len as usize)?;
    let last = tail.len().checked_sub(22).ok_or_else(no_end)?;
    let at = (0..=last).rev().find(|&at| tail[at..].starts_with(END)).ok_or_else(no_end)?;
    let u16_at = |at: usize| u64::from(u16::from_le_bytes(bytes_at(&tail, at)));
    let (mut entries, comment) = (u16_at(at + 8), u16_at(at + 20));
    let end = tail_start + at as u64;
    if end + 22 + comment != input.len() {
        let found = format!("{} bytes", input.len() - end - 22);
        return Err(Fault::malformed("the archive's end", format!("a comment of {comment} bytes"), found));
    }
    if let Some(locator) = end.checked_sub(20) {
        input.go_to(locator)?;
        let bytes: [u8; 20] = input.array("the archive's directory")?;
        if bytes.starts_with(LOCATOR) {
            input.go_to(u64::from_le_bytes(bytes_at(&bytes, 8)))?;
            let place = input.place();
            let bytes: [u8; 56] = input.array("the archive's directory")?;
            if !bytes.starts_with(END_64) {
                return Err(Fault::malformed(place, "the end of a zip64 directory", format!("{:02x?}", &bytes[..4])));
            }
            entries = u64::from_le_bytes(bytes_at(&bytes, 32));
        }
    }
    Fault::unless_within("the archive's entries", MAX_ENTRIES.min(input.len() / DIRECTORY_ENTRY), entries)?;
    input.go_to(0)?;
    Ok(entries)
}

fn fault(place: &str, error: ZipError) -> Fault {
    match error {
        ZipError::Io(error) => reading(place, error),
        ZipError::InvalidArchive(what) => Fault::broken(place, format!("not a valid zip archive: {what}")),
        ZipError::UnsupportedArchive(what) => {
            Fault::unsupported(format!("{place}: {what}"), "save it stored or deflated, without a password")
        }
        ZipError::FileNotFound => Fault::broken("the archive", format!("the entry {place} is missing")),
        ZipError::CompressionMethodNotSupported(method) => {
            Fault::unsupported(format!("{place}: compression by method {method}"), "save it stored or deflated")
        }
        other => Fault::broken(place, format!("not a valid zip archive: {other}")),
    }
}

/// Checks that the entry ends here. `zip` compares the checksum only when the end is read.
///
/// # Errors
///
/// If there are more bytes, or the checksum is wrong.
pub fn check_end_of(entry: &mut dyn Read, name: &str) -> Result<(), Fault> {
    match entry.read(&mut [0]).map_err(|e| reading(name, e))? {
        0 => Ok(()),
        _ => Err(Fault::broken(name, "it has more bytes than it declares")),
    }
}

/// The fault of an error while reading or decompressing; most are the file's, some the system's.
pub fn reading(place: &str, error: std::io::Error) -> Fault {
    match error.kind() {
        ErrorKind::UnexpectedEof => Fault::broken(place, "it ends early"),
        // A wrong checksum is `Other`.
        ErrorKind::InvalidData | ErrorKind::InvalidInput | ErrorKind::Other => {
            Fault::broken(place, format!("its bytes are damaged: {error}"))
        }
        _ => Fault::Io(error),
    }
}
