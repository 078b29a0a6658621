//! Marching rays front to back, density only (DESIGN, section 2.9): which samples count, what they weigh, and which of
//! them need a colour.

use super::{Field, Nearest, Real, sum};
use crate::geometry::Ray;
use crate::model::{Coverage, Reduction};

/// A tensor that a sample aggregates.
#[derive(Clone, Copy, Debug)]
pub struct Pair<T> {
    /// Its number, counted over all scales.
    pub tensor: u32,
    /// Its weight in its scale.
    pub weight: T,
}

/// What finding a point's density needs besides the field. Reused.
#[derive(Clone, Debug, Default)]
pub struct Locator<T> {
    /// \[scale\] the point's neighbours.
    pub nearest: Vec<Nearest<T>>,
    /// \[density rank of the current scale\] aggregated density components.
    components: Vec<T>,
}

/// The samples of a few rays, in order of ray and distance. Reused from one march to the next.
#[derive(Clone, Debug, Default)]
pub struct Samples<T> {
    /// \[ray\] its first sample, and the number of samples.
    pub ray_starts: Vec<u32>,
    /// \[ray\] the transmittance that is left at the end.
    pub remaining: Vec<T>,
    /// \[sample\] distance along the ray, in model units.
    pub distances: Vec<T>,
    /// \[sample\] position relative to the field's origin.
    pub positions: Vec<[T; 3]>,
    /// \[sample\] the density feature f.
    pub features: Vec<T>,
    /// \[sample\] the transmittance before it.
    pub transmittances: Vec<T>,
    /// \[sample\] 1 − exp(−σ·δ·distance_scale).
    pub alphas: Vec<T>,
    /// \[sample × scales\] where its pairs of each scale begin, and the number of pairs.
    pub pair_starts: Vec<u32>,
    /// Pairs, by sample, scale, and distance.
    pub pairs: Vec<Pair<T>>,
    /// The samples that add colour, ascending.
    pub colored: Vec<u32>,
    /// \[ray\] its first coloured sample, and the number of those.
    pub colored_starts: Vec<u32>,
    locator: Locator<T>,
}

impl<T: Real> Samples<T> {
    fn clear(&mut self) {
        for starts in [&mut self.ray_starts, &mut self.colored_starts, &mut self.pair_starts] {
            starts.clear();
            starts.push(0);
        }
        for values in
            [&mut self.remaining, &mut self.distances, &mut self.features, &mut self.transmittances, &mut self.alphas]
        {
            values.clear();
        }
        self.positions.clear();
        self.pairs.clear();
        self.colored.clear();
    }

    /// Number of samples.
    pub fn len(&self) -> usize {
        self.distances.len()
    }

    /// Whether no sample counted.
    pub fn is_empty(&self) -> bool {
        self.distances.is_empty()
    }

    /// The samples of `ray`.
    pub fn of_ray(&self, ray: usize) -> std::ops::Range<usize> {
        self.ray_starts[ray] as usize..self.ray_starts[ray + 1] as usize
    }

    /// The places in `colored` of `ray`'s coloured samples.
    pub fn colored_of_ray(&self, ray: usize) -> std::ops::Range<usize> {
        self.colored_starts[ray] as usize..self.colored_starts[ray + 1] as usize
    }

    /// The pairs of `sample` in `scale`, of `scales`.
    #[inline(always)]
    pub fn pairs_of(&self, sample: usize, scale: usize, scales: usize) -> &[Pair<T>] {
        let at = sample * scales + scale;
        &self.pairs[self.pair_starts[at] as usize..self.pair_starts[at + 1] as usize]
    }

    /// How many scales cover `sample`.
    pub fn covering_scales(&self, sample: usize, scales: usize) -> usize {
        (0..scales).filter(|&s| !self.pairs_of(sample, s, scales).is_empty()).count()
    }
}

impl<T: Real> Field<T> {
    /// A point in model units relative to the field's origin.
    #[inline(always)]
    pub fn relative(&self, point: glam::DVec3) -> [T; 3] {
        (point - self.origin).to_array().map(T::of)
    }

    /// The distances between which `ray` marches, empty where it misses the bounds.
    #[inline(always)]
    fn span(&self, ray: &Ray) -> (f64, f64) {
        match self.bounds.intersect(ray) {
            Some((entry, exit)) => (entry.max(self.near_far[0]), exit.min(self.near_far[1])),
            None => (0.0, 0.0),
        }
    }

