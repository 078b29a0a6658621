//! A binary range coder, and the counters that adapt its probabilities (spec 2.5).

use std::fmt;
use std::hint::select_unpredictable;

use crate::container::Error;

/// Bits of a counter's probability.
const PRECISION: u32 = 22;
/// The most bits that a counter has seen: from then on the oldest lose their weight.
const MEMORY: u32 = 255;

/// Bits of a [`Counter`] for the bits seen.
const SEEN_BITS: u32 = 8;

/// \[bits seen\] the share, in 1/65536, of the way to the newest bit: 1 / (n + 1.6), rounded. The last one is not used.
const RATES: [u32; 1 << SEEN_BITS] = {
    let mut rates = [0; 1 << SEEN_BITS];
    let mut n = 0;
    while n < MEMORY {
        // 65536 / (n + 1.6) = 655360 / (10·n + 16)
        let divisor = 10 * n + 16;
        rates[n as usize] = (655_360 + divisor / 2) / divisor;
        n += 1;
    }
    rates
};

/// The probability that a bit is 1 in a context, from the bits that were there before: the probability, in 2⁻²², times 256,
/// plus the number of bits seen, at most 254. Tables of contexts are larger than the nearest cache, so a counter is one word.
#[derive(Clone, Copy, Debug)]
pub(super) struct Counter(u32);

impl Default for Counter {
    fn default() -> Self {
        Self(1 << (PRECISION - 1 + SEEN_BITS))
    }
}

impl Counter {
    /// The probability of a 1, in 1/65536: from 3 to 65 532, since a counter that has seen all its bits moves by 2⁻⁸ of the way.
    #[inline(always)]
    pub(super) fn probability(self) -> u32 {
        self.0 >> (SEEN_BITS + PRECISION - 16)
    }

    /// Bits seen.
    #[inline(always)]
    pub(super) fn seen(self) -> u32 {
        self.0 % (1 << SEEN_BITS)
    }

    /// Learns that the context had `bit`.
    #[inline(always)]
    fn learn(&mut self, bit: bool) {
        let (probability, seen) = (self.0 >> SEEN_BITS, self.seen());
        let part = |way: u32| ((u64::from(way) * u64::from(RATES[seen as usize])) >> 16 << SEEN_BITS) as u32;
        // The multiplication is in both branches, so that a processor begins the one that it expects.
        let moved = if bit { self.0 + part((1 << PRECISION) - probability) } else { self.0 - part(probability) };
        self.0 = moved + u32::from(seen < MEMORY - 1);
    }

    /// Learns `bit` like [`Counter::learn`], without a branch.
    #[inline(always)]
    fn learn_even(&mut self, bit: bool) {
        let (probability, seen) = (self.0 >> SEEN_BITS, self.seen());
        let way = select_unpredictable(bit, (1 << PRECISION) - probability, probability);
        let part = ((u64::from(way) * u64::from(RATES[seen as usize])) >> 16 << SEEN_BITS) as u32;
        self.0 =
            self.0.wrapping_add(select_unpredictable(bit, part, part.wrapping_neg())) + u32::from(seen < MEMORY - 1);
    }
}

/// An encoder or a decoder: one description of a model serves both.
pub(super) trait Coder {
    /// True for a decoder: it does not look at the bits that it is given.
    const DECODES: bool;

    /// The next bit, whose probability to be 1 is `probability`, in 1/65536. An encoder writes `bit` and returns it. The
    /// `counters` learn it.
    fn code<const N: usize>(&mut self, bit: bool, probability: u32, counters: [&mut Counter; N]) -> bool;

    /// Codes a bit like [`Coder::code_in`] whose value no processor can predict: a decoder does not branch on it.
    fn code_even(&mut self, bit: bool, counter: &mut Counter) -> bool;

    /// True for a decoder that is behind the end of its bytes: what it would still read does not matter.
    fn is_over(&self) -> bool {
        false
    }

    /// The next bit in the context of `counter`, which learns it.
    #[inline(always)]
    fn code_in(&mut self, bit: bool, counter: &mut Counter) -> bool {
        self.code(bit, counter.probability(), [counter])
    }
}

/// Bits that leave an interval, or enter it, together.
const WORD_BITS: u32 = 32;
const WORD_BYTES: usize = WORD_BITS as usize / 8;

/// How many numbers an interval has at first: all of 64 bits but the last.
const WHOLE: u64 = u64::MAX;

