//! LZF: bytes as they are, and copies of some of the last 8192.
//!
//! A control byte below 32 stands before that many bytes and one, which are themselves. In any other, the upper three bits
//! are a copy's length less two, with 7 meaning that a byte with the rest of the length follows; the lower five and the
//! byte after that are how far back the copy begins, less one.

use crate::import::{Fault, Input, Visitor};

/// A copy of 264 bytes takes three.
pub(super) const MAX_EXPANSION: u64 = 264 / 3;

/// How far back copies reach.
const WINDOW: usize = 1 << 13;

/// Decompressed bytes that are handed on at once.
const BATCH: usize = 1 << 18;

/// Decompresses the next `packed` bytes of `input`, which are to be `size`, and gives them to `sink` with their offset.
///
/// # Errors
///
/// If they are more or fewer, if a copy begins before the first byte, and those of `visitor`.
pub(super) fn decompress(
    input: &mut Input<'_>,
    packed: u64,
    size: u64,
    visitor: &mut dyn Visitor,
    sink: &mut dyn FnMut(u64, &[u8]),
) -> Result<(), Fault> {
    let end = input.offset() + packed;
    let mut bytes: Vec<u8> = Vec::with_capacity(WINDOW + BATCH + 264);
    // `bytes` begins with the `window` last bytes of what `sink` had.
    let (mut sunk, mut window) = (0_u64, 0);
    while input.offset() < end {
        let place = input.place();
        let left = |input: &Input<'_>, bytes: u64| {
            let fits = input.offset() + bytes <= end;
            let expected = format!("{bytes} more compressed bytes");
            if fits { Ok(()) } else { Err(Fault::malformed(input.place(), expected, "their end")) }
        };
        let [control] = input.array("compressed points")?;
        if control < 32 {
            let length = usize::from(control) + 1;
            left(input, length as u64)?;
            let start = bytes.len();
            bytes.resize(start + length, 0);
            input.fill(&mut bytes[start..], "compressed points")?;
        } else {
            let mut length = usize::from(control >> 5) + 2;
            if length == 9 {
                left(input, 1)?;
                length += usize::from(input.array::<1>("a copy's length")?[0]);
            }
            left(input, 1)?;
            let [low] = input.array("a copy's place")?;
            let back = usize::from(control & 31) << 8 | usize::from(low);
            let Some(start) = bytes.len().checked_sub(back + 1) else {
                return Err(Fault::malformed(place, "a copy of what was before", format!("{} bytes back", back + 1)));
            };
            // A copy may run into itself, which repeats it.
            for at in start..start + length {
                bytes.push(bytes[at]);
            }
        }
        let fresh = bytes.len() - window;
        if sunk + fresh as u64 > size {
            return Err(Fault::malformed(place, format!("{size} bytes when decompressed"), "more"));
        }
        if fresh >= BATCH {
            sink(sunk, &bytes[window..]);
            sunk += fresh as u64;
            bytes.drain(..bytes.len() - WINDOW);
            window = WINDOW;
            input.report(visitor)?;
        }
    }
    sink(sunk, &bytes[window..]);
    sunk += (bytes.len() - window) as u64;
    if sunk < size {
        return Err(Fault::malformed(input.place(), format!("{size} bytes when decompressed"), sunk));
    }
    Ok(())
}
