//! The pages of an E57 file: 1020 bytes and their checksum, a CRC-32C with the most significant byte first.

use crate::input::bytes_at;
use crate::{Fault, Input};

/// Bytes of a page.
pub(super) const PAGE: u64 = 1024;

/// Bytes of a page before its checksum.
const PAYLOAD: u64 = PAGE - 4;

/// The step of the CRC for each byte.
const TABLE: [u32; 256] = {
    let mut table = [0; 256];
    let mut byte = 0;
    while byte < 256 {
        let mut rest = byte as u32;
        let mut bit = 0;
        while bit < 8 {
            // Castagnoli's polynomial with reversed bits.
            rest = if rest & 1 == 1 { rest >> 1 ^ 0x82f6_3b78 } else { rest >> 1 };
            bit += 1;
        }
        table[byte] = rest;
        byte += 1;
    }
    table
};

/// The checksum of `bytes`.
pub(super) fn checksum(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(!0, |sum: u32, byte| sum >> 8 ^ TABLE[usize::from(sum as u8 ^ byte)])
}

/// A file without its checksums, which are checked while it is read.
pub(super) struct Pages<'i, 'a> {
    input: &'i mut Input<'a>,
    page: [u8; PAGE as usize],
    /// Number of the loaded page.
    loaded: Option<u64>,
    /// Offset of the next byte, without checksums.
    offset: u64,
    /// Bytes of the file, without checksums.
    len: u64,
}

impl<'i, 'a> Pages<'i, 'a> {
    /// The pages of `input`, whose length must be a multiple of a page.
    pub(super) fn of(input: &'i mut Input<'a>) -> Result<Self, Fault> {
        let len = input.len();
        if len == 0 || !len.is_multiple_of(PAGE) {
            return Err(Fault::malformed("the file", format!("pages of {PAGE} bytes"), format!("{len} bytes")));
        }
        Ok(Self { input, page: [0; PAGE as usize], loaded: None, offset: 0, len: len / PAGE * PAYLOAD })
    }

    /// The file with its checksums.
    pub(super) fn input(&mut self) -> &mut Input<'a> {
        self.input
    }

    /// The offset in the file, for errors.
    pub(super) fn place(&self) -> String {
        format!("byte {}", self.offset / PAYLOAD * PAGE + self.offset % PAYLOAD)
    }

    /// Bytes of the file, without checksums.
    pub(super) fn len(&self) -> u64 {
        self.len
    }

    /// Moves to `offset` in the file, where `what` begins.
    pub(super) fn go_to(&mut self, offset: u64, what: &str) -> Result<(), Fault> {
        if offset >= self.input.len() || offset % PAGE >= PAYLOAD {
            let found = format!("byte {offset}");
            return Err(Fault::malformed(what, format!("an offset within {} bytes", self.input.len()), found));
        }
        self.offset = offset / PAGE * PAYLOAD + offset % PAGE;
        Ok(())
    }

    /// Checks that `bytes` bytes are left.
    pub(super) fn expect_left(&self, bytes: u64, what: &str) -> Result<(), Fault> {
        let left = self.len - self.offset;
        if bytes <= left {
            return Ok(());
        }
        Err(Fault::malformed(self.place(), format!("{bytes} bytes of {what}"), format!("{left} bytes")))
    }

    /// Skips the next bytes.
    pub(super) fn skip(&mut self, bytes: u64, what: &str) -> Result<(), Fault> {
        self.expect_left(bytes, what)?;
        self.offset += bytes;
        Ok(())
    }

    /// Fills `bytes` with the next bytes.
    pub(super) fn fill(&mut self, mut bytes: &mut [u8], what: &str) -> Result<(), Fault> {
        self.expect_left(bytes.len() as u64, what)?;
        while !bytes.is_empty() {
            self.load(self.offset / PAYLOAD)?;
            let start = (self.offset % PAYLOAD) as usize;
            let taken = bytes.len().min(PAYLOAD as usize - start);
            let (now, later) = bytes.split_at_mut(taken);
            now.copy_from_slice(&self.page[start..start + taken]);
            self.offset += taken as u64;
            bytes = later;
        }
        Ok(())
    }

    fn load(&mut self, page: u64) -> Result<(), Fault> {
        if self.loaded == Some(page) {
            return Ok(());
        }
        self.loaded = None;
        self.input.go_to(page * PAGE)?;
        self.input.fill(&mut self.page, "a page")?;
        let (bytes, stored) = self.page.split_at(PAYLOAD as usize);
        let (found, stored) = (checksum(bytes), u32::from_be_bytes(bytes_at(stored, 0)));
        if found != stored {
            let place = format!("the page at byte {}", page * PAGE);
            return Err(Fault::malformed(place, format!("the checksum {stored:08x}"), format!("{found:08x}")));
        }
        self.loaded = Some(page);
        Ok(())
    }
}
