//! The factors of a scale's tensors, each with the components that it holds.
//!
//! Besides `matrix.rs` the only file of the crate with `unsafe` code: registers of factors are loaded without a bounds check
//! each, which takes half of the time of a gather.

#![expect(unsafe_code, reason = "one check per contribution replaces those of a dozen loads")]

use aligned_vec::{AVec, CACHELINE_ALIGN};
use pulp::Simd;

use super::Real;
use super::vector::MAX_LANES;
use strivec_format::model::{Block, Form};

/// The factors of the components of one form, of density or of appearance, of a scale's tensors. A tensor holds some components of the scale, and has
/// none of the others, which are zero: they cost neither memory nor time. Density components are those that are not zero.
/// Appearance components are the first of the scale up to the last that is not zero, so that a register of them has its
/// place in the rows that the appearance matrix multiplies (docs/experiments/2026-11-25-held-components.md).
///
/// Factors have 32 bits: 16 bits that registers convert gain 1 to 2 % of a frame on one family of processors
/// (docs/experiments/2026-11-26-frame-in-tiles.md).
#[derive(Clone, Debug)]
pub struct FieldFactors<T> {
    form: Form,
    /// Vertices along each axis.
    vertices: [u32; 3],
    held: HeldComponents,
    /// \[tensor\]\[row\]\[held component\]; then a register of zeros, as kernels read whole registers.
    values: AVec<T>,
}

/// The components that tensors hold.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct HeldComponents {
    /// Components of the scale.
    rank: usize,
    /// Rows (vertices of all factors) of a tensor.
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

    /// `values`, laid out as the factors, as \[tensor\]\[row\]\[component\] with zeros for the components that
    /// tensors do not hold.
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
    pub fn of_components(&self, components: &[Vec<u16>]) -> Self {
        let ends = components.iter().scan(0_usize, |end, of_tensor| {
            *end += of_tensor.len();
            Some(component_start(*end))
        });
        let starts = std::iter::once(0).chain(ends).collect();
        Self { rank: self.rank, rows: self.rows, starts, components: components.concat() }
    }

    /// `values`, laid out as the factors, laid out for the tensors that hold `to`, whose component c is `order`\[c\] of this;
    /// with zeros for what this does not hold.
    pub fn rearranged<T: Real>(&self, values: &[T], to: &Self, order: &[u16]) -> Vec<T> {
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
    pub fn resampled<T: Real>(
        &self,
        values: &[T],
        resampled: impl Fn(&[T], usize) -> Vec<T>,
    ) -> impl Iterator<Item = Vec<T>> {
        (0..self.tensors()).map(move |n| resampled(&values[self.values(n)], self.count(n)))
    }

    /// The range of the components of `tensor` among those of all.
    #[inline(always)]
    pub fn range(&self, tensor: usize) -> std::ops::Range<usize> {
        self.starts[tensor] as usize..self.starts[tensor + 1] as usize
    }

    /// Splits `values` by tensor: those of the factors, or one for each component.
    pub fn split_mut<'v, T>(&self, mut values: &'v mut [T]) -> Vec<&'v mut [T]> {
        let each = values.len() / self.components().max(1);
        let tensor = |n| {
            let (of_tensor, rest) = std::mem::take(&mut values).split_at_mut(each * self.count(n));
            values = rest;
            of_tensor
        };
        (0..self.tensors()).map(tensor).collect()
    }
}

/// `components`, a number of components of some tensors, as the start of the next. It must not wrap: loads trust it.
fn component_start(components: usize) -> u32 {
    u32::try_from(components).expect("fewer than 2^32 components in a scale")
}

/// A neighbor of a sample, its weight, and where the sample is in it (spec 4.2 to 4.4).
#[derive(Clone, Copy, Debug, Default)]
pub struct Contribution<T> {
    /// The tensor's index over all scales.
    pub tensor: u32,
    /// The lower of two vertices on each axis.
    pub lower: [u32; 3],
    /// The fraction of the way to the next vertex, per axis, in [0, 1].
    pub fractions: [T; 3],
    /// The weight w of the tensor in its scale.
    pub weight: T,
}

/// Which components of a tensor a field holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Holding {
    /// Components that are not zero.
    Nonzero,
    /// All components up to the last that is not zero, so that they are the first of the scale.
    UpToLast,
}

