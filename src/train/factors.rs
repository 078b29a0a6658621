//! Gradients of the tensors' factors. One task owns a tensor: it walks the tensor's pairs in the order of chunk and
//! sample, so its vectors and their gradient stay in cache and have one writer.

use aligned_vec::{AVec, CACHELINE_ALIGN};
use pulp::{Arch, Simd, WithSimd};

use super::chunk::Chunk;
use crate::field::{FieldScale, Interpolation, Real, Stage, StageClock, all_but, load, offset, register_at};

/// Position of a scale's components in the row of a shaded sample.
#[derive(Clone, Copy, Debug)]
pub(super) struct ComponentRange {
    /// The scale's first component.
    pub(super) first: usize,
    /// ΣR, the row's length.
    pub(super) width: usize,
}

/// A tensor's gradients, laid out as its factors. Reused.
#[derive(Debug)]
pub(super) struct TensorGradient<T> {
    pub(super) density: AVec<T>,
    pub(super) appearance: AVec<T>,
    /// False if `appearance` is all zeros.
    pub(super) has_appearance: bool,
    /// Time since a step began.
    pub(super) clock: StageClock,
}

impl<T> Default for TensorGradient<T> {
    fn default() -> Self {
        Self {
            density: AVec::new(CACHELINE_ALIGN),
            appearance: AVec::new(CACHELINE_ALIGN),
            has_appearance: false,
            clock: StageClock::default(),
        }
    }
}

impl<T: Real> TensorGradient<T> {
    /// Computes the gradients of tensor `n` of `scale`, whose factors are `density` and `appearance`.
    pub(super) fn accumulate(
        &mut self,
        scale: ScaleGeometry<'_, T>,
        n: usize,
        factors: [&[T]; 2],
        chunks: &[Chunk<T>],
    ) {
        Arch::new().dispatch(Accumulate { sums: self, scale, n, factors, chunks });
    }
}

/// [`TensorGradient::accumulate`].
struct Accumulate<'a, T> {
    sums: &'a mut TensorGradient<T>,
    scale: ScaleGeometry<'a, T>,
    n: usize,
    factors: [&'a [T]; 2],
    chunks: &'a [Chunk<T>],
}

impl<T: Real> WithSimd for Accumulate<'_, T> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { sums, scale, n, factors: [density, appearance], chunks } = self;
        for (gradient, factors) in [(&mut sums.density, density), (&mut sums.appearance, appearance)] {
            gradient.clear();
            gradient.resize(factors.len(), T::zero());
        }
        let (of_density, of_appearance) = (sums.density.as_mut_slice(), sums.appearance.as_mut_slice());
        let center = scale.centers[n];
        let [density_rank, appearance_rank] = scale.ranks;
        for chunk in chunks {
            for pair in chunk.density_pairs.of(scale.first_tensor + n) {
                let at = scale.rows.at(offset(chunk.samples.positions[pair.place as usize], center));
                let gradient = T::splat(simd, pair.weight);
                add(
                    simd,
                    density,
                    of_density,
                    density_rank,
                    &at,
                    #[inline(always)]
                    |_| gradient,
                );
            }
        }
        sums.clock.lap(Stage::DensityBackward);
        sums.has_appearance = false;
        for chunk in chunks {
            for pair in chunk.appearance_pairs.of(scale.first_tensor + n) {
                sums.has_appearance = true;
                let weight = T::splat(simd, pair.weight);
                let first = pair.row as usize * scale.components.width + scale.components.first;
                let gradients = &chunk.component_gradients[first..][..appearance_rank];
                let at = scale.rows.at(offset(chunk.samples.positions[pair.place as usize], center));
                add(
                    simd,
                    appearance,
                    of_appearance,
                    appearance_rank,
                    &at,
                    #[inline(always)]
                    |first| T::times(simd, weight, T::load(simd, &gradients[first..])),
                );
            }
        }
        sums.clock.lap(Stage::AppearanceBackward);
    }
}

