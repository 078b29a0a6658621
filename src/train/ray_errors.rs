//! Rays drawn by their error. A step has more candidates than rays, and those where errors are large are drawn with a
//! larger probability. A ray's error counts 1 over its probability, so that the loss and its gradients have the same
//! expectation as if all rays were drawn alike, and less variance: a few pixels at edges have most of the squared error.

use rayon::prelude::*;

use super::RaySampler;
use strivec_format::random::Random;

/// The share of the probability that does not depend on the error. It bounds the weight of a ray, which is one over
/// its probability.
const FLOOR: f64 = 0.2;
/// The weight of a new ray in the mean error of its block.
const RATE: f32 = 0.2;

/// \[block\] the mean squared error of its last rays, which count less and less; negative before the first.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct RayErrors(pub(super) Vec<f32>);

/// A pixel whose ray is drawn.
#[derive(Clone, Copy, Debug)]
pub(super) struct DrawnPixel {
    /// The number of the draw, in the sequence of [`RaySampler::pixel`].
    pub(super) draw: u64,
    /// The pixel, counted over all photographs.
    pub(super) pixel: u64,
    /// How often the ray's error counts.
    pub(super) weight: f32,
}

impl RayErrors {
    /// The errors of `blocks` blocks of pixels, not known yet.
    pub(super) fn unknown(blocks: usize) -> Self {
        Self(vec![-1.0; blocks])
    }

    /// Counts the squared error of a ray of `block`.
    pub(super) fn add(&mut self, block: u32, squared: f32) {
        let mean = &mut self.0[block as usize];
        *mean = if *mean < 0.0 { squared } else { *mean + RATE * (squared - *mean) };
    }

    /// `count` pixels of step number `step`, of `candidates` as many in the sequence of `order`.
    pub(super) fn draw(
        &self,
        sampler: &RaySampler<'_>,
        order: &Random,
        step: u64,
        count: usize,
        candidates: u32,
    ) -> Vec<DrawnPixel> {
        let first = step * count as u64 * u64::from(candidates);
        let draws = first..first + count as u64 * u64::from(candidates);
        let candidate = |draw| {
            let pixel = sampler.pixel(order, draw);
            // The root of the mean squared error: growing with the error itself gains 0.12 instead of 0.31 dB
            // (docs/experiments/2026-11-26-rays-by-error.md).
            (pixel, f64::from(self.0[sampler.block(pixel) as usize]).sqrt())
        };
        let (pixels, errors): (Vec<u64>, Vec<f64>) = draws.into_par_iter().map(candidate).unzip();
        let probabilities = inclusion_probabilities(errors, count);
        // Systematic sampling draws exactly `count` rays by one random number, and no ray twice.
        let chosen = systematic_sample(&probabilities, order.substream(u64::MAX).uniform(step));
        let drawn = |n: usize| DrawnPixel {
            draw: first + n as u64,
            pixel: pixels[n],
            weight: (1.0 / (probabilities[n] * f64::from(candidates))) as f32,
        };
        chosen.into_iter().map(drawn).collect()
    }
}

/// The indices that systematic sampling chooses: those where the running sum of `probabilities` passes `offset`, in \[0, 1),
/// plus a whole number. They are as many as the sum, which is a whole number.
fn systematic_sample(probabilities: &[f64], offset: f64) -> Vec<usize> {
    // More than 0 and less than 1, both by more than the sum's rounding.
    let mut next = 1e-6 + offset * (1.0 - 2e-6);
    let mut sum = 0.0;
    let mut passes = |probability: &f64| {
        sum += probability;
        let passes = sum > next;
        next += if passes { 1.0 } else { 0.0 };
        passes
    };
    (0..probabilities.len()).filter(|&n| passes(&probabilities[n])).collect()
}

/// Probabilities whose sum is `count`, at most as many as there are `errors`: a floor and a part proportional to the error,
/// which is not a number if it is unknown, but at most 1.
fn inclusion_probabilities(errors: Vec<f64>, count: usize) -> Vec<f64> {
    let mut sizes = errors;
    let known = sizes.iter().copied().filter(|error| error.is_finite());
    let (number, sum) = known.fold((0, 0.0), |(number, sum), error| (number + 1, sum + error));
    // Blocks without a ray so far count as the mean: they are neither avoided nor sought.
    let mean = if sum > 0.0 { sum / f64::from(number) } else { 1.0 };
    for size in &mut sizes {
        let relative = if size.is_finite() && sum > 0.0 { *size / mean } else { 1.0 };
        *size = FLOOR + (1.0 - FLOOR) * relative;
    }
    // Those that are certain at some factor are so at the next one, which is larger.
    let mut factor = 0.0;
    loop {
        let (mut certain, mut others) = (0, 0.0);
        for size in &sizes {
            if size * factor >= 1.0 { certain += 1 } else { others += size }
        }
        let next = (count - certain) as f64 / others;
        if next.is_nan() || next <= factor {
            return sizes.into_iter().map(|size| (size * factor).min(1.0)).collect();
        }
        factor = next;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Errors of which a few are much larger than the others, and some unknown.
    fn errors() -> Vec<f64> {
        let of = |n: u32| if n % 7 == 3 { f64::NAN } else { f64::from(n % 10).powi(4) * 1e-5 };
        (0..200).map(of).collect()
    }

    #[test]
    fn probabilities_grow_with_errors_and_have_the_sum() {
        for count in [1, 50, 100, 150, 200] {
            let probabilities = inclusion_probabilities(errors(), count);
            let sum: f64 = probabilities.iter().sum();
            assert!((sum - count as f64).abs() < 1e-9, "{sum} of {count}");
            assert!(probabilities.iter().all(|&p| p > 0.0 && p <= 1.0), "{count}: {probabilities:?}");
            assert!(probabilities[2] <= probabilities[4] && probabilities[4] <= probabilities[19]);
            assert_eq!(probabilities[19] - probabilities[0] > 1e-6, count < 200, "{count}");
        }
        let alike = inclusion_probabilities(vec![0.0; 8], 4);
        assert_eq!(alike, [0.5; 8], "no errors");
        assert_eq!(inclusion_probabilities(vec![f64::NAN; 8], 2), [0.25; 8], "none known");
    }

    #[test]
    fn each_is_drawn_with_its_probability_and_their_number_is_the_sum() {
        let probabilities = inclusion_probabilities(errors(), 60);
        let offsets = 2000;
        let mut drawn = vec![0.0; probabilities.len()];
        for n in 0..offsets {
            let sample = systematic_sample(&probabilities, f64::from(n) / f64::from(offsets));
            assert_eq!(sample.len(), 60);
            sample.into_iter().for_each(|n| drawn[n] += 1.0 / f64::from(offsets));
        }
        for (drawn, probability) in drawn.iter().zip(probabilities) {
            assert!((drawn - probability).abs() < 2e-3, "{drawn} and {probability}");
        }
    }

    #[test]
    fn older_errors_count_less() {
        let mut errors = RayErrors::unknown(2);
        errors.add(1, 0.5);
        errors.add(1, 1.0);
        assert_eq!(errors.0, [-1.0, 0.6]);
    }
}
