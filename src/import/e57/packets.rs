//! The packets of a scan. Each field is a stream of bits, and each packet holds a piece of every stream.

use super::pages::Pages;
use crate::Fault;

/// Bytes that streams may be ahead of the slowest one.
const MAX_AHEAD: usize = 1 << 24;

/// The numbers of a field, packed without gaps.
pub(super) struct NumberStream {
    /// Bits of a number; 0 if all numbers are equal.
    bits: u32,
    bytes: Vec<u8>,
    /// Bits of `bytes` that have been read.
    done: usize,
}

impl NumberStream {
    pub(super) fn new(bits: u32) -> Self {
        Self { bits, bytes: Vec::new(), done: 0 }
    }

    /// Number of complete numbers; `None` if numbers have no bits.
    fn available(&self) -> Option<usize> {
        (8 * self.bytes.len() - self.done).checked_div(self.bits as usize)
    }

    /// Number `at` of the available ones.
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

/// Receives the streams and how many numbers each of them has.
type Sink<'a> = dyn FnMut(&[NumberStream], usize) -> Result<(), Fault> + 'a;

/// Reads packets from the current offset until `records` records are read, and passes them to `sink` in batches.
///
/// # Errors
///
/// If a packet is invalid, the packets end early, and those of `sink`.
pub(super) fn read(
    pages: &mut Pages<'_, '_>,
    streams: &mut [NumberStream],
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
            // An index packet or an ignored one.
            0 | 2 if length >= 4 => pages.skip(length - 4, "a packet")?,
            1 => append(pages, streams, length, &place)?,
            kind => {
                return Err(Fault::malformed(
                    place,
                    "a packet of kind 0 to 2",
                    format!("kind {kind} of {length} bytes"),
                ));
            }
        }
        let there = streams.iter().filter_map(NumberStream::available).min().unwrap_or(0);
        let taken = left.min(there as u64) as usize;
        left -= taken as u64;
        sink(streams, taken)?;
        streams.iter_mut().for_each(|stream| stream.finish(taken));
        if left > 0 && streams.iter().map(|stream| stream.bytes.len() - stream.done / 8).sum::<usize>() > MAX_AHEAD {
            let problem = format!("a stream is more than {MAX_AHEAD} bytes ahead of another one");
            return Err(Fault::broken(place, problem));
        }
    }
    Ok(())
}

fn append(pages: &mut Pages<'_, '_>, streams: &mut [NumberStream], length: u64, place: &str) -> Result<(), Fault> {
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
        let problem = format!("the streams need {used} bytes, but the packet has {length}");
        return Err(Fault::broken(place, problem));
    }
    for (stream, size) in streams.iter_mut().zip(sizes) {
        stream.append(size, pages)?;
    }
    pages.skip(length - used, "a packet")
}