/// Adds one pair's gradients: each of x·y·z by the product of the other two, shared between the two vertices.
/// `component(r)` is ∂L/∂component for the register that begins with component r.
#[inline(always)]
fn add<T: Real, S: Simd>(
    simd: S,
    factors: &[T],
    gradients: &mut [T],
    rank: usize,
    at: &Interpolation<T>,
    component: impl Fn(usize) -> T::Register<S>,
) {
    // Apart, so that full registers are not burdened with what others need.
    if rank >= T::lanes::<S>() {
        add_registers::<T, S, true>(simd, factors, gradients, rank, at, component);
    } else {
        add_registers::<T, S, false>(simd, factors, gradients, rank, at, component);
    }
}

/// [`add`] with registers of which all, or not all, are full.
#[inline(always)]
fn add_registers<T: Real, S: Simd, const FULL: bool>(
    simd: S,
    factors: &[T],
    gradients: &mut [T],
    rank: usize,
    at: &Interpolation<T>,
    component: impl Fn(usize) -> T::Register<S>,
) {
    // No `map` over arrays of registers: it is compiled for the least instruction set.
    let [fx, fy, fz] = at.fractions;
    let fractions = [T::splat(simd, fx), T::splat(simd, fy), T::splat(simd, fz)];
    let firsts = [at.rows[0] * rank, at.rows[1] * rank, at.rows[2] * rank];
    for n in 0..rank.div_ceil(T::lanes::<S>()) {
        let (first, overlap) = register_at::<T, S>(rank, n);
        let mut values = fractions;
        for a in 0..3 {
            let rows = &factors[firsts[a]..][..2 * rank];
            let lower = load::<T, S, FULL>(simd, &rows[first..rank]);
            let upper = load::<T, S, FULL>(simd, &rows[rank + first..]);
            values[a] = T::times_plus(simd, fractions[a], T::minus(simd, upper, lower), lower);
        }
        let mut gradient = component(first);
        if overlap > 0 {
            gradient = T::times(simd, gradient, all_but::<T, S>(simd, overlap));
        }
        let [x, y, z] = values;
        let with_x = T::times(simd, gradient, x);
        let of_axes =
            [T::times(simd, T::times(simd, gradient, y), z), T::times(simd, with_x, z), T::times(simd, with_x, y)];
        for a in 0..3 {
            let (lower, upper) = gradients[firsts[a]..][..2 * rank].split_at_mut(rank);
            let (lower, upper) = (&mut lower[first..], &mut upper[first..]);
            let to_upper = T::times(simd, fractions[a], of_axes[a]);
            let to_lower = T::minus(simd, of_axes[a], to_upper);
            let new_lower = T::plus(simd, load::<T, S, FULL>(simd, lower), to_lower);
            let new_upper = T::plus(simd, load::<T, S, FULL>(simd, upper), to_upper);
            if FULL {
                T::store_full(simd, lower, new_lower);
                T::store_full(simd, upper, new_upper);
            } else {
                T::store(simd, lower, new_lower);
                T::store(simd, upper, new_upper);
            }
        }
    }
}

/// The inputs of a scale's gradients other than its factors, which the optimizer borrows meanwhile.
#[derive(Clone, Copy, Debug)]
pub(super) struct ScaleGeometry<'a, T> {
    pub(super) first_tensor: usize,
    pub(super) centers: &'a [[T; 3]],
    pub(super) rows: crate::field::TensorRows<T>,
    pub(super) resolution: [u32; 3],
    /// Density and appearance.
    pub(super) ranks: [usize; 2],
    pub(super) components: ComponentRange,
}

impl<'a, T: Real> ScaleGeometry<'a, T> {
    pub(super) fn new(scale: &FieldScale<T>, centers: &'a [[T; 3]], components: ComponentRange) -> Self {
        Self {
            first_tensor: scale.first_tensor as usize,
            centers,
            rows: *scale.rows(),
            resolution: scale.resolution,
            ranks: [scale.density_rank, scale.appearance_rank],
            components,
        }
    }
}
