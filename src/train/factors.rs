//! Gradients of the tensors' factors. One task owns a tensor: it walks the tensor's pairs in the order of chunk and
//! sample, so its vectors and their gradient stay in cache and have one writer.

use aligned_vec::{AVec, CACHELINE_ALIGN};
use pulp::{Arch, Simd, WithSimd};

use super::chunk::{Chunk, ShadedGradient};
use crate::field::{FieldScale, Interpolation, Real, Stage, StageClock, offset};

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
    /// Factors, each row a multiple of a register.
    padded: AVec<T>,
    /// The scale's part of [`ScaleGeometry::own_rows`], padded alike.
    own_rows: AVec<T>,
}

impl<T> Default for TensorGradient<T> {
    fn default() -> Self {
        let none = || AVec::new(CACHELINE_ALIGN);
        Self {
            density: none(),
            appearance: none(),
            has_appearance: false,
            clock: StageClock::default(),
            padded: none(),
            own_rows: none(),
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
        let TensorGradient { density: of_density, appearance: of_appearance, padded, own_rows, .. } = sums;
        let center = scale.centers[n];
        let tensor = scale.first_tensor + n;

        let rank = density.len() / scale.rows.count;
        let stride = rank.next_multiple_of(T::lanes::<S>());
        let factors = pad_rows(density, rank, stride, padded);
        reset(of_density, scale.rows.count * stride);
        for chunk in chunks {
            for pair in chunk.density_pairs.of(tensor) {
                let at = scale.rows.at(offset(chunk.positions[pair.place as usize], center));
                let gradient = T::splat(simd, pair.weight);
                add(
                    simd,
                    factors,
                    of_density,
                    stride,
                    &at,
                    #[inline(always)]
                    |_| gradient,
                );
            }
        }
        unpad_rows(of_density, rank, stride);
        sums.clock.lap(Stage::DensityBackward);

        let ComponentRange { first: begin, width } = scale.components;
        let rank = appearance.len() / scale.rows.count;
        let stride = rank.next_multiple_of(T::lanes::<S>());
        let factors = pad_rows(appearance, rank, stride, padded);
        reset(of_appearance, scale.rows.count * stride);
        let has_own = scale.own_rows.is_some();
        if let Some(rows) = scale.own_rows {
            reset(own_rows, 3 * stride);
            for (padded, row) in own_rows.chunks_exact_mut(stride.max(1)).zip(rows.chunks_exact(width)) {
                padded[..rank].copy_from_slice(&row[begin..begin + rank]);
            }
        }
        sums.has_appearance = false;
        for chunk in chunks {
            for pair in chunk.appearance_pairs.of(tensor) {
                sums.has_appearance = true;
                let ShadedGradient { row, share, own } = chunk.shaded_gradients[pair.shaded as usize];
                let share = T::splat(simd, pair.weight * share);
                let gradients = &chunk.component_gradients[row as usize * width + begin..];
                let [x, y, z] = own;
                let own =
                    [T::splat(simd, pair.weight * x), T::splat(simd, pair.weight * y), T::splat(simd, pair.weight * z)];
                let at = scale.rows.at(offset(chunk.positions[pair.place as usize], center));
                add(
                    simd,
                    factors,
                    of_appearance,
                    stride,
                    &at,
                    #[inline(always)]
                    |first| {
                        // Gradients beyond the tensor's last component are removed with the ends of the padded rows.
                        let mut gradient = T::times(simd, share, T::load(simd, &gradients[first..]));
                        if has_own {
                            for p in 0..3 {
                                let row = T::load(simd, &own_rows[p * stride + first..]);
                                gradient = T::times_plus(simd, own[p], row, gradient);
                            }
                        }
                        gradient
                    },
                );
            }
        }
        unpad_rows(of_appearance, rank, stride);
        sums.clock.lap(Stage::AppearanceBackward);
    }
}

/// `len` zeros.
#[inline(always)]
fn reset<T: Real>(values: &mut AVec<T>, len: usize) {
    values.clear();
    values.resize(len, T::zero());
}

/// `values`, rows of `rank` components, as rows of `stride` in `padded`, with zeros at their ends.
#[inline(always)]
fn pad_rows<'v, T: Real>(values: &'v [T], rank: usize, stride: usize, padded: &'v mut AVec<T>) -> &'v [T] {
    if rank == stride {
        return values;
    }
    reset(padded, values.len() / rank * stride);
    for (padded, row) in padded.chunks_exact_mut(stride).zip(values.chunks_exact(rank)) {
        padded[..rank].copy_from_slice(row);
    }
    padded
}

/// Removes the ends of rows that [`pad_rows`] adds.
#[inline(always)]
fn unpad_rows<T: Real>(values: &mut AVec<T>, rank: usize, stride: usize) {
    if rank == stride {
        return;
    }
    let rows = values.len() / stride;
    for row in 1..rows {
        values.copy_within(row * stride..row * stride + rank, row * rank);
    }
    values.truncate(rows * rank);
}

/// Adds one pair's gradients: each of x·y·z by the product of the other two, shared between the two vertices. Rows have
/// `stride` components, a multiple of a register's. `component(r)` is ∂L/∂component for the register that begins with
/// component r.
#[inline(always)]
fn add<T: Real, S: Simd>(
    simd: S,
    factors: &[T],
    gradients: &mut [T],
    stride: usize,
    at: &Interpolation<T>,
    component: impl Fn(usize) -> T::Register<S>,
) {
    // No `map` over arrays of registers: it is compiled for the least instruction set.
    let [fx, fy, fz] = at.fractions;
    let fractions = [T::splat(simd, fx), T::splat(simd, fy), T::splat(simd, fz)];
    let firsts = [at.rows[0] * stride, at.rows[1] * stride, at.rows[2] * stride];
    for first in (0..stride).step_by(T::lanes::<S>()) {
        let mut values = fractions;
        for a in 0..3 {
            let rows = &factors[firsts[a] + first..];
            let (lower, upper) = (T::load(simd, rows), T::load(simd, &rows[stride..]));
            values[a] = T::times_plus(simd, fractions[a], T::minus(simd, upper, lower), lower);
        }
        let gradient = component(first);
        let [x, y, z] = values;
        let with_x = T::times(simd, gradient, x);
        let of_axes =
            [T::times(simd, T::times(simd, gradient, y), z), T::times(simd, with_x, z), T::times(simd, with_x, y)];
        for a in 0..3 {
            let rows = &mut gradients[firsts[a] + first..];
            let to_upper = T::times(simd, fractions[a], of_axes[a]);
            let to_lower = T::minus(simd, of_axes[a], to_upper);
            T::store(simd, rows, T::plus(simd, T::load(simd, rows), to_lower));
            let rows = &mut rows[stride..];
            T::store(simd, rows, T::plus(simd, T::load(simd, rows), to_upper));
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
    pub(super) components: ComponentRange,
    /// The first three rows of the appearance matrices, if samples have residual colors.
    pub(super) own_rows: Option<&'a [T]>,
}

impl<'a, T: Real> ScaleGeometry<'a, T> {
    pub(super) fn new(
        scale: &FieldScale<T>,
        centers: &'a [[T; 3]],
        components: ComponentRange,
        own_rows: Option<&'a [T]>,
    ) -> Self {
        Self {
            first_tensor: scale.first_tensor as usize,
            centers,
            rows: *scale.rows(),
            resolution: scale.resolution,
            components,
            own_rows,
        }
    }
}
