//! Marching rays front to back, density only (DESIGN, section 2.9): which samples count, and what they weigh.
//!
//! Rays advance together, a few samples each at a time, so that every stage is a loop over hundreds of samples, and
//! hardly one behind a surface is evaluated.

use pulp::{Arch, Simd, WithSimd};

use super::neighbors::{Neighbors, Positions};
use super::{
    Contribution, DensityCache, Field, InterpolationSite, RayMarcher, Real, Stage, StageClock, add_compensated,
};
use crate::geometry::Ray;
use crate::model::{Coverage, Reduction};

/// Samples that a ray advances by at a time: those behind its end are computed in vain.
const STRIDE: u32 = 8;

/// The samples of a few rays. Reused from one march to the next.
///
/// A sample's slot is where it was evaluated, which is not the order along rays; that is in `order`.
#[derive(Clone, Debug, Default)]
pub struct Samples<T> {
    /// \[slot\] distance along the ray, in model units.
    pub distances: Vec<T>,
    /// \[slot\] position relative to the field's origin.
    pub positions: Vec<[T; 3]>,
    /// \[slot\] the density feature f.
    pub features: Vec<T>,
    /// \[slot\] 1 − exp(−σ·δ·distance_scale).
    pub alphas: Vec<T>,
    /// \[slot\] the transmittance before it; 0 where the ray ended before.
    pub transmittances: Vec<T>,
    /// \[slot × scales\] where its contributions of each scale begin and end.
    pub contribution_ranges: Vec<[u32; 2]>,
    /// Pairs, in no particular order.
    pub contributions: Vec<Contribution<T>>,
    /// \[ray\] where its samples begin in `order`, and their number.
    pub ray_starts: Vec<u32>,
    /// The slots of the samples that count, by ray and distance.
    pub order: Vec<u32>,
    /// \[ray\] the transmittance that is left at the end.
    pub remaining: Vec<T>,
    /// Time and counts of the march and what follows.
    pub clock: StageClock,
    active: Vec<ActiveRay<T>>,
    runs: Vec<Run>,
    /// The samples that are being evaluated: distances and positions.
    pending: Vec<T>,
    pending_positions: Positions<T>,
    /// \[scale × pending\] where their contributions are in `sites`.
    pending_ranges: Vec<[u32; 2]>,
    /// What interpolating their contributions needs.
    sites: Vec<InterpolationSite<T>>,
}

/// A ray that is still on its way.
#[derive(Clone, Copy, Debug)]
struct ActiveRay<T> {
    ray: u32,
    /// How many of the pending samples are its.
    pending: u32,
    exhausted: bool,
    transmittance: T,
    /// What rounding has taken too much from the transmittance: many faint samples must not be lost.
    lost: T,
    marcher: RayMarcher<T>,
}

/// Neighboring slots of one ray, front to back.
#[derive(Clone, Copy, Debug)]
struct Run {
    ray: u32,
    first: u32,
    count: u32,
}

impl<T: Real> Samples<T> {
    fn clear(&mut self, rays: usize) {
        for values in
            [&mut self.distances, &mut self.features, &mut self.alphas, &mut self.transmittances, &mut self.remaining]
        {
            values.clear();
        }
        self.order.clear();
        self.contribution_ranges.clear();
        self.ray_starts.clear();
        self.ray_starts.resize(rays + 1, 0);
        self.remaining.resize(rays, T::one());
        self.positions.clear();
        self.contributions.clear();
        self.active.clear();
        self.runs.clear();
        self.clock.restart();
    }

    /// Lets samples of these distances and positions wait for evaluation.
    #[inline(always)]
    fn set_pending(&mut self, samples: impl Iterator<Item = (T, [T; 3])>) {
        self.clear_pending();
        for (distance, position) in samples {
            self.push_pending(distance, position);
        }
        self.pending_positions.pad();
    }

    #[inline(always)]
    fn clear_pending(&mut self) {
        self.pending.clear();
        self.pending_positions.clear();
    }

    #[inline(always)]
    fn push_pending(&mut self, distance: T, position: [T; 3]) {
        self.pending.push(distance);
        self.pending_positions.push(position);
    }

    /// Number of samples that count.
    pub fn len(&self) -> usize {
        self.order.len()
    }

    /// Whether no sample counts.
    pub fn is_empty(&self) -> bool {
        self.order.is_empty()
    }

    /// Where `ray`'s samples are in `order`.
    pub fn ray_range(&self, ray: usize) -> std::ops::Range<usize> {
        self.ray_starts[ray] as usize..self.ray_starts[ray + 1] as usize
    }

