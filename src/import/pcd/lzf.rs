//! LZF decompression: literal bytes, and copies of some of the last 8192 bytes.
//!
//! A control byte n < 32 is followed by n + 1 literal bytes. Otherwise it is a copy. The upper three bits of the
//! control byte are the length less 2; if they are 7, a byte follows and is added to the length. The lower five bits
//! and the next byte are the distance less 1.

use crate::{Fault, Input, Visitor};

/// A copy of 264 bytes takes three bytes.
pub(super) const MAX_EXPANSION: u64 = 264 / 3;

/// Largest distance of a copy.
const WINDOW: usize = 1 << 13;

/// Decompressed bytes of one call of the sink.
const BATCH: usize = 1 << 18;

/// Decompresses the next `packed` bytes of `input` to `size` bytes, and passes them to `sink` with their offset.
///
/// # Errors
///
/// If the decompressed size is not `size`, a copy begins before the first byte, and those of `visitor`.
pub(super) fn decompress(
    input: &mut Input<'_>,
    packed: u64,
    size: u64,
    visitor: &mut dyn Visitor,
    sink: &mut dyn FnMut(u64, &[u8]),
) -> Result<(), Fault> {
    let end = input.offset() + packed;
    let mut bytes: Vec<u8> = Vec::with_capacity(WINDOW + BATCH + 264);
    // `bytes` begins with the last `window` bytes that `sink` received.
    let (mut sunk, mut window) = (0_u64, 0);
    while input.offset() < end {
        let place = input.place();
        let left = |input: &Input<'_>, bytes: u64| {
            let fits = input.offset() + bytes <= end;
            let expected = format!("{bytes} more compressed bytes");
            if fits { Ok(()) } else { Err(Fault::malformed(input.place(), expected, "the end")) }
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
                let problem = format!("a copy begins {} bytes back, before the first byte", back + 1);
                return Err(Fault::broken(place, problem));
            };
            // A copy may overlap its own output, which repeats bytes.
            for at in start..start + length {
                bytes.push(bytes[at]);
            }
        }
        let fresh = bytes.len() - window;
        if sunk + fresh as u64 > size {
            return Err(Fault::malformed(place, format!("{size} decompressed bytes"), "more"));
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
        return Err(Fault::malformed(input.place(), format!("{size} decompressed bytes"), sunk));
    }
    Ok(())
}
