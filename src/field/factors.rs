//! The factors of a scale's tensors, each with the components that it holds.
//!
//! Besides `matrix.rs` the only file of the crate with `unsafe` code: registers of factors are loaded without a bounds check
//! each, which takes half of the time of a gather.

#![expect(unsafe_code, reason = "one check per contribution replaces those of a dozen loads")]

use aligned_vec::{AVec, CACHELINE_ALIGN};
use pulp::Simd;

use super::Real;
use super::vector::MAX_LANES;

/// The factors of density, or of appearance, of a scale's tensors. A tensor holds some components of the scale, and has
/// none of the others, which are zero: they cost neither memory nor time. Density components are those that are not zero.
/// Appearance components are the first of the scale up to the last that is not zero, so that a register of them has its
/// place in the rows that the appearance matrix multiplies.
#[derive(Clone, Debug)]
pub struct FieldFactors<T> {
    held: HeldComponents,
    /// \[tensor\]\[axis\]\[vertex\]\[held component\]; then a register of zeros, as kernels read whole registers.
    values: AVec<T>,
}

/// The components that tensors hold.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct HeldComponents {
    /// Components of the scale.
    rank: usize,
    /// Rows (vertices of all three axes) of a tensor.
    rows: usize,
    /// \[tensor\] the index in `components` of its first; then their number.
    starts: Vec<u32>,
    /// The components of each tensor, ascending.
    components: Vec<u16>,
}

impl HeldComponents {
    /// Components of the scale: the most that a tensor may hold.
    #[inline(always)]
    pub fn rank(&self) -> usize {
        self.rank
    }

    /// The components that `tensor` holds, ascending.
    #[inline(always)]
    pub fn of(&self, tensor: usize) -> &[u16] {
        &self.components[self.range(tensor)]
    }

    /// The number of components that `tensor` holds.
    #[inline(always)]
    pub fn count(&self, tensor: usize) -> usize {
        (self.starts[tensor + 1] - self.starts[tensor]) as usize
    }

    /// The range of the factors of `tensor` among those of all.
    #[inline(always)]
    pub fn values(&self, tensor: usize) -> std::ops::Range<usize> {
        let std::ops::Range { start, end } = self.range(tensor);
        start * self.rows..end * self.rows
    }

    /// Number of tensors.
    pub fn tensors(&self) -> usize {
        self.starts.len() - 1
    }

    /// Components of all tensors.
    pub fn components(&self) -> usize {
        self.components.len()
    }

    /// Number of factors of all tensors.
    pub fn value_count(&self) -> usize {
        self.components.len() * self.rows
    }

    /// `values`, laid out as the factors, as \[tensor\]\[axis\]\[vertex\]\[component\] with zeros for the components that
    /// tensors do not hold.
    #[cfg(any(feature = "toolkit", test))]
    pub fn dense<T: Real>(&self, values: &[T]) -> Vec<T> {
        let mut dense = vec![T::zero(); self.tensors() * self.rows * self.rank];
        for (tensor, dense) in dense.chunks_exact_mut((self.rows * self.rank).max(1)).enumerate() {
            let held = self.of(tensor);
            let values = &values[self.values(tensor)];
            for (row, dense) in values.chunks_exact(held.len().max(1)).zip(dense.chunks_exact_mut(self.rank)) {
                for (&component, &value) in held.iter().zip(row) {
                    dense[component as usize] = value;
                }
            }
        }
        dense
    }

    /// The held components of the same tensors, if these hold \[tensor\] `components`, which ascend.
    #[cfg(feature = "toolkit")]
    pub(crate) fn of_components(&self, components: &[Vec<u16>]) -> Self {
        let ends = components.iter().scan(0, |end, of_tensor| {
            *end += of_tensor.len() as u32;
            Some(*end)
        });
        let starts = std::iter::once(0).chain(ends).collect();
        Self { rank: self.rank, rows: self.rows, starts, components: components.concat() }
    }