    /// What the sample at `slot` weighs in its pixel.
    #[inline(always)]
    pub fn weight(&self, slot: usize) -> T {
        self.transmittances[slot] * self.alphas[slot]
    }

    /// The contributions of the sample at `slot` in `scale`, of `scales`.
    #[inline(always)]
    pub fn contributions_of(&self, slot: usize, scale: usize, scales: usize) -> &[Contribution<T>] {
        let [first, end] = self.contribution_ranges[slot * scales + scale];
        &self.contributions[first as usize..end as usize]
    }

    /// How many scales cover the sample at `slot`.
    pub fn covering_scales(&self, slot: usize, scales: usize) -> usize {
        (0..scales).filter(|&s| !self.contributions_of(slot, s, scales).is_empty()).count()
    }
}

impl<T: Real> Field<T> {
    /// A point in model units relative to the field's origin.
    #[inline(always)]
    pub fn relative(&self, point: glam::DVec3) -> [T; 3] {
        (point - self.origin).to_array().map(T::of)
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
        let mut marcher = RayMarcher::new(self, ray);
        loop {
            let (_, position) = marcher.advance(self)?;
            if self.occupancy.is_some() || self.covers(position) {
                return Some(position);
            }
        }
    }

    /// The density feature at `position`; `None` outside the model. For single points: `samples` is scratch.
    #[inline(always)]
    pub fn density_feature(&self, position: [T; 3], samples: &mut Samples<T>) -> Option<T> {
        let mut found = None;
        self.density_features([position].into_iter(), samples, |_, feature| found = Some(feature));
        found
    }

    /// Calls `take` with the number and the density feature of each of the `positions` that is in the model. `samples` is
    /// scratch.
    #[inline(always)]
    pub(super) fn density_features(
        &self,
        positions: impl Iterator<Item = [T; 3]>,
        samples: &mut Samples<T>,
        mut take: impl FnMut(usize, T),
    ) {
        samples.clear(0);
        // No ray gives these samples a distance: their numbers stand in for it.
        samples.set_pending(positions.enumerate().map(|(n, position)| (T::of_i32(n as i32), position)));
        Arch::new().dispatch(FindNeighbors { field: self, samples });
        self.assign_covered_slots(samples, 0..samples.pending.len());
        Arch::new().dispatch(GatherDensity { field: self, samples });
        for (number, &feature) in samples.distances.iter().zip(&samples.features) {
            take(number.floor_i32() as usize, feature);
        }
    }

    /// Finds the contributions of shaded samples where the march, which reads density features from the cache, left them out.
    #[inline(always)]
    pub(super) fn find_shaded_contributions(&self, slots: &[u32], samples: &mut Samples<T>) {
        if self.density_cache.is_none() {
            return;
        }
        let positions = std::mem::take(&mut samples.positions);
        samples.set_pending(slots.iter().map(|&slot| (T::zero(), positions[slot as usize])));
        samples.positions = positions;
        Arch::new().dispatch(FindNeighbors { field: self, samples });
        let Samples { pending_ranges, contribution_ranges, contributions, .. } = samples;
        let first_contribution = (contributions.len() - samples.sites.len()) as u32;
        let scales = self.scales.len();
        for (n, &slot) in slots.iter().enumerate() {
            for s in 0..scales {
                contribution_ranges[slot as usize * scales + s] =
                    pending_ranges[s * slots.len() + n].map(|at| first_contribution + at);
            }
        }
    }

    /// σ·δ·distance_scale for a density feature.
    #[inline(always)]
    pub fn optical_depth(&self, feature: T) -> T {
        let x = feature + T::of(self.rules.density_shift);
        let density = x.max(T::zero()) + (-x.abs()).exp_of_negative().ln_1p_of_unit();
        density * T::of(self.rules.step * self.rules.distance_scale)
    }

    /// The slope of [`Field::optical_depth`].
    #[inline(always)]
    pub fn optical_depth_slope(&self, feature: T) -> T {
        let x = feature + T::of(self.rules.density_shift);
        let e = (-x.abs()).exp_of_negative();
        let above = if x > T::zero() { T::one() } else { e };
        above / (T::one() + e) * T::of(self.rules.step * self.rules.distance_scale)
    }

