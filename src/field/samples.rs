//! The samples of a march: the evaluated ones, the ones that count, and their weights (spec 4.8).

use super::positions::Positions;
use super::{Contribution, RayMarcher, Real, StageClock};

/// The samples of a batch of rays. Reused from one march to the next.
///
/// A sample's *slot* is its index in evaluation order, which is not the order along rays; `order` has the latter.
#[derive(Clone, Debug, Default)]
pub struct Samples<T> {
    /// \[slot\] distance along the ray, in model units.
    pub distances: Vec<T>,
    /// \[slot\] position relative to the field's origin.
    pub positions: Vec<[T; 3]>,
    /// \[slot\] the tag of a sample that is on no ray; not used by marches.
    pub(super) tags: Vec<u32>,
    /// \[slot\] the density feature f (spec 4.5).
    pub features: Vec<T>,
    /// \[slot\] the opacity α = 1 − exp(−σ·δ·distance_scale).
    pub alphas: Vec<T>,
    /// \[slot\] the transmittance in front of the sample; 0 behind the ray's end.
    pub transmittances: Vec<T>,
    /// \[slot × scales + scale\] the sample's neighbors in that scale.
    pub(super) neighborhoods: Vec<Neighborhood>,
    /// Contributions of all samples; those of a sample and a scale are adjacent.
    pub(super) contributions: Contributions<T>,
    /// \[ray\] the ray's first index in `order`; then the length of `order`.
    pub ray_starts: Vec<u32>,
    /// The slots of the samples that count, by ray and distance.
    pub order: Vec<u32>,
    /// \[ray\] the transmittance left at the ray's end.
    pub remaining: Vec<T>,
    /// Time and counts of the march and of the stages after it.
    pub clock: StageClock,
    pub(super) active: Vec<ActiveRay<T>>,
    /// \[ray\] its marcher.
    pub(super) marchers: Vec<RayMarcher<T>>,
    /// Rays whose next sample may be in empty space.
    pub(super) seeking: Vec<u32>,
    pub(super) runs: Vec<Run>,
    /// \[pending\] distances of the samples under evaluation.
    pub(super) pending: Vec<T>,
    /// \[pending\] positions of the samples under evaluation.
    pub(super) pending_positions: Positions<T>,
    /// \[scale × pending + sample\] the sample's neighbors.
    pub(super) pending_neighborhoods: Vec<Neighborhood>,
}

/// The contributions to all samples in all scales. Its memory is not cleared from one march to the next.
#[derive(Clone, Debug, Default)]
pub(super) struct Contributions<T> {
    /// The first `len` are contributions.
    list: Vec<Contribution<T>>,
    len: usize,
}

impl<T: Real> Contributions<T> {
    #[inline(always)]
    pub(super) fn len(&self) -> usize {
        self.len
    }

    fn clear(&mut self) {
        // Overwritten later and not cleared, as part of a shorter march
        // (docs/experiments/2026-11-26-frame-in-tiles.md).
        self.len = 0;
    }

    /// The next `count` contributions, to overwrite.
    #[inline(always)]
    pub(super) fn room(&mut self, count: usize) -> &mut [Contribution<T>] {
        let end = self.len + count;
        // Twice as many, so that growing is rare.
        if self.list.len() < end {
            self.list.resize(2 * end, Contribution::default());
        }
        &mut self.list[self.len..end]
    }

    /// Appends the next `count` contributions as they are.
    #[inline(always)]
    pub(super) fn keep(&mut self, count: usize) {
        self.len += count;
    }
}

/// The neighbors of a sample in a scale.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Neighborhood {
    /// The first of its contributions, and their end.
    pub(super) contributions: [u32; 2],
    /// True if any tensor covers the sample, which may be one without components and so without a contribution.
    pub(super) is_covered: bool,
}

/// A ray that has not ended.
#[derive(Clone, Copy, Debug)]
pub(super) struct ActiveRay<T> {
    pub(super) ray: u32,
    /// The number of its pending samples.
    pub(super) pending: u32,
    /// True if its marcher has returned its last sample.
    pub(super) exhausted: bool,
    pub(super) transmittance: T,
    /// The Kahan compensation of the transmittance, without which faint samples would be lost.
    pub(super) lost: T,
}

/// Consecutive slots of one ray, front to back.
#[derive(Clone, Copy, Debug)]
pub(super) struct Run {
    pub(super) ray: u32,
    pub(super) first: u32,
    pub(super) count: u32,
}

impl<T: Real> Samples<T> {
    pub(super) fn clear(&mut self, rays: usize) {
        for values in
            [&mut self.distances, &mut self.features, &mut self.alphas, &mut self.transmittances, &mut self.remaining]
        {
            values.clear();
        }
        self.order.clear();
        self.neighborhoods.clear();
        self.ray_starts.clear();
        self.ray_starts.resize(rays + 1, 0);
        self.remaining.resize(rays, T::one());
        self.positions.clear();
        self.contributions.clear();
        self.active.clear();
        self.marchers.clear();
        self.runs.clear();
        self.clock.restart();
    }

    #[inline(always)]
    pub(super) fn clear_pending(&mut self) {
        self.pending.clear();
        self.pending_positions.clear();
    }

    #[inline(always)]
    pub(super) fn push_pending(&mut self, distance: T, position: [T; 3]) {
        self.pending.push(distance);
        self.pending_positions.push(position);
    }

    /// Bytes of the samples that are evaluated.
    pub(super) fn bytes(&self) -> usize {
        // Of a slot: four numbers, its position, and its place in the order.
        let of_slots = self.positions.len() * (7 * size_of::<T>() + size_of::<u32>());
        let of_contributions = self.contributions.len * size_of::<Contribution<T>>();
        of_slots + of_contributions + size_of_val(&self.neighborhoods[..]) + size_of_val(&self.runs[..])
    }

    /// Number of samples that count.
    pub fn len(&self) -> usize {
        self.order.len()
    }

    /// True if no sample counts.
    pub fn is_empty(&self) -> bool {
        self.order.is_empty()
    }

    /// The range of `ray`'s samples in `order`.
    pub fn ray_range(&self, ray: usize) -> std::ops::Range<usize> {
        self.ray_starts[ray] as usize..self.ray_starts[ray + 1] as usize
    }

    /// The visibility weight w = T·α of the sample at `slot`.
    #[inline(always)]
    pub fn weight(&self, slot: usize) -> T {
        self.transmittances[slot] * self.alphas[slot]
    }

    /// The contributions to the sample at `slot` in `scale`, of `scales` scales.
    #[inline(always)]
    pub fn contributions_of(&self, slot: usize, scale: usize, scales: usize) -> &[Contribution<T>] {
        let [first, end] = self.neighborhoods[slot * scales + scale].contributions;
        &self.contributions.list[first as usize..end as usize]
    }

    /// Number of scales that cover the sample at `slot`, of `scales` scales.
    pub fn covering_scales(&self, slot: usize, scales: usize) -> usize {
        self.neighborhoods[slot * scales..][..scales].iter().filter(|neighborhood| neighborhood.is_covered).count()
    }
}

/// \[scale\] the number of contributions to the samples at `slots`.
pub(super) fn count_contributions(
    neighborhoods: &[Neighborhood],
    slots: impl Iterator<Item = usize>,
    scales: usize,
) -> Vec<u64> {
    let mut counts = vec![0; scales];
    for slot in slots {
        for (count, neighborhood) in counts.iter_mut().zip(&neighborhoods[slot * scales..]) {
            let [first, end] = neighborhood.contributions;
            *count += u64::from(end - first);
        }
    }
    counts
}
