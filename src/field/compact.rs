//! Compaction: the list of shaded samples and their weights (spec 4.8). Twin: `shaders/compact.wgsl`.

use super::{Field, Real, Samples};
use strivec_format::random::Random;

/// The shaded samples of a march, by ray and distance.
#[derive(Clone, Debug, Default)]
pub struct ShadedSamples<T> {
    /// \[shaded\] the sample's slot in [`Samples`].
    pub slots: Vec<u32>,
    /// \[shaded\] the weight of the sample's color in its pixel.
    pub weights: Vec<T>,
    /// \[ray\] its first shaded sample; then their number.
    pub ray_starts: Vec<u32>,
}

/// Russian roulette over samples of small magnitude, for training. A sample of magnitude m < `below` is kept with
/// probability m/`below` and then has magnitude `below`, which preserves the expectation.
#[derive(Clone, Copy, Debug)]
pub struct Roulette {
    /// The magnitude from which on all samples are kept.
    pub below: f64,
    /// The batch's random stream.
    pub random: Random,
    /// The index in the batch of the first ray.
    pub first_ray: u64,
}

impl Roulette {
    /// The new magnitude of a sample: `magnitude` or `below` if it is kept, 0 if it is dropped.
    #[inline(always)]
    pub fn reweight<T: Real>(&self, magnitude: T, ray: usize, sample: usize) -> T {
        let below = T::of(self.below);
        // By ray and sample, so that the draw does not depend on chunks or threads.
        let drawn = || T::of(self.random.uniform((self.first_ray + ray as u64) << 24 | sample as u64));
        if magnitude >= below {
            magnitude
        } else if drawn() * below < magnitude {
            below
        } else {
            T::zero()
        }
    }
}

impl<T: Real> ShadedSamples<T> {
    /// Number of shaded samples.
    pub fn len(&self) -> usize {
        self.slots.len()
    }

    /// True if no sample is shaded.
    pub fn is_empty(&self) -> bool {
        self.slots.is_empty()
    }

    /// The range of `ray`'s shaded samples in `slots` and `weights`.
    pub fn ray_range(&self, ray: usize) -> std::ops::Range<usize> {
        self.ray_starts[ray] as usize..self.ray_starts[ray + 1] as usize
    }
}

impl<T: Real> Field<T> {
    /// Selects the samples of all rays whose weight exceeds the minimum weight.
    #[inline(always)]
    pub fn select_shaded(&self, samples: &Samples<T>, roulette: Option<Roulette>, shaded: &mut ShadedSamples<T>) {
        self.select_some_shaded(samples, 0, usize::MAX, roulette, shaded);
    }

    /// Selects shaded samples like [`Field::select_shaded`], for the most rays from `first_ray` on that together have
    /// at most `max_shaded` shaded samples, but at least one ray. Returns the number of rays. `shaded` counts rays from
    /// `first_ray`.
    #[inline(always)]
    pub fn select_some_shaded(
        &self,
        samples: &Samples<T>,
        first_ray: usize,
        max_shaded: usize,
        roulette: Option<Roulette>,
        shaded: &mut ShadedSamples<T>,
    ) -> usize {
        let min_weight = T::of(self.rules.min_weight);
        shaded.slots.clear();
        shaded.weights.clear();
        shaded.ray_starts.clear();
        shaded.ray_starts.push(0);
        for ray in first_ray..samples.remaining.len() {
            let before = shaded.len();
            let first = samples.ray_range(ray).start;
            for index in samples.ray_range(ray) {
                let slot = samples.order[index];
                let weight = samples.weight(slot as usize);
                if weight <= min_weight {
                    continue;
                }
                // Thinning colors below 0.001 drops 27 % of the samples without a measurable loss
                // (docs/experiments/2026-11-21-step-optimizations.md).
                let weight = roulette.map_or(weight, |r| r.reweight(weight, ray, index - first));
                if weight > T::zero() {
                    shaded.slots.push(slot);
                    shaded.weights.push(weight);
                }
            }
            // A whole ray or none of it: composited rows need all samples of a ray.
            if shaded.len() > max_shaded && ray > first_ray {
                shaded.slots.truncate(before);
                shaded.weights.truncate(before);
                break;
            }
            shaded.ray_starts.push(shaded.slots.len() as u32);
        }
        shaded.ray_starts.len() - 1
    }
}
