//! The packets of a scan: for each field a stream of bits, of which every packet has a piece.

use super::pages::Pages;
use crate::import::Fault;

/// The most bytes that streams may have ahead of what the slowest of them has.
const MAX_AHEAD: usize = 1 << 24;

/// A field's numbers, one after the other without gaps.
pub(super) struct Stream {
    /// Bits of a number; 0 where all are alike.
    bits: u32,
    bytes: Vec<u8>,
    /// Bits of `bytes` that are done with.
    done: usize,
}

impl Stream {
    pub(super) fn new(bits: u32) -> Self {
        Self { bits, bytes: Vec::new(), done: 0 }
    }

    /// Numbers that are there; None for any number of them.
    fn available(&self) -> Option<usize> {
        (8 * self.bytes.len() - self.done).checked_div(self.bits as usize)
    }

    /// The number `at` of those that are there.
    pub(super) fn number(&self, at: usize) -> u64 {
        if self.bits == 0 {
            return 0;
        }
        let start = self.done + at * self.bits as usize;
        let bytes = start / 8..(start + self.bits as usize).div_ceil(8);
        // 64 bits lie in nine bytes at most.
        let mut window = [0; 16];
        window[..bytes.len()].copy_from_slice(&self.bytes[bytes]);
        (u128::from_le_bytes(window) >> (start % 8)) as u64 & (u64::MAX >> (64 - self.bits))
    }

    fn finish(&mut self, numbers: usize) {
        self.done += numbers * self.bits as usize;
    }

    fn append(&mut self, bytes: usize, pages: &mut Pages<'_, '_>) -> Result<(), Fault> {
        self.bytes.drain(..self.done / 8);
        self.done %= 8;
        let start = self.bytes.len();
        self.bytes.resize(start + bytes, 0);
        pages.fill(&mut self.bytes[start..], "a packet")
    }
}

/// Takes streams, and how many numbers all of them have.
type Sink<'a> = dyn FnMut(&[Stream], usize) -> Result<(), Fault> + 'a;

/// Reads packets from where `pages` are until `records` are read; `sink` takes those that are there, and how many.
///
/// # Errors
///
/// If a packet is none, if there are too few of them, and those of `sink`.
pub(super) fn read(
    pages: &mut Pages<'_, '_>,
    streams: &mut [Stream],
    records: u64,
    sink: &mut Sink<'_>,
) -> Result<(), Fault> {
    let mut left = records;
    while left > 0 {
        let place = pages.place();
        let mut head = [0; 4];
        pages.fill(&mut head, "a packet")?;
        let length = u64::from(u16::from_le_bytes([head[2], head[3]])) + 1;
        match head[0] {
            // An index, or nothing.
            0 | 2 if length >= 4 => pages.skip(length - 4, "a packet")?,
            1 => append(pages, streams, length, &place)?,
            kind => return Err(Fault::malformed(place, "a packet", format!("kind {kind} of {length} bytes"))),
        }
        let there = streams.iter().filter_map(Stream::available).min().unwrap_or(0);
        let taken = left.min(there as u64) as usize;
        left -= taken as u64;
        sink(streams, taken)?;
        streams.iter_mut().for_each(|stream| stream.finish(taken));
        if left > 0 && streams.iter().map(|stream| stream.bytes.len() - stream.done / 8).sum::<usize>() > MAX_AHEAD {
            return Err(Fault::malformed(place, "streams that keep step", format!("one {MAX_AHEAD} bytes ahead")));
        }
    }
    Ok(())
}

fn append(pages: &mut Pages<'_, '_>, streams: &mut [Stream], length: u64, place: &str) -> Result<(), Fault> {
    let mut count = [0; 2];
    pages.fill(&mut count, "a packet")?;
    let count = u16::from_le_bytes(count);
    if usize::from(count) != streams.len() {
        return Err(Fault::malformed(place, format!("{} streams", streams.len()), count));
    }
    let mut sizes = vec![0; 2 * streams.len()];
    pages.fill(&mut sizes, "a packet")?;
    let sizes: Vec<usize> = sizes.chunks_exact(2).map(|s| u16::from_le_bytes([s[0], s[1]]).into()).collect();
    let used = 6 + 2 * streams.len() as u64 + sizes.iter().map(|size| *size as u64).sum::<u64>();
    if used > length {
        return Err(Fault::malformed(place, format!("a packet of {length} bytes"), format!("streams of {used}")));
    }
    for (stream, size) in streams.iter_mut().zip(sizes) {
        stream.append(size, pages)?;
    }
    pages.skip(length - used, "a packet")
}
