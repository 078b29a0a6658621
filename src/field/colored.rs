//! Which samples get a colour, and what it weighs (DESIGN, section 2.9).

use super::{Field, Real, Samples};
use crate::random::Random;

/// The samples of a march that add colour, by ray and distance.
#[derive(Clone, Debug, Default)]
pub struct Colored<T> {
    /// Their places among the samples.
    pub places: Vec<u32>,
    /// What their colours weigh in the pixel.
    pub weights: Vec<T>,
    /// \[ray\] the first of its coloured samples, and the number of those.
    pub ray_starts: Vec<u32>,
}

/// Colouring a random part of the samples that weigh little, for training: a sample of weight w < `below` is coloured
/// with probability w/`below` and then weighs `below`, so the expected pixel is the same.
#[derive(Clone, Copy, Debug)]
pub struct Thinning {
    /// The weight from which on every sample is coloured.
    pub below: f64,
    /// The batch's draws.
    pub random: Random,
    /// The number of the first ray in the batch.
    pub first_ray: u64,
}

impl Thinning {
    /// What a sample's colour weighs, given the sample's own weight; 0 where it is left out.
    #[inline(always)]
    fn weigh<T: Real>(&self, weight: T, ray: usize, sample: usize) -> T {
        let below = T::of(self.below);
        let drawn = || T::of(self.random.uniform((self.first_ray + ray as u64) << 24 | sample as u64));
        if weight >= below {
            weight
        } else if drawn() * below < weight {
            below
        } else {
            T::zero()
        }
    }
}

impl<T: Real> Colored<T> {
    /// How many.
    pub fn len(&self) -> usize {
        self.places.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.places.is_empty()
    }

    /// Where `ray`'s coloured samples are in `places` and `weights`.
    pub fn of_ray(&self, ray: usize) -> std::ops::Range<usize> {
        self.ray_starts[ray] as usize..self.ray_starts[ray + 1] as usize
    }
}

impl<T: Real> Field<T> {
    /// The samples that weigh enough for a colour.
    #[inline(always)]
    pub fn choose_colored(&self, samples: &Samples<T>, thinning: Option<Thinning>, colored: &mut Colored<T>) {
        let min_weight = T::of(self.rules.min_weight);
        colored.places.clear();
        colored.weights.clear();
        colored.ray_starts.clear();
        colored.ray_starts.push(0);
        for ray in 0..samples.remaining.len() {
            let first = samples.of_ray(ray).start;
            for at in samples.of_ray(ray) {
                let place = samples.order[at];
                let weight = samples.weight(place as usize);
                if weight <= min_weight {
                    continue;
                }
                let weight = thinning.map_or(weight, |t| t.weigh(weight, ray, at - first));
                if weight > T::zero() {
                    colored.places.push(place);
                    colored.weights.push(weight);
                }
            }
            colored.ray_starts.push(colored.places.len() as u32);
        }
    }
}