    /// Marches `rays` into `samples`.
    #[inline(always)]
    pub fn march(&self, rays: &[Ray], samples: &mut Samples<T>) {
        samples.clear(rays.len());
        samples.active.extend(rays.iter().zip(0..).map(|(ray, number)| ActiveRay {
            ray: number,
            pending: 0,
            exhausted: false,
            transmittance: T::one(),
            lost: T::zero(),
            marcher: RayMarcher::new(self, ray),
        }));
        while !samples.active.is_empty() {
            self.advance_rays(samples);
            samples.clock.lap(Stage::March);
            if self.density_cache.is_none() {
                Arch::new().dispatch(FindNeighbors { field: self, samples });
            }
            self.assign_slots(samples);
            samples.clock.lap(Stage::Neighbors);
            if self.density_cache.is_none() {
                Arch::new().dispatch(GatherDensity { field: self, samples });
            }
            samples.clock.lap(Stage::DensityGather);
            self.follow_transmittance(samples);
            samples.clock.lap(Stage::Composite);
        }
        order_by_ray(samples);
        let scales = self.scales.len();
        let work = &mut samples.clock.work;
        work.rays = rays.len() as u64;
        work.evaluated = samples.positions.len() as u64;
        work.samples = samples.order.len() as u64;
        work.contributions = count_contributions(&samples.contribution_ranges, 0..samples.positions.len(), scales);
        samples.clock.lap(Stage::Composite);
    }

    /// Puts the next samples of each ray into `pending`.
    #[inline(always)]
    fn advance_rays(&self, samples: &mut Samples<T>) {
        let mut active = std::mem::take(&mut samples.active);
        samples.clear_pending();
        for ray in &mut active {
            ray.pending = 0;
            // An exhausted ray must not be asked again.
            while !ray.exhausted && ray.pending < STRIDE {
                match ray.marcher.advance(self) {
                    Some((t, position)) => {
                        samples.push_pending(T::of(t), position);
                        ray.pending += 1;
                    }
                    None => ray.exhausted = true,
                }
            }
        }
        samples.pending_positions.pad();
        samples.active = active;
    }

    /// Gives those pending samples that are in the model a slot, with their contributions or their cached density features.
    #[inline(always)]
    fn assign_slots(&self, samples: &mut Samples<T>) {
        let mut next = 0;
        for ray in 0..samples.active.len() {
            let ActiveRay { ray, pending, .. } = samples.active[ray];
            let first = samples.positions.len() as u32;
            let pending = next..next + pending as usize;
            next = pending.end;
            match &self.density_cache {
                Some(cache) => self.assign_cached_slots(cache, samples, pending),
                None => self.assign_covered_slots(samples, pending),
            }
            samples.runs.push(Run { ray, first, count: samples.positions.len() as u32 - first });
        }
    }

    /// Gives those of the `pending` samples that are in the model a slot.
    #[inline(always)]
    fn assign_covered_slots(&self, samples: &mut Samples<T>, pending: std::ops::Range<usize>) {
        let scales = self.scales.len();
        let needed = match self.rules.coverage {
            Coverage::All => scales,
            Coverage::Any => 1,
        };
        let Samples { pending_ranges, contributions, contribution_ranges, .. } = samples;
        let first_contribution = (contributions.len() - samples.sites.len()) as u32;
        for at in pending {
            let first = contribution_ranges.len();
            let of_sample = (0..scales).map(|s| pending_ranges[s * samples.pending.len() + at]);
            contribution_ranges.extend(of_sample.map(|range| range.map(|n| first_contribution + n)));
            let covering = contribution_ranges[first..].iter().filter(|range| range[0] < range[1]).count();
            if covering < needed {
                contribution_ranges.truncate(first);
                continue;
            }
            samples.distances.push(samples.pending[at]);
            samples.positions.push(samples.pending_positions.get(at));
        }
    }

    /// Gives those of the `pending` samples that are in the model a slot, with their density features and no contributions.
    #[inline(always)]
    fn assign_cached_slots(&self, cache: &DensityCache<T>, samples: &mut Samples<T>, pending: std::ops::Range<usize>) {
        for at in pending {
            let position = samples.pending_positions.get(at);
            if let Some(feature) = cache.feature(position) {
                samples.features.push(feature);
                samples.distances.push(samples.pending[at]);
                samples.positions.push(position);
            }
        }
        samples.contribution_ranges.resize(samples.positions.len() * self.scales.len(), [0, 0]);
    }

