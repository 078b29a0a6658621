//! The bits of a scan's data: entropy-coded segments between markers.

use super::JpegError;
use super::tables::{Huffman, LOOKUP_BITS};

/// Bits that are kept at least where data are left.
const MIN_BITS: u32 = 32;

/// A reader of the data of a scan.
#[derive(Debug)]
pub(super) struct Bits<'a> {
    bytes: &'a [u8],
    /// The next byte that is not among `bits`.
    at: usize,
    /// The next bits, from the highest on, then zeros.
    bits: u64,
    /// Number of bits before the zeros.
    count: u32,
}

impl<'a> Bits<'a> {
    pub(super) fn new(bytes: &'a [u8]) -> Self {
        Self { bytes, at: 0, bits: 0, count: 0 }
    }

    /// Takes in bytes up to the next marker until no more fit.
    #[inline]
    fn refill(&mut self) {
        if self.count >= MIN_BITS {
            return;
        }
        while self.count <= 56 {
            let Some(&byte) = self.bytes.get(self.at) else { return };
            if byte == 0xff {
                // A zero byte is stuffed behind 0xff; anything else is a marker, or fill before one.
                if self.bytes.get(self.at + 1) != Some(&0) {
                    return;
                }
                self.at += 1;
            }
            self.at += 1;
            self.bits |= u64::from(byte) << (56 - self.count);
            self.count += 8;
        }
    }

    /// Drops the next `count` bits.
    #[inline]
    fn drop_bits(&mut self, count: u32) -> Result<(), JpegError> {
        // Fewer are left if the file is cut here.
        self.count = self.count.checked_sub(count).ok_or(JpegError::Truncated)?;
        self.bits <<= count;
        Ok(())
    }

    /// The next `count` bits, at most 16.
    #[inline]
    pub(super) fn take(&mut self, count: u32) -> Result<i32, JpegError> {
        if count == 0 {
            return Ok(0);
        }
        self.refill();
        let taken = (self.bits >> (64 - count)) as i32;
        self.drop_bits(count)?;
        Ok(taken)
    }

    /// The next bit.
    #[inline]
    pub(super) fn is_set(&mut self) -> Result<bool, JpegError> {
        Ok(self.take(1)? == 1)
    }

    /// The next symbol of `table`.
    #[inline]
    pub(super) fn symbol(&mut self, table: &Huffman) -> Result<u8, JpegError> {
        self.refill();
        let (length, symbol) = table.lookup[(self.bits >> (64 - LOOKUP_BITS)) as usize];
        if length > 0 {
            self.drop_bits(u32::from(length))?;
            return Ok(symbol);
        }
        let next = (self.bits >> 48) as u32;
        let length = (LOOKUP_BITS + 1..=16).find(|&length| next < table.ends[length]);
        let Some(length) = length else {
            return Err(if self.count < 16 {
                JpegError::Truncated
            } else {
                JpegError::Damaged("a code has no symbol")
            });
        };
        self.drop_bits(length as u32)?;
        let place = (next >> (16 - length)) as i32 + table.offsets[length];
        Ok(table.symbols[place as usize])
    }

    /// The number of the next `size` bits, as standard, F.2.2.1, extends them.
    #[inline]
    pub(super) fn number(&mut self, size: u8) -> Result<i32, JpegError> {
        let value = self.take(u32::from(size))?;
        let is_negative = size > 0 && value < 1 << (size - 1);
        Ok(if is_negative { value - (1 << size) + 1 } else { value })
    }

    /// Drops the rest of a segment and the restart marker number `number`, modulo 8, behind it.
    pub(super) fn restart(&mut self, number: u32) -> Result<(), JpegError> {
        (self.bits, self.count) = (0, 0);
        let rest = &self.bytes[self.at..];
        let marker = rest.windows(2).position(|pair| pair[0] == 0xff && !matches!(pair[1], 0x00 | 0xff));
        let marker = marker.ok_or(JpegError::Truncated)?;
        if rest[marker + 1] != 0xd0 | (number % 8) as u8 {
            // The end mark, or the next scan, before all lines are there.
            let is_end = !matches!(rest[marker + 1], 0xd0..=0xd7);
            return Err(if is_end { JpegError::Truncated } else { JpegError::Damaged("a restart marker is missing") });
        }
        self.at += marker + 2;
        Ok(())
    }

    /// Number of bytes taken in, none of which is of a marker behind the scan.
    pub(super) fn position(&self) -> usize {
        self.at
    }
}
