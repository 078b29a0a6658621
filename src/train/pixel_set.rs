//! A set of pixels, which finds its member of a given number.

use std::sync::atomic::{AtomicU64, Ordering};

/// Pixels of a block, whose members are counted in advance.
const BLOCK: u64 = 512;
/// Words of a block.
const WORDS: usize = (BLOCK / 64) as usize;

/// A set of pixels: a bit for each, and the number of members before each block. A list of members takes 256 MB instead
/// of 8 MB for 100 photographs of 800×800.
#[derive(Clone, Debug, Default)]
pub(super) struct PixelSet {
    /// Bit p % 64 of word p / 64 is that of pixel p.
    words: Vec<u64>,
    /// \[block\] the number of members before it; then their number.
    before: Vec<u32>,
}

impl PixelSet {
    /// The set of pixels, of `pixels`, that `add` adds: it gets a function that adds a pixel, on any thread.
    pub(super) fn new(pixels: u64, add: impl FnOnce(&(dyn Fn(u64) + Sync))) -> Self {
        let words: Vec<AtomicU64> = (0..pixels.div_ceil(64)).map(|_| AtomicU64::new(0)).collect();
        // The order of additions does not matter, and the threads that make them end before the words are read.
        add(&|pixel| _ = words[(pixel / 64) as usize].fetch_or(1 << (pixel % 64), Ordering::Relaxed));
        Self::of_words(words.into_iter().map(AtomicU64::into_inner).collect())
    }

    fn of_words(words: Vec<u64>) -> Self {
        let mut before = vec![0];
        for block in words.chunks(WORDS) {
            let members: u32 = block.iter().map(|word| word.count_ones()).sum();
            before.push(before[before.len() - 1] + members);
        }
        Self { words, before }
    }

    /// Number of members.
    pub(super) fn len(&self) -> usize {
        self.before.last().map_or(0, |&members| members as usize)
    }

    /// Number of members before `pixel`, which may be one behind the last.
    pub(super) fn count_before(&self, pixel: u64) -> u64 {
        let block = (pixel / BLOCK) as usize;
        let word = (pixel / 64) as usize;
        let within: u32 = self.words[(block * WORDS).min(word)..word].iter().map(|word| word.count_ones()).sum();
        let rest = self.words.get(word).map_or(0, |word| (word & ((1 << (pixel % 64)) - 1)).count_ones());
        u64::from(self.before.get(block).map_or(0, |before| before + within + rest))
    }

    /// The member of number `n`, in ascending order.
    ///
    /// # Panics
    ///
    /// If there are not as many.
    pub(super) fn member(&self, n: u64) -> u64 {
        // A binary search over blocks, then at most eight words.
        let block = self.before.partition_point(|&before| u64::from(before) <= n) - 1;
        let mut rest = (n - u64::from(self.before[block])) as u32;
        let first = block * WORDS;
        for (w, &word) in self.words[first..].iter().enumerate() {
            if rest < word.count_ones() {
                let mut word = word;
                (0..rest).for_each(|_| word &= word - 1);
                return (first + w) as u64 * 64 + u64::from(word.trailing_zeros());
            }
            rest -= word.count_ones();
        }
        panic!("the set has no member {n}")
    }

    /// One bit for each of `pixels` pixels, least significant first.
    pub(super) fn to_bytes(&self, pixels: u64) -> Vec<u8> {
        let mut bytes: Vec<u8> = self.words.iter().flat_map(|word| word.to_le_bytes()).collect();
        bytes.resize(pixels.div_ceil(8) as usize, 0);
        bytes
    }

    /// The set of [`PixelSet::to_bytes`]; bits of pixels beyond `pixels` are ignored.
    pub(super) fn from_bytes(bytes: &[u8], pixels: u64) -> Self {
        let word = |bytes: &[u8]| {
            let mut word = [0; 8];
            word[..bytes.len()].copy_from_slice(bytes);
            u64::from_le_bytes(word)
        };
        let mut words: Vec<u64> = bytes.chunks(8).map(word).collect();
        if let Some(last) = words.last_mut().filter(|_| !pixels.is_multiple_of(64)) {
            *last &= (1 << (pixels % 64)) - 1;
        }
        Self::of_words(words)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PIXELS: u64 = 3000;

    fn every(step: usize) -> PixelSet {
        PixelSet::new(PIXELS, |add| (0..PIXELS).step_by(step).for_each(add))
    }

    #[test]
    fn members_are_numbered_in_ascending_order() {
        for step in [1, 7, 64, 700] {
            let set = every(step);
            let members: Vec<u64> = (0..set.len() as u64).map(|n| set.member(n)).collect();
            assert_eq!(members, (0..PIXELS).step_by(step).collect::<Vec<_>>());
            for pixel in 0..=PIXELS {
                let before = members.partition_point(|&member| member < pixel) as u64;
                assert_eq!(set.count_before(pixel), before, "every {step}, before {pixel}");
            }
        }
    }

    #[test]
    fn bytes_give_the_set_back_without_pixels_that_do_not_exist() {
        let set = every(7);
        let mut bytes = set.to_bytes(PIXELS);
        assert_eq!(bytes.len(), PIXELS.div_ceil(8) as usize);
        assert_eq!(PixelSet::from_bytes(&bytes, PIXELS).words, set.words);
        *bytes.last_mut().unwrap() = u8::MAX;
        assert_eq!(
            PixelSet::from_bytes(&bytes, PIXELS - 6).count_before(PIXELS),
            PixelSet::from_bytes(&bytes, PIXELS - 6).len() as u64
        );
    }
}
