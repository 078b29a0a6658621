//! A binary range coder without carries, and the counters that adapt its probabilities (spec 2.5).

use std::fmt;

use crate::container::Error;

/// Bits of a counter's probability.
const PRECISION: u32 = 22;
/// The most bits that a counter has seen: from then on it forgets the oldest.
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
}

/// An encoder or a decoder: one description of a model serves both.
pub(super) trait Coder {
    /// True for a decoder: it does not look at the bits that it is given.
    const DECODES: bool;

    /// The next bit, whose probability to be 1 is `probability`, in 1/65536. An encoder writes `bit` and returns it. The
    /// `counters` learn it.
    fn code<const N: usize>(&mut self, bit: bool, probability: u32, counters: [&mut Counter; N]) -> bool;

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

/// The numbers that the next bytes may be: `low` to `low + span`.
#[derive(Clone, Copy, Debug)]
struct Interval {
    low: u32,
    span: u32,
}

impl Interval {
    const WHOLE: Self = Self { low: 0, span: u32::MAX };

    /// Numbers but one in the part of a 1, the lower one.
    #[inline(always)]
    fn span_of_one(self, probability: u32) -> u32 {
        ((u64::from(self.span) * u64::from(probability)) >> 16) as u32
    }

    /// Narrows it to the part of `bit`.
    #[inline(always)]
    fn narrow(&mut self, bit: bool, span_of_one: u32) {
        if bit {
            self.span = span_of_one;
        } else {
            self.low += span_of_one + 1;
            self.span -= span_of_one + 1;
        }
    }

    /// The first byte of its last number.
    #[inline(always)]
    fn last_byte(self) -> u8 {
        ((self.low + self.span) >> 24) as u8
    }

    /// Drops the first byte if all its numbers have the same.
    #[inline(always)]
    fn take_byte(&mut self) -> Option<u8> {
        let byte = self.last_byte();
        ((self.low >> 24) as u8 == byte).then(|| {
            (self.low, self.span) = (self.low << 8, self.span << 8 | 0xff);
            byte
        })
    }
}

/// Codes bits into bytes.
pub(super) struct Encoder {
    interval: Interval,
    bytes: Vec<u8>,
}

impl Encoder {
    pub(super) fn new() -> Self {
        Self { interval: Interval::WHOLE, bytes: Vec::new() }
    }

    /// All bytes. The last one is the first of the interval's last number, since the bytes that are not there count as zeros.
    pub(super) fn finish(mut self) -> Vec<u8> {
        self.bytes.push(self.interval.last_byte());
        self.bytes
    }
}

impl Coder for Encoder {
    const DECODES: bool = false;

    #[inline(always)]
    fn code<const N: usize>(&mut self, bit: bool, probability: u32, counters: [&mut Counter; N]) -> bool {
        self.interval.narrow(bit, self.interval.span_of_one(probability));
        counters.into_iter().for_each(|counter| counter.learn(bit));
        while let Some(byte) = self.interval.take_byte() {
            self.bytes.push(byte);
        }
        bit
    }
}

/// Reads bits from bytes, and zeros behind them.
pub(super) struct Decoder<'a> {
    interval: Interval,
    /// The number, less the interval's low end.
    offset: u32,
    bytes: &'a [u8],
    /// Bytes that the interval has dropped.
    dropped: usize,
}

impl<'a> Decoder<'a> {
    pub(super) fn new(bytes: &'a [u8]) -> Self {
        let mut decoder = Self { interval: Interval::WHOLE, offset: 0, bytes, dropped: 0 };
        for at in 0..4 {
            decoder.offset = decoder.offset << 8 | decoder.byte(at);
        }
        decoder
    }

    #[inline(always)]
    fn byte(&self, at: usize) -> u32 {
        u32::from(self.bytes.get(at).copied().unwrap_or(0))
    }

    /// Checks that the bytes are those that an encoder writes for the bits that were read. `place` is theirs.
    pub(super) fn finish(self, place: &dyn fmt::Display) -> Result<(), Error> {
        Error::unless_equal(format!("{place} bytes of the codec adaptive"), self.dropped + 1, self.bytes.len())?;
        let last = u32::from(self.interval.last_byte());
        Error::unless_equal(format!("{place} last byte of the codec adaptive"), last, self.byte(self.dropped))
    }
}

impl Coder for Decoder<'_> {
    const DECODES: bool = true;

    #[inline(always)]
    fn code<const N: usize>(&mut self, _: bool, probability: u32, counters: [&mut Counter; N]) -> bool {
        let span_of_one = self.interval.span_of_one(probability);
        let bit = self.offset <= span_of_one;
        // Most bits are what a processor expects. All that depends on one is within the branch, so that nothing waits for it.
        if bit {
            self.interval.narrow(true, span_of_one);
            for counter in counters {
                counter.learn(true);
            }
        } else {
            self.offset -= span_of_one + 1;
            self.interval.narrow(false, span_of_one);
            for counter in counters {
                counter.learn(false);
            }
        }
        while self.interval.take_byte().is_some() {
            self.offset = self.offset << 8 | self.byte(self.dropped + 4);
            self.dropped += 1;
        }
        bit
    }

    #[inline(always)]
    fn is_over(&self) -> bool {
        self.dropped > self.bytes.len()
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

    /// In `contexts` contexts by turns.
    fn encoded(bits: &[bool], contexts: usize) -> Vec<u8> {
        let (mut encoder, mut counters) = (Encoder::new(), vec![Counter::default(); contexts]);
        for (n, &bit) in bits.iter().enumerate() {
            assert_eq!(encoder.code_in(bit, &mut counters[n % contexts]), bit);
        }
        encoder.finish()
    }

    fn decoded(bytes: &[u8], count: usize, contexts: usize) -> Result<Vec<bool>, Error> {
        let (mut decoder, mut counters) = (Decoder::new(bytes), vec![Counter::default(); contexts]);
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