/// The numbers of a 1, the lower ones of `width`.
#[inline(always)]
fn width_of_one(width: u64, probability: u32) -> u64 {
    (width >> 16) * u64::from(probability)
}

/// True if an interval has fewer numbers than a word more would distinguish.
#[inline(always)]
fn is_narrow(width: u64) -> bool {
    width >> WORD_BITS == 0
}

/// Codes bits into bytes.
pub(super) struct BitEncoder {
    /// The interval: its first number, and how many it has.
    low: u64,
    width: u64,
    /// The digits before `low`.
    bytes: Vec<u8>,
}

impl BitEncoder {
    pub(super) fn new() -> Self {
        Self { low: 0, width: WHOLE, bytes: Vec::new() }
    }

    /// Makes the interval's first number larger.
    #[inline(always)]
    fn advance(&mut self, by: u64) {
        let (low, carries) = self.low.overflowing_add(by);
        self.low = low;
        if carries {
            for byte in self.bytes.iter_mut().rev() {
                *byte = byte.wrapping_add(1);
                if *byte != 0 {
                    break;
                }
            }
        }
    }

    /// The first word of `low` becomes digits.
    #[inline(always)]
    fn put_word(&mut self) {
        self.bytes.extend(&self.low.to_be_bytes()[..WORD_BYTES]);
        self.low <<= WORD_BITS;
    }

    /// All bytes. They end with the interval's largest number of one word, since the bytes that are not there count as zeros.
    pub(super) fn finish(mut self) -> Vec<u8> {
        self.advance(self.width - 1);
        self.put_word();
        self.bytes
    }
}

impl Coder for BitEncoder {
    const DECODES: bool = false;

    #[inline(always)]
    fn code<const N: usize>(&mut self, bit: bool, probability: u32, counters: [&mut Counter; N]) -> bool {
        let of_one = width_of_one(self.width, probability);
        if bit {
            self.width = of_one;
        } else {
            self.advance(of_one);
            self.width -= of_one;
        }
        counters.into_iter().for_each(|counter| counter.learn(bit));
        if is_narrow(self.width) {
            self.put_word();
            self.width <<= WORD_BITS;
        }
        bit
    }

    #[inline(always)]
    fn code_even(&mut self, bit: bool, counter: &mut Counter) -> bool {
        self.code_in(bit, counter)
    }
}

/// Reads bits from bytes, and zeros behind them.
pub(super) struct BitDecoder<'a> {
    /// How many numbers the interval has.
    width: u64,
    /// The number, less the interval's first one.
    offset: u64,
    bytes: &'a [u8],
    /// Bytes that have been read, counting those behind the end.
    read: usize,
}

impl<'a> BitDecoder<'a> {
    /// `place` is that of the bytes.
    pub(super) fn new(bytes: &'a [u8], place: &dyn fmt::Display) -> Result<Self, Error> {
        let mut decoder = Self { width: WHOLE, offset: 0, bytes, read: 0 };
        decoder.take_word();
        decoder.take_word();
        if decoder.offset == WHOLE {
            let place = format!("{place} first 8 bytes of the codec adaptive");
            return Err(Error::malformed(place, "not all 255", "all 255"));
        }
        Ok(decoder)
    }

    #[inline(always)]
    fn take_word(&mut self) {
        let word = match self.bytes.get(self.read..).and_then(<[u8]>::first_chunk) {
            Some(&word) => u32::from_be_bytes(word),
            None => self.last_word(),
        };
        self.offset = self.offset << WORD_BITS | u64::from(word);
        self.read += WORD_BYTES;
    }

    /// Takes a word if the interval is narrow.
    #[inline(always)]
    fn widen(&mut self) {
        if is_narrow(self.width) {
            self.width <<= WORD_BITS;
            self.take_word();
        }
    }

    /// The bytes from `read` on that are there, then zeros.
    #[cold]
    fn last_word(&self) -> u32 {
        let byte = |at| u32::from(self.bytes.get(at).copied().unwrap_or(0));
        (self.read..self.read + WORD_BYTES).fold(0, |word, at| word << 8 | byte(at))
    }

    /// Checks that the bytes are those that an encoder writes for the bits that were read. `place` is theirs.
    pub(super) fn finish(self, place: &dyn fmt::Display) -> Result<(), Error> {
        let expected = self.read - WORD_BYTES;
        Error::unless_equal(format!("{place} bytes of the codec adaptive"), expected, self.bytes.len())?;
        let found = self.bytes.last_chunk().map_or(0, |&word| u32::from_be_bytes(word));
        let expected = u64::from(found) + ((self.width - 1 - self.offset) >> WORD_BITS);
        Error::unless_equal(format!("{place} last 4 bytes of the codec adaptive"), expected, found.into())
    }
}