    /// `values`, laid out as the factors, laid out for the tensors that hold `to`, whose component c is `order`\[c\] of this;
    /// with zeros for what this does not hold.
    #[cfg(feature = "toolkit")]
    pub(crate) fn rearranged<T: Real>(&self, values: &[T], to: &Self, order: &[u16]) -> Vec<T> {
        let mut rearranged = Vec::with_capacity(to.value_count());
        for tensor in 0..self.tensors() {
            let held = self.of(tensor);
            let places: Vec<Option<usize>> =
                to.of(tensor).iter().map(|&c| held.binary_search(&order[c as usize]).ok()).collect();
            let values = &values[self.values(tensor)];
            for row in 0..self.rows {
                let row = &values[row * held.len()..][..held.len()];
                rearranged.extend(places.iter().map(|place| place.map_or(T::zero(), |place| row[place])));
            }
        }
        rearranged
    }

    /// \[tensor\] its `values`, which are laid out as the factors, with another number of rows: `resampled` returns them from
    /// the old ones and their number of components.
    pub(crate) fn resampled<T: Real>(
        &self,
        values: &[T],
        resampled: impl Fn(&[T], usize) -> Vec<T>,
    ) -> impl Iterator<Item = Vec<T>> {
        (0..self.tensors()).map(move |n| resampled(&values[self.values(n)], self.count(n)))
    }

    /// The range of the components of `tensor` among those of all.
    #[inline(always)]
    pub(crate) fn range(&self, tensor: usize) -> std::ops::Range<usize> {
        self.starts[tensor] as usize..self.starts[tensor + 1] as usize
    }

    /// Splits `values` by tensor: those of the factors, or one for each component.
    #[cfg(feature = "toolkit")]
    pub(crate) fn split_mut<'v, T>(&self, mut values: &'v mut [T]) -> Vec<&'v mut [T]> {
        let each = values.len() / self.components().max(1);
        let tensor = |n| {
            let (of_tensor, rest) = std::mem::take(&mut values).split_at_mut(each * self.count(n));
            values = rest;
            of_tensor
        };
        (0..self.tensors()).map(tensor).collect()
    }
}

/// A neighbor of a sample, its weight, and where the sample is in it (spec 4.2 to 4.4).
#[derive(Clone, Copy, Debug, Default)]
pub struct Contribution<T> {
    /// The tensor's index over all scales.
    pub tensor: u32,
    /// The lower of the two rows on each axis, an index over the tensor's rows.
    pub rows: [u32; 3],
    /// The fraction of the way to the next row, per axis, in [0, 1].
    pub fractions: [T; 3],
    /// The weight w of the tensor in its scale.
    pub weight: T,
}

/// Which components of a tensor a field holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Holding {
    /// Those that are not zero.
    Nonzero,
    /// All up to the last that is not zero, so that they are the first of the scale.
    UpToLast,
}

impl<T: Real> FieldFactors<T> {
    /// From `dense`, \[tensor\]\[row\]\[component\] of tensors of `rows` rows and `rank` components, those that `holding`
    /// says.
    pub(super) fn new(holding: Holding, dense: &[f32], rows: usize, rank: usize) -> Self {
        Self::without(holding, dense, rows, rank, |_, _| false)
    }

    /// As [`FieldFactors::new`]; the components of a tensor for which `is_zero`(tensor, component) count as zero.
    pub(crate) fn without(
        holding: Holding,
        dense: &[f32],
        rows: usize,
        rank: usize,
        is_zero: impl Fn(usize, usize) -> bool,
    ) -> Self {
        let tensors = || dense.chunks_exact((rows * rank).max(1));
        let mut held = HeldComponents { rank, rows, starts: vec![0], components: Vec::new() };
        for (n, tensor) in tensors().enumerate() {
            let is_nonzero = |c: &usize| !is_zero(n, *c) && tensor.iter().skip(*c).step_by(rank).any(|v| *v != 0.0);
            match holding {
                Holding::Nonzero => held.components.extend((0..rank).filter(is_nonzero).map(|c| c as u16)),
                Holding::UpToLast => {
                    let last = (0..rank).rev().find(is_nonzero);
                    held.components.extend(last.into_iter().flat_map(|last| 0..=last).map(|c| c as u16));
                }
            }
            held.starts.push(held.components.len() as u32);
        }
        let mut values = AVec::with_capacity(CACHELINE_ALIGN, held.value_count() + MAX_LANES);
        for (n, tensor) in tensors().enumerate() {
            for row in tensor.chunks_exact(rank) {
                let value = |c: usize| if is_zero(n, c) { T::zero() } else { T::of_f32(row[c]) };
                held.of(n).iter().for_each(|&component| values.push(value(component as usize)));
            }
        }
        values.resize(values.len() + MAX_LANES, T::zero());
        Self { held, values }
    }