    /// Takes the transmittance of each ray through its newest samples; drops rays that have ended.
    #[inline(always)]
    fn follow_transmittance(&self, samples: &mut Samples<T>) {
        let known = samples.alphas.len();
        samples.alphas.resize(samples.features.len(), T::zero());
        for (alpha, &feature) in samples.alphas[known..].iter_mut().zip(&samples.features[known..]) {
            *alpha = -(-self.optical_depth(feature)).exp_m1_of_negative();
        }
        let min_transmittance = T::of(self.rules.min_transmittance);
        let first_run = samples.runs.len() - samples.active.len();
        let Samples { active, runs, transmittances, alphas, remaining, .. } = samples;
        let mut newest = runs[first_run..].iter_mut();
        active.retain_mut(|ray| {
            let run = newest.next().expect("a run a ray");
            let slots = run.first as usize..(run.first + run.count) as usize;
            let mut ended = ray.exhausted;
            let mut counted = 0;
            for &alpha in &alphas[slots.clone()] {
                transmittances.push(ray.transmittance);
                let weight = ray.transmittance * alpha;
                add_compensated(&mut ray.transmittance, &mut ray.lost, -weight);
                ray.transmittance = ray.transmittance.max(T::zero());
                counted += 1;
                if ray.transmittance < min_transmittance {
                    ended = true;
                    break;
                }
            }
            run.count = counted;
            transmittances.resize(slots.end, T::zero());
            remaining[ray.ray as usize] = ray.transmittance;
            !ended
        });
    }
}

/// The contributions of the pending samples, in `sites` and appended to `contributions`.
struct FindNeighbors<'a, T> {
    field: &'a Field<T>,
    samples: &'a mut Samples<T>,
}

impl<T: Real> WithSimd for FindNeighbors<'_, T> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Samples { pending_positions, pending_ranges, sites, contributions, .. } = self.samples;
        sites.clear();
        pending_ranges.clear();
        let mut found = Neighbors::new(self.field.rules.aggregation, sites, pending_ranges);
        for scale in &self.field.scales {
            scale.find_nearest(simd, pending_positions, &mut found);
        }
        contributions.extend(sites.iter().map(|at| Contribution { tensor: at.tensor, weight: at.weight }));
    }
}

/// The density features of all placed samples that have none yet.
struct GatherDensity<'a, T> {
    field: &'a Field<T>,
    samples: &'a mut Samples<T>,
}

impl<T: Real> WithSimd for GatherDensity<'_, T> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { field, samples } = self;
        let scales = field.scales.len();
        let first_slot = samples.features.len();
        let first_contribution = (samples.contributions.len() - samples.sites.len()) as u32;
        for slot in first_slot..samples.positions.len() {
            let mut feature = T::zero();
            for (s, scale) in field.scales.iter().enumerate() {
                let [first, end] = samples.contribution_ranges[slot * scales + s];
                let sites = &samples.sites[(first - first_contribution) as usize..(end - first_contribution) as usize];
                feature += scale.density_of(simd, sites);
            }
            if field.rules.density_reduction == Reduction::Mean {
                feature /= T::of(samples.covering_scales(slot, scales) as f64);
            }
            samples.features.push(feature);
        }
    }
}

/// Fills `ray_starts` and `order` from the runs.
fn order_by_ray<T: Real>(samples: &mut Samples<T>) {
    let Samples { ray_starts, order, runs, .. } = samples;
    for run in runs.iter() {
        ray_starts[run.ray as usize + 1] += run.count;
    }
    for ray in 1..ray_starts.len() {
        ray_starts[ray] += ray_starts[ray - 1];
    }
    order.resize(ray_starts[ray_starts.len() - 1] as usize, 0);
    // Runs of a ray come front to back; each moves its ray's start on, and all are moved back at the end.
    for run in runs.iter() {
        let start = &mut ray_starts[run.ray as usize];
        for (at, slot) in (*start..).zip(run.first..).take(run.count as usize) {
            order[at as usize] = slot;
        }
        *start += run.count;
    }
    ray_starts.rotate_right(1);
    let rays = ray_starts.len() - 1;
    // What was the end of the last ray is now in front, and each start is that of the ray before.
    ray_starts[0] = 0;
    debug_assert_eq!(ray_starts[rays] as usize, order.len(), "the last ray ends with the last sample");
}

/// \[scale\] how many contributions the samples at `slots` have.
pub(super) fn count_contributions(ranges: &[[u32; 2]], slots: impl Iterator<Item = usize>, scales: usize) -> Vec<u64> {
    let mut counts = vec![0; scales];
    for slot in slots {
        for (count, [first, end]) in counts.iter_mut().zip(&ranges[slot * scales..]) {
            *count += u64::from(end - first);
        }
    }
    counts
}