impl<T: Real> FieldFactors<T> {
    /// The components of `block`, of tensors of `resolution` cells, that `holding` selects.
    pub(super) fn new(holding: Holding, block: &Block, resolution: [u32; 3]) -> Self {
        Self::without(holding, block, resolution, |_, _| false)
    }

    /// Holds components like `FieldFactors::new`; those for which `is_zero`(tensor, component) count as zero.
    pub fn without(
        holding: Holding,
        block: &Block,
        resolution: [u32; 3],
        is_zero: impl Fn(usize, usize) -> bool,
    ) -> Self {
        let (form, rank, rows) = (block.form, block.rank as usize, block.form.rows(resolution));
        let tensors = || block.values.chunks_exact((rows * rank).max(1));
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
            held.starts.push(component_start(held.components.len()));
        }
        // On cache lines, which is worth up to 10 % (docs/experiments/2026-11-21-step-optimizations.md).
        let mut values = AVec::with_capacity(CACHELINE_ALIGN, held.value_count() + MAX_LANES);
        for (n, tensor) in tensors().enumerate() {
            for row in tensor.chunks_exact(rank) {
                let value = |c: usize| if is_zero(n, c) { T::zero() } else { T::of_f32(row[c]) };
                held.of(n).iter().for_each(|&component| values.push(value(component as usize)));
            }
        }
        values.resize(values.len() + MAX_LANES, T::zero());
        Self { form, vertices: resolution.map(|cells| cells + 1), held, values }
    }

    /// The form of the components.
    #[inline(always)]
    pub fn form(&self) -> Form {
        self.form
    }

    /// Cells along each axis.
    pub fn resolution(&self) -> [u32; 3] {
        self.vertices.map(|vertices| vertices - 1)
    }

    /// The number of rows of the first factor.
    pub fn first_factor_rows(&self) -> usize {
        match self.form {
            Form::Cp => self.vertices[0] as usize,
            Form::Vm(axis) => self.vertices[axis] as usize,
        }
    }

    /// The components that tensors hold.
    #[inline(always)]
    pub fn held(&self) -> &HeldComponents {
        &self.held
    }

    /// \[tensor\]\[row\]\[held component\] the factors.
    pub fn values(&self) -> &[T] {
        &self.values[..self.held.value_count()]
    }

    /// \[tensor\]\[row\]\[held component\] the factors, to change.
    pub fn values_mut(&mut self) -> &mut [T] {
        let count = self.held.value_count();
        &mut self.values[..count]
    }

    /// The factors to change, and the components that tensors hold.
    pub fn split(&mut self) -> (&HeldComponents, &mut [T]) {
        let count = self.held.value_count();
        (&self.held, &mut self.values[..count])
    }

    /// The vectors of `tensor`, a scale's, at `contribution`. The form is [`Form::Cp`].
    ///
    /// # Panics
    ///
    /// If the tensor has no such rows.
    #[inline(always)]
    pub(super) fn vectors_of<S: Simd>(
        &self,
        simd: S,
        tensor: usize,
        contribution: &Contribution<T>,
    ) -> Rows<'_, T, S, Vectors<T, S>> {
        let Contribution { lower: [x, y, z], fractions, .. } = *contribution;
        let [along_x, along_y, _] = self.vertices;
        let [y, z] = [along_x + y, along_x + along_y + z];
        self.rows_of(
            simd,
            tensor,
            contribution,
            x.max(y).max(z),
            #[inline(always)]
            |rows| Vectors {
                lower: [rows.at(x), rows.at(y), rows.at(z)],
                fractions: [T::splat(simd, fractions[0]), T::splat(simd, fractions[1]), T::splat(simd, fractions[2])],
            },
        )
    }

    /// The vector along `axis` and the matrix of `tensor`, a scale's, at `contribution`. The form is [`Form::Vm`] of `axis`.
    ///
    /// # Panics
    ///
    /// If the tensor has no such rows.
    #[inline(always)]
    pub(super) fn vector_and_matrix_of<S: Simd>(
        &self,
        simd: S,
        axis: usize,
        tensor: usize,
        contribution: &Contribution<T>,
    ) -> Rows<'_, T, S, VectorAndMatrix<T, S>> {
        let Contribution { lower, fractions, .. } = *contribution;
        let [first, second] = Form::matrix_axes(axis);
        let row_len = self.vertices[first];
        let corner = self.vertices[axis] + lower[second] * row_len + lower[first];
        // Both corners are checked, as the sum may wrap.
        let opposite = corner.wrapping_add(row_len);
        self.rows_of(
            simd,
            tensor,
            contribution,
            corner.max(opposite).max(lower[axis]),
            #[inline(always)]
            |rows| VectorAndMatrix {
                lower: [rows.at(lower[axis]), rows.at(corner), rows.at(opposite)],
                fractions: [
                    T::splat(simd, fractions[axis]),
                    T::splat(simd, fractions[first]),
                    T::splat(simd, fractions[second]),
                ],
            },
        )
    }

    /// The rows of `tensor` up to the one after `lower` that `factors` takes, by the place of the first number of a row.
    #[inline(always)]
    fn rows_of<S: Simd, F>(
        &self,
        simd: S,
        tensor: usize,
        contribution: &Contribution<T>,
        lower: u32,
        factors: impl FnOnce(RowPlaces<T>) -> F,
    ) -> Rows<'_, T, S, F> {
        let Self { held, values, .. } = self;
        let std::ops::Range { start, end } = held.range(tensor);
        // One check for all loads of a contribution: with a check for each, density takes 0.44 s of a picture instead
        // of 0.27 s (docs/experiments/2026-11-25-held-components.md).
        assert!((lower as usize) < held.rows.saturating_sub(1), "a row of a tensor");
        let rank = end - start;
        // `values` has `rows` rows for each of the components before `end`, and a register more.
        // Wrapping arithmetic makes an address without a promise about it; the reads in `between` make the promise.
        let first = values.as_ptr().wrapping_add(start * held.rows);
        Rows {
            factors: factors(RowPlaces { first, rank }),
            rank,
            weight: T::splat(simd, contribution.weight),
            values: std::marker::PhantomData,
        }
    }

    /// Holds the components `held`, of the same tensors; its component c was `order`\[c\].
    ///
    /// # Panics
    ///
    /// If `held` has another number of tensors or of rows.
    pub fn rearrange(&mut self, held: HeldComponents, order: &[u16]) {
        // The loads of registers trust the number of factors.
        let [before, after] = [&self.held, &held].map(|held| (held.tensors(), held.rows));
        assert_eq!(before, after, "tensors and rows of the factors");
        let mut values = AVec::with_capacity(CACHELINE_ALIGN, held.value_count() + MAX_LANES);
        values.extend_from_slice(&self.held.rearranged(self.values(), &held, order));
        values.resize(values.len() + MAX_LANES, T::zero());
        (self.held, self.values) = (held, values);
    }

    /// Gives tensors `resolution` cells: `resampled` returns a tensor's new factors from their form, the old ones and their
    /// number of components.
    pub(super) fn resample(&mut self, resolution: [u32; 3], resampled: impl Fn(Form, &[T], usize) -> Vec<T>) {
        let rows = self.form.rows(resolution);
        let mut values = AVec::with_capacity(CACHELINE_ALIGN, self.held.components() * rows + MAX_LANES);
        for (tensor, new) in
            self.held.resampled(&self.values, |values, rank| resampled(self.form, values, rank)).enumerate()
        {
            assert_eq!(new.len(), self.held.count(tensor) * rows, "factors of tensor {tensor}");
            values.extend_from_slice(&new);
        }
        values.resize(values.len() + MAX_LANES, T::zero());
        self.values = values;
        self.held.rows = rows;
        self.vertices = resolution.map(|cells| cells + 1);
    }
}