    /// The components that tensors hold.
    #[inline(always)]
    pub fn held(&self) -> &HeldComponents {
        &self.held
    }

    /// \[tensor\]\[axis\]\[vertex\]\[held component\] the factors.
    pub fn values(&self) -> &[T] {
        &self.values[..self.held.value_count()]
    }

    /// As [`FieldFactors::values`], to change.
    pub fn values_mut(&mut self) -> &mut [T] {
        let count = self.held.value_count();
        &mut self.values[..count]
    }

    /// The factors to change, and the components that tensors hold.
    #[cfg(feature = "toolkit")]
    pub(crate) fn split(&mut self) -> (&HeldComponents, &mut [T]) {
        let count = self.held.value_count();
        (&self.held, &mut self.values[..count])
    }

    /// The rows of `tensor`, a scale's, that `contribution` is between.
    ///
    /// # Panics
    ///
    /// If the tensor has no such rows.
    #[inline(always)]
    pub(super) fn rows_of<S: Simd>(
        &self,
        simd: S,
        tensor: usize,
        contribution: &Contribution<T>,
    ) -> RowPairs<'_, T, S> {
        let Self { held, values } = self;
        let std::ops::Range { start, end } = held.range(tensor);
        let Contribution { rows: [x, y, z], fractions, weight, .. } = *contribution;
        let last = x.max(y).max(z);
        assert!((last as usize) + 1 < held.rows, "a row of a tensor");
        let rank = end - start;
        // `values` has `rows` rows for each of the components before `end`, and a register more.
        let first = values.as_ptr().wrapping_add(start * held.rows);
        RowPairs {
            lower: [x, y, z].map(|row| first.wrapping_add(row as usize * rank)),
            rank,
            fractions: [T::splat(simd, fractions[0]), T::splat(simd, fractions[1]), T::splat(simd, fractions[2])],
            weight: T::splat(simd, weight),
            factors: std::marker::PhantomData,
        }
    }

    /// Holds the components `held`, of the same tensors; its component c was `order`\[c\].
    #[cfg(feature = "toolkit")]
    pub(crate) fn rearrange(&mut self, held: HeldComponents, order: &[u16]) {
        let mut values = AVec::with_capacity(CACHELINE_ALIGN, held.value_count() + MAX_LANES);
        values.extend_from_slice(&self.held.rearranged(self.values(), &held, order));
        values.resize(values.len() + MAX_LANES, T::zero());
        *self = Self { held, values };
    }

    /// Gives tensors `rows` rows: `resampled` returns a tensor's new factors from the old ones and their number of
    /// components.
    pub(super) fn resample(&mut self, rows: usize, resampled: impl Fn(&[T], usize) -> Vec<T>) {
        let mut values = AVec::with_capacity(CACHELINE_ALIGN, self.held.components() * rows + MAX_LANES);
        for (tensor, new) in self.held.resampled(&self.values, resampled).enumerate() {
            assert_eq!(new.len(), self.held.count(tensor) * rows, "factors of tensor {tensor}");
            values.extend_from_slice(&new);
        }
        values.resize(values.len() + MAX_LANES, T::zero());
        self.values = values;
        self.held.rows = rows;
    }
}

/// The rows of a tensor that a sample is between, two on each axis, for registers of `S`.
pub(super) struct RowPairs<'a, T: Real, S: Simd> {
    /// \[axis\] the lower row, which is not the tensor's last: at least twice `rank` factors, and a register.
    lower: [*const T; 3],
    /// The number of components that the tensor holds.
    rank: usize,
    fractions: [T::Register<S>; 3],
    weight: T::Register<S>,
    factors: std::marker::PhantomData<&'a [T]>,
}

