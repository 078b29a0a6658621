//! Marching rays front to back, density only (spec 4.8): which samples count, and their weights. Twin:
//! `shaders/march.wgsl`.
//!
//! Rays advance together, a few samples each at a time: every stage is a loop over hundreds of samples, and few samples
//! behind a surface are evaluated.

use super::samples::{ActiveRay, Run, count_contributions};
use super::{Field, RayMarcher, Real, Samples, Stage, add_compensated};
use strivec_format::geometry::Ray;

/// Samples that a ray advances by at a time; samples behind its end are discarded.
/// With 8, a frame evaluates 3.97 instead of 3.64 million samples (docs/experiments/2026-11-26-tight-occupancy.md); 2
/// and 3 are not faster (docs/experiments/2026-11-26-frame-in-tiles.md).
const STRIDE: u32 = 4;

impl<T: Real> Field<T> {
    /// The position of the first sample of `ray` that may count: the first occupied one or, without an occupancy, the
    /// first one in the model.
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

    /// Marches `rays` into `samples`.
    #[inline(always)]
    pub fn march(&self, rays: &[Ray], samples: &mut Samples<T>) {
        self.march_within(rays, samples, usize::MAX);
    }

    /// Marches `rays` into `samples`, unless there are several and their samples take more than `bytes`. Returns false then;
    /// `samples` are of no use.
    #[inline(always)]
    pub fn march_within(&self, rays: &[Ray], samples: &mut Samples<T>, bytes: usize) -> bool {
        samples.clear(rays.len());
        samples.active.extend((0..rays.len() as u32).map(|ray| ActiveRay {
            ray,
            pending: 0,
            exhausted: false,
            transmittance: T::one(),
            lost: T::zero(),
        }));
        samples.marchers.extend(rays.iter().map(|ray| RayMarcher::new(self, ray)));
        while !samples.active.is_empty() {
            if samples.bytes() > bytes && rays.len() > 1 {
                return false;
            }
            self.advance_rays(samples);
            samples.clock.lap(Stage::March);
            self.find_neighbors(samples);
            self.assign_slots(samples);
            samples.clock.lap(Stage::Neighbors);
            self.gather_density(samples);
            samples.clock.lap(Stage::DensityGather);
            self.composite(samples);
            samples.clock.lap(Stage::Composite);
        }
        order_by_ray(samples);
        let scales = self.scales.len();
        let work = &mut samples.clock.work;
        work.rays = rays.len() as u64;
        work.evaluated = samples.positions.len() as u64;
        work.samples = samples.order.len() as u64;
        work.contributions = count_contributions(&samples.neighborhoods, 0..samples.positions.len(), scales);
        samples.clock.lap(Stage::Composite);
        true
    }

    /// Puts the next samples of each ray into `pending`.
    #[inline(always)]
    fn advance_rays(&self, samples: &mut Samples<T>) {
        // Taken out, so that pending samples can be pushed meanwhile.
        let (mut active, mut marchers) = (std::mem::take(&mut samples.active), std::mem::take(&mut samples.marchers));
        self.skip_empty(&active, &mut marchers, &mut samples.seeking);
        samples.clear_pending();
        for ray in &mut active {
            let marcher = &mut marchers[ray.ray as usize];
            ray.pending = 0;
            // A marcher must not advance past its last sample.
            while !ray.exhausted && ray.pending < STRIDE {
                match marcher.advance(self) {
                    Some((t, position)) => {
                        samples.push_pending(T::of(t), position);
                        ray.pending += 1;
                    }
                    None => ray.exhausted = true,
                }
            }
        }
        samples.pending_positions.pad();
        (samples.active, samples.marchers) = (active, marchers);
    }

