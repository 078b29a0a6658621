//! Counter-based random numbers: every draw is a pure function of its key, so results do not depend on the order of
//! threads, and a resumed run needs no generator state.

/// A stream of draws, named by a seed and a purpose.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Random {
    key: u64,
}

/// The finalizer of SplitMix64 (Steele, Lea and Flood, 2014).
fn mix(mut z: u64) -> u64 {
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

impl Random {
    /// The stream of `purpose` under `seed`.
    pub fn new(seed: u64, purpose: &str) -> Self {
        let key = purpose.bytes().fold(mix(seed ^ 0x9e37_79b9_7f4a_7c15), |k, byte| mix(k ^ u64::from(byte)));
        Self { key }
    }

    /// The stream number `index` of this one.
    pub fn substream(&self, index: u64) -> Self {
        Self { key: mix(self.key ^ mix(index.wrapping_add(0x9e37_79b9_7f4a_7c15))) }
    }

    /// Draw number `counter`: 64 random bits.
    pub fn bits(&self, counter: u64) -> u64 {
        mix(self.key.wrapping_add(counter.wrapping_mul(0x9e37_79b9_7f4a_7c15)))
    }

    /// Draw number `counter`: a whole number in 0..`end`, uniform to within 2⁻⁶⁴·`end`.
    pub fn below(&self, counter: u64, end: u64) -> u64 {
        ((u128::from(self.bits(counter)) * u128::from(end)) >> 64) as u64
    }

    /// Draw number `counter`: uniform in [0, 1), a multiple of 2⁻⁵³.
    pub fn uniform(&self, counter: u64) -> f64 {
        (self.bits(counter) >> 11) as f64 * (1.0 / (1u64 << 53) as f64)
    }

    /// Draw number `counter`: standard normal (Box and Muller).
    pub fn normal(&self, counter: u64) -> f64 {
        let radius = (-2.0 * (1.0 - self.uniform(2 * counter)).ln()).sqrt();
        radius * (std::f64::consts::TAU * self.uniform(2 * counter + 1)).cos()
    }

    /// The image of `index` under this stream's permutation of 0..`len`: a Feistel network over the smallest even
    /// number of bits that holds `len`, applied until the result is below `len`.
    pub fn permuted(&self, index: u64, len: u64) -> u64 {
        assert!(index < len, "index {index} of {len}");
        let half_bits = (64 - (len - 1).leading_zeros()).div_ceil(2).max(1);
        let mask = (1u64 << half_bits) - 1;
        let mut value = index;
        loop {
            let (mut left, mut right) = (value >> half_bits, value & mask);
            for round in 0..4 {
                (left, right) = (right, left ^ (self.bits(right | round << 62) & mask));
            }
            value = left << half_bits | right;
            if value < len {
                return value;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn permutation_visits_everything_once_and_depends_on_the_stream() {
        for len in [1, 2, 3, 17, 1000] {
            let order = |i| {
                let stream = Random::new(7, "test").substream(i);
                (0..len).map(|index| stream.permuted(index, len)).collect::<Vec<_>>()
            };
            let mut sorted = order(0);
            sorted.sort_unstable();
            assert_eq!(sorted, (0..len).collect::<Vec<_>>());
            assert!(len < 17 || order(0) != order(1));
        }
    }

    #[test]
    fn moments_are_those_of_the_distributions() {
        let stream = Random::new(3, "moments");
        let n = 100_000;
        let mean = |f: &dyn Fn(u64) -> f64| (0..n).map(f).sum::<f64>() / n as f64;
        assert!((mean(&|i| stream.uniform(i)) - 0.5).abs() < 0.005);
        assert!(mean(&|i| stream.normal(i)).abs() < 0.02);
        assert!((mean(&|i| stream.normal(i).powi(2)) - 1.0).abs() < 0.02);
    }
}