/// Where the rows of a tensor are.
struct RowPlaces<T> {
    first: *const T,
    rank: usize,
}

impl<T> RowPlaces<T> {
    #[inline(always)]
    fn at(&self, row: u32) -> *const T {
        self.first.wrapping_add(row as usize * self.rank)
    }
}

/// The rows of a tensor that a sample is between, for registers of `S`.
pub(super) struct Rows<'a, T: Real, S: Simd, F> {
    factors: F,
    /// The number of components that the tensor holds.
    rank: usize,
    weight: T::Register<S>,
    values: std::marker::PhantomData<&'a [T]>,
}

/// What a component is the product of, at a sample.
pub(super) trait Factorized<T: Real, S: Simd> {
    /// `weight` times the product for a register of components from `first` on, of a tensor that holds `rank`.
    ///
    /// # Safety
    ///
    /// `first` is less than `rank`, and the rows belong to a tensor whose factors at least a register follows.
    unsafe fn times(&self, simd: S, rank: usize, first: usize, weight: T::Register<S>) -> T::Register<S>;
}

/// Three vectors.
pub(super) struct Vectors<T: Real, S: Simd> {
    /// \[axis\] the lower of two rows.
    lower: [*const T; 3],
    fractions: [T::Register<S>; 3],
}

/// A vector and a matrix.
pub(super) struct VectorAndMatrix<T: Real, S: Simd> {
    /// The lower of two rows of the vector, and of those of the matrix at the lower and the upper vertex of its second axis.
    lower: [*const T; 3],
    /// Fractions between two vertices along the axis of the vector and the two axes of the matrix.
    fractions: [T::Register<S>; 3],
}