    /// Whether `position` is in the model.
    #[inline(always)]
    pub fn covers(&self, position: [T; 3]) -> bool {
        // Fine scales first: they cover least.
        let mut scales = self.scales.iter().rev();
        match self.rules.coverage {
            Coverage::All => scales.all(|s| s.is_covered(position)),
            Coverage::Any => scales.any(|s| s.is_covered(position)),
        }
    }

    /// Where the first sample of `ray` is that may count: occupied, or where there is no occupancy in the model.
    #[inline(always)]
    pub fn first_sample(&self, ray: &Ray) -> Option<[T; 3]> {
        let (start, end) = self.span(ray);
        (0..).map(|k| start + f64::from(k) * self.rules.step).take_while(|&t| t < end).find_map(|t| {
            let position = self.relative(ray.at(t));
            let counts = match &self.occupancy {
                Some(occupancy) => occupancy.contains(position),
                None => self.covers(position),
            };
            counts.then_some(position)
        })
    }

    /// The density feature at `position`, with the neighbours found there left in `locator`; `None` outside the model.
    #[inline(always)]
    pub fn density_feature(&self, position: [T; 3], locator: &mut Locator<T>) -> Option<T> {
        let Locator { nearest, components } = locator;
        nearest.resize(self.scales.len(), Nearest::default());
        let mut covering = 0;
        for s in (0..self.scales.len()).rev() {
            self.scales[s].find_nearest(position, self.rules.aggregation, &mut nearest[s]);
            if nearest[s].count > 0 {
                covering += 1;
            } else if self.rules.coverage == Coverage::All {
                return None;
            }
        }
        if covering == 0 {
            return None;
        }
        let mut feature = T::zero();
        for (scale, nearest) in self.scales.iter().zip(nearest.iter()) {
            components.clear();
            components.resize(scale.density_rank, T::zero());
            for (&tensor, &weight) in nearest.tensors[..nearest.count].iter().zip(&nearest.weights) {
                scale.add_density_of(tensor, position, weight, components);
            }
            feature += sum(components);
        }
        if self.rules.density_reduction == Reduction::Mean {
            feature /= T::of(f64::from(covering));
        }
        Some(feature)
    }

    /// σ·δ·distance_scale for a density feature.
    #[inline(always)]
    pub fn optical_depth(&self, feature: T) -> T {
        let x = feature + T::of(self.rules.density_shift);
        let density = x.max(T::zero()) + (-x.abs()).exp().ln_1p();
        density * T::of(self.rules.step * self.rules.distance_scale)
    }

    /// Marches `rays` into `samples`.
    #[inline(always)]
    pub fn march(&self, rays: &[Ray], samples: &mut Samples<T>) {
        samples.clear();
        let min_transmittance = T::of(self.rules.min_transmittance);
        let min_weight = T::of(self.rules.min_weight);
        let mut locator = std::mem::take(&mut samples.locator);
        for ray in rays {
            let (start, end) = self.span(ray);
            let mut transmittance = T::one();
            let mut k = 0;
            loop {
                let t = start + f64::from(k) * self.rules.step;
                if t >= end {
                    break;
                }
                k += 1;
                let position = self.relative(ray.at(t));
                if self.occupancy.as_ref().is_some_and(|o| !o.contains(position)) {
                    continue;
                }
                let Some(feature) = self.density_feature(position, &mut locator) else { continue };
                let alpha = -(-self.optical_depth(feature)).exp_m1();
                if transmittance * alpha > min_weight {
                    samples.colored.push(samples.distances.len() as u32);
                }
                samples.distances.push(T::of(t));
                samples.positions.push(position);
                samples.features.push(feature);
                samples.transmittances.push(transmittance);
                samples.alphas.push(alpha);
                for (scale, nearest) in self.scales.iter().zip(&locator.nearest) {
                    for (&tensor, &weight) in nearest.tensors[..nearest.count].iter().zip(&nearest.weights) {
                        samples.pairs.push(Pair { tensor: scale.first_tensor + tensor, weight });
                    }
                    samples.pair_starts.push(samples.pairs.len() as u32);
                }
                transmittance *= T::one() - alpha;
                if transmittance < min_transmittance {
                    break;
                }
            }
            samples.remaining.push(transmittance);
            samples.ray_starts.push(samples.distances.len() as u32);
            samples.colored_starts.push(samples.colored.len() as u32);
        }
        samples.locator = locator;
    }
}
