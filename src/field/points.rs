//! The field at points that are on no ray.

use glam::DVec3;
use pulp::{Arch, Simd, WithSimd};
use rayon::prelude::*;

use super::decoder::row_padding;
use super::{Field, Matrix, MatrixMut, Pool, Real, Samples, multiply, vectorized};

/// Points that a thread evaluates together.
const CHUNK: usize = 256;

/// The samples at a chunk of points and their numbers. Reused from one chunk to the next.
#[derive(Default)]
struct PointScratch<T> {
    samples: Samples<T>,
    /// \[slot\]\[ΣR\] appearance components.
    components: Vec<T>,
    /// \[slot\]\[P\] appearance features.
    features: Vec<T>,
}

impl<T: Real> Field<T> {
    /// Writes to \[point\] `densities` the densities σ (spec 4.5) at the points `point(0)`, `point(1)`, …, in model space: 0 where no
    /// sample counts, outside the bounds, the tensors or the occupied cells. On all threads.
    pub fn densities(&self, point: impl Fn(usize) -> DVec3 + Sync, densities: &mut [T]) {
        T::densities(self, &point, densities);
    }

    #[inline(always)]
    pub(super) fn densities_inlined(&self, point: &(dyn Fn(usize) -> DVec3 + Sync), densities: &mut [T]) {
        self.at_points(
            point,
            1,
            densities,
            #[inline(always)]
            |PointScratch { samples, .. }, densities| {
                self.gather_density(samples);
                for (&index, &feature) in samples.tags.iter().zip(&samples.features) {
                    densities[index as usize] = self.density(feature);
                }
            },
        );
    }

    /// Writes to \[point\]\[P\] `appearances` the appearance features (spec 4.6) at the points `point(0)`, `point(1)`, …, in model
    /// space: zeros where no sample counts. On all threads.
    pub fn appearances(&self, point: impl Fn(usize) -> DVec3 + Sync, appearances: &mut [T]) {
        T::appearances(self, &point, appearances);
    }

    #[inline(always)]
    pub(super) fn appearances_inlined(&self, point: &(dyn Fn(usize) -> DVec3 + Sync), appearances: &mut [T]) {
        let width = self.decoder.features;
        self.at_points(
            point,
            width,
            appearances,
            #[inline(always)]
            |scratch, values| {
                Arch::new().dispatch(GatherRows { field: self, scratch });
                let PointScratch { samples, components, features } = scratch;
                let (slots, ranks) = (samples.distances.len(), self.component_count());
                features.resize(slots * width, T::zero());
                multiply(
                    MatrixMut::new(features, slots, width, width),
                    Matrix::new(components, slots, ranks, ranks),
                    Matrix::new(&self.decoder.appearance, width, ranks, ranks).transposed(),
                    false,
                );
                for (&index, row) in samples.tags.iter().zip(features.chunks_exact(width)) {
                    values[index as usize * width..][..width].copy_from_slice(row);
                }
            },
        );
    }

    /// Writes to \[point\]\[width\] `values` what `evaluate` makes of chunks of points, by the samples at those that count; their
    /// tags are their places in the chunk. Zeros for the others.
    #[inline(always)]
    fn at_points(
        &self,
        point: impl Fn(usize) -> DVec3 + Sync,
        width: usize,
        values: &mut [T],
        evaluate: impl Fn(&mut PointScratch<T>, &mut [T]) + Sync,
    ) {
        // Scratch of a pool, so that chunks do not allocate.
        let pool = Pool::<PointScratch<T>>::default();
        values.par_chunks_mut(CHUNK * width).enumerate().for_each(|(chunk, values)| {
            values.fill(T::zero());
            pool.with(|scratch| {
                vectorized(
                    #[inline(always)]
                    || {
                        let points = (0..values.len() / width).map(|n| point(CHUNK * chunk + n));
                        self.locate(points, &mut scratch.samples);
                        evaluate(scratch, values);
                    },
                );
            });
        });
    }

    /// Makes samples of the `points` that count, with their indices as tags.
    #[inline(always)]
    fn locate(&self, points: impl Iterator<Item = DVec3>, samples: &mut Samples<T>) {
        let counting = (0..).zip(points).filter_map(|(index, point)| {
            let position = self.rules.contracted(point);
            let relative = self.relative(position);
            let is_occupied = || self.occupancy.as_ref().is_none_or(|cells| cells.contains(relative));
            (self.bounds.contains(position) && is_occupied()).then_some((index, relative))
        });
        self.assign_tagged_slots(counting, samples);
    }
}

/// Fills the appearance components of all slots.
struct GatherRows<'a, T> {
    field: &'a Field<T>,
    scratch: &'a mut PointScratch<T>,
}

impl<T: Real> WithSimd for GatherRows<'_, T> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { field, scratch: PointScratch { samples, components, .. } } = self;
        let (width, slots) = (field.component_count(), samples.distances.len());
        components.resize(slots * width + row_padding::<T, S>(), T::zero());
        let mut count = 0;
        for slot in 0..slots {
            field.appearance_row(simd, samples, slot, &mut components[slot * width..], &mut count);
        }
        components.truncate(slots * width);
    }
}