    /// Advances the marchers of the `active` rays over empty space, all rays by a stride at a time: a processor computes
    /// the strides of several rays at once, but not those of one ray. `seeking` is scratch.
    #[inline(always)]
    fn skip_empty(&self, active: &[ActiveRay<T>], marchers: &mut [RayMarcher<T>], seeking: &mut Vec<u32>) {
        seeking.clear();
        seeking.extend(active.iter().map(|ray| ray.ray));
        while !seeking.is_empty() {
            // Marchers stay where they are and only their numbers move; without a branch, as strides end anywhere. In
            // turns, the march of a frame takes a third less (docs/experiments/2026-11-26-frame-in-tiles.md).
            let mut left = 0;
            for index in 0..seeking.len() {
                let ray = seeking[index];
                seeking[left] = ray;
                left += usize::from(marchers[ray as usize].skip(self));
            }
            seeking.truncate(left);
        }
    }

    /// Assigns slots to the pending samples that are in the model.
    #[inline(always)]
    fn assign_slots(&self, samples: &mut Samples<T>) {
        let mut next = 0;
        for ray in 0..samples.active.len() {
            let ActiveRay { ray, pending, .. } = samples.active[ray];
            let first = samples.positions.len() as u32;
            let pending = next..next + pending as usize;
            next = pending.end;
            self.assign_covered_slots(samples, pending, |_| ());
            samples.runs.push(Run { ray, first, count: samples.positions.len() as u32 - first });
        }
    }

    /// Opacities of the newest samples and the transmittance in front of each; removes rays that have ended.
    #[inline(always)]
    fn composite(&self, samples: &mut Samples<T>) {
        let known = samples.alphas.len();
        samples.alphas.resize(samples.features.len(), T::zero());
        // A loop of its own, which vectorizes: compositing depends on the sample before. 1 − e^−τ without `exp_m1` is
        // 0 in f32 for fog of τ below 6e-8.
        for (alpha, &feature) in samples.alphas[known..].iter_mut().zip(&samples.features[known..]) {
            *alpha = -(-self.optical_depth(feature)).exp_m1_of_negative();
        }
        let min_transmittance = T::of(self.rules.min_transmittance);
        let first_run = samples.runs.len() - samples.active.len();
        let Samples { active, runs, transmittances, alphas, remaining, .. } = samples;
        let mut newest = runs[first_run..].iter_mut();
        active.retain_mut(|ray| {
            let run = newest.next().expect("one run per ray");
            let slots = run.first as usize..(run.first + run.count) as usize;
            let mut ended = ray.exhausted;
            let mut counted = 0;
            for &alpha in &alphas[slots.clone()] {
                transmittances.push(ray.transmittance);
                let weight = ray.transmittance * alpha;
                // Compensated: in f32, 1 − 2e-8 is 1, and plain sums lose fog entirely (docs/numerics.md).
                add_compensated(&mut ray.transmittance, &mut ray.lost, -weight);
                // The compensation may carry it below 0 by a rounding.
                ray.transmittance = ray.transmittance.max(T::zero());
                counted += 1;
                if ray.transmittance < min_transmittance {
                    ended = true;
                    break;
                }
            }
            run.count = counted;
            // Samples behind the end keep their slots and have no weight.
            transmittances.resize(slots.end, T::zero());
            remaining[ray.ray as usize] = ray.transmittance;
            !ended
        });
    }
}

/// Fills `ray_starts` and `order` from the runs.
fn order_by_ray<T: Real>(samples: &mut Samples<T>) {
    let Samples { ray_starts, order, runs, .. } = samples;
    // Samples were evaluated in turns of rays; a counting sort brings them into the order along rays.
    for run in runs.iter() {
        ray_starts[run.ray as usize + 1] += run.count;
    }
    for ray in 1..ray_starts.len() {
        ray_starts[ray] += ray_starts[ray - 1];
    }
    order.resize(ray_starts[ray_starts.len() - 1] as usize, 0);
    // Runs of a ray come front to back. Each advances its ray's start; afterwards all starts are one ray ahead.
    for run in runs.iter() {
        let start = &mut ray_starts[run.ray as usize];
        for (index, slot) in (*start..).zip(run.first..).take(run.count as usize) {
            order[index as usize] = slot;
        }
        *start += run.count;
    }
    ray_starts.rotate_right(1);
    let rays = ray_starts.len() - 1;
    ray_starts[0] = 0;
    debug_assert_eq!(ray_starts[rays] as usize, order.len(), "the last ray ends with the last sample");
}