impl Coder for BitDecoder<'_> {
    const DECODES: bool = true;

    #[inline(always)]
    fn code<const N: usize>(&mut self, _: bool, probability: u32, counters: [&mut Counter; N]) -> bool {
        let of_one = width_of_one(self.width, probability);
        let bit = self.offset < of_one;
        // Most bits are what a processor expects. All that depends on one is within the branch, so that nothing waits for it.
        if bit {
            self.width = of_one;
            for counter in counters {
                counter.learn(true);
            }
        } else {
            self.offset -= of_one;
            self.width -= of_one;
            for counter in counters {
                counter.learn(false);
            }
        }
        self.widen();
        bit
    }

    #[inline(always)]
    fn code_even(&mut self, _: bool, counter: &mut Counter) -> bool {
        let of_one = width_of_one(self.width, counter.probability());
        let bit = self.offset < of_one;
        self.width = select_unpredictable(bit, of_one, self.width - of_one);
        self.offset -= select_unpredictable(bit, 0, of_one);
        counter.learn_even(bit);
        self.widen();
        bit
    }

    #[inline(always)]
    fn is_over(&self) -> bool {
        self.read > self.bytes.len() + WORD_BYTES
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;

    /// Bits of which one in eight is 1.
    fn bits(count: u64) -> Vec<bool> {
        let random = Random::new(7, "bits of a coder");
        (0..count).map(|n| random.uniform(n) < 0.125).collect()
    }

    /// `bits` encoded in `contexts` contexts by turns.
    fn encoded(bits: &[bool], contexts: usize) -> Vec<u8> {
        let (mut encoder, mut counters) = (BitEncoder::new(), vec![Counter::default(); contexts]);
        for (n, &bit) in bits.iter().enumerate() {
            assert_eq!(encoder.code_in(bit, &mut counters[n % contexts]), bit);
        }
        encoder.finish()
    }

    fn decoded(bytes: &[u8], count: usize, contexts: usize) -> Result<Vec<bool>, Error> {
        let (mut decoder, mut counters) = (BitDecoder::new(bytes, &"X")?, vec![Counter::default(); contexts]);
        let bits = (0..count).map(|n| decoder.code_in(false, &mut counters[n % contexts])).collect();
        decoder.finish(&"X")?;
        Ok(bits)
    }

    #[test]
    fn bits_are_read_as_written_in_about_their_entropy() {
        for (count, contexts) in [(0, 1), (1, 1), (2, 3), (100, 1), (50_000, 7)] {
            let bits = bits(count);
            let bytes = encoded(&bits, contexts);
            assert_eq!(decoded(&bytes, bits.len(), contexts), Ok(bits));
        }
        // 0.5436 bits each.
        let bytes = encoded(&bits(50_000), 1);
        assert!((3350..3480).contains(&bytes.len()), "{} bytes", bytes.len());
    }

    #[test]
    fn every_bit_can_be_coded() {
        for bit in [false, true] {
            let mut counter = Counter::default();
            (0..100_000).for_each(|_| counter.learn(bit));
            assert_eq!(counter.probability(), if bit { 65_532 } else { 3 });
        }
    }

    #[test]
    fn extreme_probabilities_are_kept_apart() {
        // Two thousand zeros where ones are expected, and the other way round.
        for expected in [false, true] {
            let mut bits = vec![expected; 5000];
            bits.extend(vec![!expected; 2000]);
            assert_eq!(decoded(&encoded(&bits, 1), bits.len(), 1), Ok(bits));
        }
    }

    #[test]
    fn other_lengths_and_last_bytes_are_refused() {
        let bits = bits(3000);
        let bytes = encoded(&bits, 4);
        for cut in 0..bytes.len() {
            // One in 256 is as long as what an encoder writes for the other bits that are read.
            assert_ne!(decoded(&bytes[..cut], bits.len(), 4).as_ref(), Ok(&bits), "cut at {cut}");
        }
        assert!(decoded(&[&bytes[..], &[0]].concat(), bits.len(), 4).is_err());
        let mut other = bytes.clone();
        *other.last_mut().unwrap() ^= 1;
        assert!(decoded(&other, bits.len(), 4).is_err());
    }
}