/// A register of the numbers from `first` on between the row `lower` and the next, which begins `rank` numbers later.
///
/// # Safety
///
/// Both registers are within one allocation.
#[inline(always)]
unsafe fn between<T: Real, S: Simd>(
    simd: S,
    lower: *const T,
    rank: usize,
    first: usize,
    fraction: T::Register<S>,
) -> T::Register<S> {
    let lower = lower.wrapping_add(first);
    // SAFETY: The caller guarantees it.
    let (lower, upper) = unsafe {
        let upper = lower.wrapping_add(rank);
        // Unaligned, as rows have as many components as their tensor holds. Padded rows would take memory for zeros.
        (lower.cast::<T::Register<S>>().read_unaligned(), upper.cast::<T::Register<S>>().read_unaligned())
    };
    T::times_plus(simd, fraction, T::minus(simd, upper, lower), lower)
}

impl<T: Real, S: Simd> Factorized<T, S> for Vectors<T, S> {
    #[inline(always)]
    unsafe fn times(&self, simd: S, rank: usize, first: usize, weight: T::Register<S>) -> T::Register<S> {
        let mut product = weight;
        for a in 0..3 {
            // SAFETY: The caller guarantees it.
            let value = unsafe { between(simd, self.lower[a], rank, first, self.fractions[a]) };
            product = T::times(simd, product, value);
        }
        product
    }
}

impl<T: Real, S: Simd> Factorized<T, S> for VectorAndMatrix<T, S> {
    #[inline(always)]
    unsafe fn times(&self, simd: S, rank: usize, first: usize, weight: T::Register<S>) -> T::Register<S> {
        let [of_vector, of_first, of_second] = self.fractions;
        // SAFETY: The caller guarantees it.
        let (vector, lower, upper) = unsafe {
            (
                between(simd, self.lower[0], rank, first, of_vector),
                between(simd, self.lower[1], rank, first, of_first),
                between(simd, self.lower[2], rank, first, of_first),
            )
        };
        // Bilinear: first along the matrix's first axis in two rows, then between them.
        let matrix = T::times_plus(simd, of_second, T::minus(simd, upper, lower), lower);
        T::times(simd, T::times(simd, weight, vector), matrix)
    }
}

