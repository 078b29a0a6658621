//! Which samples get a color, and what it weighs (DESIGN, section 2.9).

use super::{Field, Real, Samples};
use crate::random::Random;

/// The samples of a march that add color, by ray and distance.
#[derive(Clone, Debug, Default)]
pub struct ShadedSamples<T> {
    /// Their slots among the samples.
    pub slots: Vec<u32>,
    /// What their colors weigh in the pixel.
    pub weights: Vec<T>,
    /// \[ray\] the first of its shaded samples, and the number of those.
    pub ray_starts: Vec<u32>,
}

/// Leaving out a random part of the samples that matter little, for training: one of magnitude m < `below` is kept with
/// probability m/`below` and then counts as `below`, so that expectations stay the same.
#[derive(Clone, Copy, Debug)]
pub struct Roulette {
    /// The magnitude from which on every sample is kept.
    pub below: f64,
    /// The batch's draws.
    pub random: Random,
    /// The number of the first ray in the batch.
    pub first_ray: u64,
}

impl Roulette {
    /// What a sample of `magnitude` counts as; 0 where it is left out.
    #[inline(always)]
    pub fn reweight<T: Real>(&self, magnitude: T, ray: usize, sample: usize) -> T {
        let below = T::of(self.below);
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
    /// How many.
    pub fn len(&self) -> usize {
        self.slots.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.slots.is_empty()
    }

    /// Where `ray`'s shaded samples are in `slots` and `weights`.
    pub fn ray_range(&self, ray: usize) -> std::ops::Range<usize> {
        self.ray_starts[ray] as usize..self.ray_starts[ray + 1] as usize
    }
}

impl<T: Real> Field<T> {
    /// The samples of all rays that weigh enough for a color.
    #[inline(always)]
    pub fn select_shaded(&self, samples: &Samples<T>, roulette: Option<Roulette>, shaded: &mut ShadedSamples<T>) {
        self.select_some_shaded(samples, 0, usize::MAX, roulette, shaded);
    }

    /// As [`Field::select_shaded`], of the rays from number `first_ray` on, as many as together have no more than
    /// `at_most` shaded samples, but at least one; returns how many. `shaded` counts rays from `first_ray`.
    #[inline(always)]
    pub fn select_some_shaded(
        &self,
        samples: &Samples<T>,
        first_ray: usize,
        at_most: usize,
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
            for at in samples.ray_range(ray) {
                let slot = samples.order[at];
                let weight = samples.weight(slot as usize);
                if weight <= min_weight {
                    continue;
                }
                let weight = roulette.map_or(weight, |t| t.reweight(weight, ray, at - first));
                if weight > T::zero() {
                    shaded.slots.push(slot);
                    shaded.weights.push(weight);
                }
            }
            if shaded.len() > at_most && ray > first_ray {
                shaded.slots.truncate(before);
                shaded.weights.truncate(before);
                break;
            }
            shaded.ray_starts.push(shaded.slots.len() as u32);
        }
        shaded.ray_starts.len() - 1
    }
}
