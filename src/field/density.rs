//! Neighbors and density features of pending samples, and optical depths (spec 4.2 to 4.5). Twin:
//! `shaders/density.wgsl`.

use std::ops::Range;

use pulp::{Arch, Simd, WithSimd};

use super::neighbors::Neighbors;
use super::{Field, Real, Samples};
use strivec_format::model::{Coverage, Reduction};

impl<T: Real> Field<T> {
    /// The density feature at `position`, relative to the field's origin; `None` outside the model. For single points.
    /// `samples` is scratch.
    #[inline(always)]
    pub fn density_feature(&self, position: [T; 3], samples: &mut Samples<T>) -> Option<T> {
        let mut found = None;
        self.density_features([position].into_iter(), samples, |_, feature| found = Some(feature));
        found
    }

    /// Calls `take` with the index and the density feature of each of the `positions` that is in the model. `samples`
    /// is scratch.
    #[inline(always)]
    pub fn density_features(
        &self,
        positions: impl Iterator<Item = [T; 3]>,
        samples: &mut Samples<T>,
        mut take: impl FnMut(usize, T),
    ) {
        self.assign_tagged_slots((0..).zip(positions), samples);
        self.gather_density(samples);
        for (&index, &feature) in samples.tags.iter().zip(&samples.features) {
            take(index as usize, feature);
        }
    }

    /// Assigns slots to those of the tagged `positions` that are in the model, with neighbors and without features.
    /// `samples.tags` gets the tag of each slot.
    #[inline(always)]
    pub(super) fn assign_tagged_slots(&self, positions: impl Iterator<Item = (u32, [T; 3])>, samples: &mut Samples<T>) {
        samples.clear(0);
        samples.clear_pending();
        let mut tags = std::mem::take(&mut samples.tags);
        tags.clear();
        for (tag, position) in positions {
            tags.push(tag);
            // There is no ray, and so no distance along it.
            samples.push_pending(T::zero(), position);
        }
        samples.pending_positions.pad();
        self.find_neighbors(samples);
        let mut slots = 0;
        self.assign_covered_slots(samples, 0..tags.len(), |index| {
            // A slot is never behind its pending sample.
            tags[slots] = tags[index];
            slots += 1;
        });
        tags.truncate(slots);
        samples.tags = tags;
    }

    /// False if no sample between `min` and `max`, relative to the field's origin, counts.
    pub fn may_count_in(&self, min: [T; 3], max: [T; 3]) -> bool {
        self.cells().is_none_or(|cells| cells.any_in(min, max))
    }

    /// Appends the contributions to the pending samples.
    #[inline(always)]
    pub(super) fn find_neighbors(&self, samples: &mut Samples<T>) {
        Arch::new().dispatch(FindNeighbors { field: self, samples });
    }

    /// Appends the density features of all slots that have none yet.
    #[inline(always)]
    pub(super) fn gather_density(&self, samples: &mut Samples<T>) {
        Arch::new().dispatch(GatherDensity { field: self, samples });
    }

    /// Assigns slots to those of the `pending` samples that are in the model (spec 4.1). Calls `assigned` with the index
    /// of each among the pending ones, in the order of the slots.
    #[inline(always)]
    pub(super) fn assign_covered_slots(
        &self,
        samples: &mut Samples<T>,
        pending: Range<usize>,
        mut assigned: impl FnMut(usize),
    ) {
        let scales = self.scales.len();
        let needed = match self.rules.coverage {
            Coverage::All => scales,
            Coverage::Any => 1,
        };
        let Samples { pending_neighborhoods, neighborhoods, .. } = samples;
        for index in pending {
            let first = neighborhoods.len();
            neighborhoods.extend((0..scales).map(|s| pending_neighborhoods[s * samples.pending.len() + index]));
            let covering = neighborhoods[first..].iter().filter(|neighborhood| neighborhood.is_covered).count();
            if covering < needed {
                neighborhoods.truncate(first);
                continue;
            }
            samples.distances.push(samples.pending[index]);
            samples.positions.push(samples.pending_positions.get(index));
            assigned(index);
        }
    }

    /// The optical depth σ·δ·distance_scale of a density feature f (spec 4.5, 4.8).
    #[inline(always)]
    pub fn optical_depth(&self, feature: T) -> T {
        self.density(feature) * T::of(self.rules.step * self.rules.distance_scale)
    }

    /// The density σ = softplus(f + density_shift) of a density feature f (spec 4.5).
    #[inline(always)]
    pub fn density(&self, feature: T) -> T {
        let x = feature + T::of(self.rules.density_shift);
        // ln(1 + e^x) without overflow: the exponent is never positive.
        x.max(T::zero()) + (-x.abs()).exp_of_negative().ln_1p_of_unit()
    }

    /// The derivative of [`Field::optical_depth`] by the density feature.
    #[inline(always)]
    pub fn optical_depth_slope(&self, feature: T) -> T {
        let x = feature + T::of(self.rules.density_shift);
        let e = (-x.abs()).exp_of_negative();
        // The sigmoid of x, written with the exponent that cannot overflow.
        let above = if x > T::zero() { T::one() } else { e };
        above / (T::one() + e) * T::of(self.rules.step * self.rules.distance_scale)
    }
}

/// [`Field::find_neighbors`].
struct FindNeighbors<'a, T> {
    field: &'a Field<T>,
    samples: &'a mut Samples<T>,
}

impl<T: Real> WithSimd for FindNeighbors<'_, T> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Samples { pending_positions, pending_neighborhoods, contributions, .. } = self.samples;
        pending_neighborhoods.clear();
        let mut found = Neighbors::new(self.field.rules.aggregation, contributions, pending_neighborhoods);
        for scale in &self.field.scales {
            scale.find_nearest(simd, pending_positions, &mut found);
        }
    }
}

/// [`Field::gather_density`].
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
        let mut count = 0;
        let mut features = std::mem::take(&mut samples.features);
        // Sample by sample: in the order of groups or of scales it is not faster
        // (docs/experiments/2026-11-25-lean-training.md, docs/experiments/2026-11-25-held-components.md).
        for slot in first_slot..samples.positions.len() {
            let mut sums = T::splat(simd, T::zero());
            for (s, scale) in field.scales.iter().enumerate() {
                sums = scale.add_density(simd, samples.contributions_of(slot, s, scales), sums, &mut count);
            }
            features.push(T::total(simd, sums));
        }
        samples.features = features;
        if field.rules.density_reduction == Reduction::Mean {
            for slot in first_slot..samples.positions.len() {
                let covering = samples.covering_scales(slot, scales);
                samples.features[slot] /= T::of(covering as f64);
            }
        }
        samples.clock.work.density_components += count as u64;
    }
}