impl<T: Real, S: Simd, F: Factorized<T, S>> Rows<'_, T, S, F> {
    /// The number of components that the tensor holds.
    #[inline(always)]
    pub(super) fn rank(&self) -> usize {
        self.rank
    }

    /// `sums` plus weight·component of all components, in registers.
    #[inline(always)]
    pub(super) fn add_all(&self, simd: S, mut sums: T::Register<S>) -> T::Register<S> {
        for first in (0..self.rank).step_by(T::lanes::<S>()) {
            sums = self.add(simd, first, sums);
        }
        sums
    }

    /// `sums` plus weight·component of a register of components from `first` on; no more, behind the last component.
    #[inline(always)]
    pub(super) fn add(&self, simd: S, first: usize, sums: T::Register<S>) -> T::Register<S> {
        if first >= self.rank {
            return sums;
        }
        // SAFETY: Component `first` is held, and the rows are within the tensor's factors, which at least a register of other
        // numbers follows.
        let mut products = unsafe { self.factors.times(simd, self.rank, first, self.weight) };
        let count = self.rank - first;
        // Only the last register of a row needs the mask. A mask for every register, which spares the branch, is not
        // faster (docs/experiments/2026-11-26-frame-in-tiles.md).
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

    /// Two tensors of one cell and three components: of the first the middle component is zero, of the second the last.
    fn dense() -> Block {
        let row = |values: [f32; 3], other: [f32; 3]| [values, other, other, other, other, other].concat();
        Block::cp(3, [row([1., 0., 2.], [3., 0., 0.]), row([6., 7., 0.], [0., 8., 0.])].concat())
    }

    #[test]
    fn tensors_hold_the_components_that_are_not_zero_and_give_them_back() {
        let factors = FieldFactors::<f64>::new(Holding::Nonzero, &dense(), [1; 3]);
        let held = factors.held();
        assert_eq!([held.of(0), held.of(1)], [&[0, 2], &[0, 1]]);
        assert_eq!(factors.values()[..4], [1., 2., 3., 0.]);
        assert_eq!(factors.values()[12..16], [6., 7., 0., 8.]);
        assert!(held.dense(factors.values()).into_iter().eq(dense().values.into_iter().map(f64::from)));
    }

    #[test]
    fn up_to_the_last_component_zeros_between_are_held() {
        let factors = FieldFactors::<f32>::new(Holding::UpToLast, &dense(), [1; 3]);
        assert_eq!([factors.held().of(0), factors.held().of(1)], [&[0, 1, 2][..], &[0, 1]]);
        assert_eq!(factors.held().dense(factors.values()), dense().values);
    }

    #[test]
    fn components_that_count_as_zero_are_left_out() {
        let without = |is_zero: fn(usize, usize) -> bool| {
            FieldFactors::<f32>::without(Holding::UpToLast, &dense(), [1; 3], is_zero)
        };
        let factors = without(|n, c| n == 1 || c == 2);
        assert_eq!([factors.held().of(0), factors.held().of(1)], [&[0][..], &[]]);
        assert_eq!(factors.values(), [1., 3., 3., 3., 3., 3.]);
        assert_eq!(without(|n, c| n == 0 && c == 0).values()[..6], [0., 0., 2., 0., 0., 0.]);
    }

    #[test]
    #[should_panic = "a row of a tensor"]
    fn rows_that_a_tensor_lacks_are_refused() {
        let factors = FieldFactors::<f32>::new(Holding::Nonzero, &dense(), [1; 3]);
        let contribution = Contribution { lower: [0, 0, 1], ..Contribution::default() };
        factors.vectors_of(pulp::Scalar, 0, &contribution);
    }

    #[test]
    #[should_panic = "a row of a tensor"]
    fn rows_whose_number_wraps_are_refused() {
        let factors = FieldFactors::<f32>::new(Holding::Nonzero, &dense(), [1; 3]);
        let contribution = Contribution { lower: [u32::MAX, 0, 0], ..Contribution::default() };
        factors.vectors_of(pulp::Scalar, 0, &contribution);
    }

    #[test]
    #[should_panic = "a row of a tensor"]
    fn rows_of_a_matrix_whose_number_wraps_are_refused() {
        let block = Block { form: Form::Vm(0), rank: 1, values: vec![1.0; 2 + 6] };
        let factors = FieldFactors::<f32>::new(Holding::Nonzero, &block, [1, 1, 2]);
        let contribution = Contribution { lower: [0, u32::MAX - 2, 0], ..Contribution::default() };
        factors.vector_and_matrix_of(pulp::Scalar, 0, 0, &contribution);
    }

    #[test]
    #[should_panic = "tensors and rows of the factors"]
    fn components_of_more_tensors_are_refused() {
        let mut factors = FieldFactors::<f32>::new(Holding::Nonzero, &dense(), [1; 3]);
        let more = factors.held().of_components(&[vec![0], vec![0], vec![0]]);
        factors.rearrange(more, &[0, 1, 2]);
    }

    #[test]
    #[should_panic = "a row of a tensor"]
    fn rows_that_a_matrix_lacks_are_refused() {
        let block = Block { form: Form::Vm(0), rank: 1, values: vec![1.0; 2 + 6] };
        let factors = FieldFactors::<f32>::new(Holding::Nonzero, &block, [1, 1, 2]);
        let contribution = Contribution { lower: [0, 0, 2], ..Contribution::default() };
        factors.vector_and_matrix_of(pulp::Scalar, 0, 0, &contribution);
    }
}