impl<T: Real, S: Simd> RowPairs<'_, T, S> {
    /// The number of components that the tensor holds.
    #[inline(always)]
    pub(super) fn rank(&self) -> usize {
        self.rank
    }

    /// `sums` plus weight·x·y·z of all components, in registers.
    #[inline(always)]
    pub(super) fn add_all(&self, simd: S, mut sums: T::Register<S>) -> T::Register<S> {
        for first in (0..self.rank).step_by(T::lanes::<S>()) {
            sums = self.add(simd, first, sums);
        }
        sums
    }

    /// `sums` plus weight·x·y·z of a register of components from `first` on; no more, behind the last component.
    #[inline(always)]
    pub(super) fn add(&self, simd: S, first: usize, sums: T::Register<S>) -> T::Register<S> {
        if first >= self.rank {
            return sums;
        }
        let mut products = self.weight;
        for a in 0..3 {
            let lower = self.lower[a].wrapping_add(first);
            // SAFETY: The lower row is not the tensor's last and component `first` is held, so both registers begin within
            // the tensor's factors, which at least a register of other numbers follows.
            let (lower, upper) = unsafe {
                let upper = lower.wrapping_add(self.rank);
                (lower.cast::<T::Register<S>>().read_unaligned(), upper.cast::<T::Register<S>>().read_unaligned())
            };
            let value = T::times_plus(simd, self.fractions[a], T::minus(simd, upper, lower), lower);
            products = T::times(simd, products, value);
        }
        let count = self.rank - first;
        if count < T::lanes::<S>() {
            // The register ends with numbers of the next rows.
            let last = T::splat(simd, T::of_i32(count as i32 - 1));
            let is_held = T::less_or_equal(simd, T::load(simd, &T::LANES), last);
            products = T::select(simd, is_held, products, T::splat(simd, T::zero()));
        }
        T::plus(simd, sums, products)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two tensors of three rows and three components: of the first the middle component is zero, of the second the last.
    const DENSE: [f32; 18] = [1., 0., 2., 3., 0., 4., 5., 0., 0., 6., 7., 0., 0., 8., 0., 9., 0., 0.];

    #[test]
    fn tensors_hold_the_components_that_are_not_zero_and_give_them_back() {
        let factors = FieldFactors::<f64>::new(Holding::Nonzero, &DENSE, 3, 3);
        let held = factors.held();
        assert_eq!([held.of(0), held.of(1)], [&[0, 2], &[0, 1]]);
        assert_eq!(factors.values(), [1., 2., 3., 4., 5., 0., 6., 7., 0., 8., 9., 0.]);
        assert_eq!(held.dense(factors.values()), DENSE.map(f64::from));
    }

    #[test]
    fn up_to_the_last_component_zeros_between_are_held() {
        let factors = FieldFactors::<f32>::new(Holding::UpToLast, &DENSE, 3, 3);
        assert_eq!([factors.held().of(0), factors.held().of(1)], [&[0, 1, 2][..], &[0, 1]]);
        assert_eq!(factors.held().dense(factors.values()), DENSE);
    }

    #[test]
    fn components_that_count_as_zero_are_left_out() {
        let factors = FieldFactors::<f32>::without(Holding::UpToLast, &DENSE, 3, 3, |n, c| n == 1 || c == 2);
        assert_eq!([factors.held().of(0), factors.held().of(1)], [&[0][..], &[]]);
        assert_eq!(factors.values(), [1., 3., 5.]);
        let hole = FieldFactors::<f32>::without(Holding::UpToLast, &DENSE, 3, 3, |n, c| n == 0 && c == 0);
        assert_eq!(hole.values()[..9], [0., 0., 2., 0., 0., 4., 0., 0., 0.]);
    }

    #[test]
    #[should_panic = "a row of a tensor"]
    fn rows_that_a_tensor_lacks_are_refused() {
        let factors = FieldFactors::<f32>::new(Holding::Nonzero, &DENSE, 3, 3);
        let contribution = Contribution { rows: [0, 1, 2], ..Contribution::default() };
        factors.rows_of(pulp::Scalar, 0, &contribution);
    }
}
