//! Gradients of the tensors' factors. One task owns a block of a tensor: it walks the tensor's pairs in the order of chunk
//! and sample, so its factors and their gradient stay in cache and have one writer: no atomics, no copies of all
//! gradients, and sums in the same order on any number of threads.

use aligned_vec::{AVec, CACHELINE_ALIGN};
use pulp::{Arch, Simd, WithSimd};

use super::chunk::{Chunk, ShadedGradient};
use strivec_field::{Field, FieldFactors, FieldScale, Interpolation, Real, Stage, StageClock, TensorVertices, offset};
use strivec_format::model::Form;

/// Position of a block's components in the row of a shaded sample.
#[derive(Clone, Copy, Debug)]
pub(super) struct ComponentRange {
    /// The block's first component.
    pub(super) first: usize,
    /// ΣR, the row's length.
    pub(super) width: usize,
}

/// The gradients of a block of a tensor, laid out as its factors. Reused.
#[derive(Debug)]
pub(super) struct TensorGradient<T> {
    pub(super) values: AVec<T>,
    /// False if no sample is in the tensor; of appearance, no shaded one.
    pub(super) has_samples: bool,
    /// Time since a step began.
    pub(super) clock: StageClock,
    /// Factors, each row a multiple of a register.
    padded: AVec<T>,
    /// The block's part of [`BlockGeometry::own_rows`], padded alike.
    own_rows: AVec<T>,
}

impl<T> Default for TensorGradient<T> {
    fn default() -> Self {
        let none = || AVec::new(CACHELINE_ALIGN);
        Self { values: none(), has_samples: false, clock: StageClock::default(), padded: none(), own_rows: none() }
    }
}

impl<T: Real> TensorGradient<T> {
    /// Computes the gradients of `block` of tensor `n`, with these `factors`.
    pub(super) fn accumulate(&mut self, block: BlockGeometry<'_, T>, n: usize, factors: &[T], chunks: &[Chunk<T>]) {
        Arch::new().dispatch(Accumulate { sums: self, block, n, factors, chunks });
    }
}

/// [`TensorGradient::accumulate`].
struct Accumulate<'a, T> {
    sums: &'a mut TensorGradient<T>,
    block: BlockGeometry<'a, T>,
    n: usize,
    factors: &'a [T],
    chunks: &'a [Chunk<T>],
}

impl<T: Real> WithSimd for Accumulate<'_, T> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { sums, block, n, factors, chunks } = self;
        let TensorGradient { values, has_samples, padded, own_rows, .. } = sums;
        let center = block.centers[n];
        let tensor = block.first_tensor + n;
        let rank = factors.len() / block.rows;
        // Whole registers in each row: a call that copied what is left of one kept the compiler from holding
        // registers (docs/experiments/2026-11-26-rays-by-error.md).
        let stride = rank.next_multiple_of(T::lanes::<S>());
        let factors = pad_rows(factors, rank, stride, padded);
        reset(values, block.rows * stride);
        *has_samples = false;
        let Some(ComponentRange { first: begin, width }) = block.appearance else {
            for chunk in chunks {
                for pair in chunk.density_pairs.of(tensor) {
                    *has_samples = true;
                    let at = block.vertices.at(offset(chunk.positions[pair.place as usize], center));
                    // A density feature is a plain sum, so all components have the same gradient.
                    let gradient = T::splat(simd, pair.weight);
                    block.add(
                        simd,
                        factors,
                        values,
                        stride,
                        &at,
                        #[inline(always)]
                        |_| gradient,
                    );
                }
            }
            unpad_rows(values, rank, stride);
            sums.clock.lap(Stage::DensityBackward);
            return;
        };
        let has_own = block.own_rows.is_some();
        if let Some(rows) = block.own_rows {
            reset(own_rows, 3 * stride);
            for (padded, row) in own_rows.chunks_exact_mut(stride.max(1)).zip(rows.chunks_exact(width)) {
                padded[..rank].copy_from_slice(&row[begin..begin + rank]);
            }
        }
        for chunk in chunks {
            for pair in chunk.appearance_pairs.of(tensor) {
                *has_samples = true;
                let ShadedGradient { row, share, own } = chunk.shaded_gradients[pair.shaded as usize];
                // The gradient of a sample's components follows from the row of its ray. Storing it for all samples
                // took two thirds of the memory of a step.
                let share = T::splat(simd, pair.weight * share);
                let gradients = &chunk.component_gradients[row as usize * width + begin..];
                let [x, y, z] = own;
                // Three splats, not a `map`: such a call keeps the compiler from holding registers across it
                // (docs/experiments/2026-11-26-rays-by-error.md).
                let own =
                    [T::splat(simd, pair.weight * x), T::splat(simd, pair.weight * y), T::splat(simd, pair.weight * z)];
                let at = block.vertices.at(offset(chunk.positions[pair.place as usize], center));
                block.add(
                    simd,
                    factors,
                    values,
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
        unpad_rows(values, rank, stride);
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

/// The inputs of a block's gradients other than its factors, which the optimizer borrows meanwhile.
#[derive(Clone, Copy, Debug)]
pub(super) struct BlockGeometry<'a, T> {
    form: Form,
    /// Rows of a tensor.
    rows: usize,
    resolution: [u32; 3],
    first_tensor: usize,
    centers: &'a [[T; 3]],
    vertices: TensorVertices<T>,
    /// The block's components; `None` if they are of density.
    pub(super) appearance: Option<ComponentRange>,
    /// The first three rows of the appearance matrices, if samples have residual colors.
    own_rows: Option<&'a [T]>,
}

impl<'a, T: Real> BlockGeometry<'a, T> {
    /// \[scale\]\[block\] of `field`, without centers.
    pub(super) fn of(field: &Field<T>, own_rows: Option<&'a [T]>) -> Vec<Vec<Self>> {
        let width = field.component_count();
        let mut first = 0;
        let mut of_scale = |scale: &FieldScale<T>| {
            let geometry = |block: &FieldFactors<T>, appearance| Self {
                form: block.form(),
                rows: block.form().rows(scale.resolution),
                resolution: scale.resolution,
                first_tensor: scale.first_tensor as usize,
                centers: &[],
                vertices: *scale.vertices(),
                appearance,
                own_rows,
            };
            let density: Vec<_> = scale.density.iter().map(|block| geometry(block, None)).collect();
            let appearance = scale.appearance.iter().map(|block| {
                let range = ComponentRange { first, width };
                first += block.held().rank();
                geometry(block, Some(range))
            });
            density.into_iter().chain(appearance).collect()
        };
        field.scales.iter().map(&mut of_scale).collect()
    }

    /// The geometry of this block's tensors with these centers.
    pub(super) fn at<'b>(self, centers: &'b [[T; 3]]) -> BlockGeometry<'b, T>
    where
        'a: 'b,
    {
        BlockGeometry { centers, ..self }
    }

    /// Adds one pair's gradients. Rows have `stride` components, a multiple of a register's. `component(r)` is
    /// ∂L/∂component for the register that begins with component r.
    #[inline(always)]
    fn add<S: Simd>(
        &self,
        simd: S,
        factors: &[T],
        gradients: &mut [T],
        stride: usize,
        at: &Interpolation<T>,
        component: impl Fn(usize) -> T::Register<S>,
    ) {
        let vertices = self.resolution.map(|cells| cells as usize + 1);
        let ([x, y, z], [fx, fy, fz]) = (at.lower, at.fractions);
        match self.form {
            Form::Cp => {
                let rows = [x, vertices[0] + y, vertices[0] + vertices[1] + z];
                add_to_vectors(simd, factors, gradients, stride, rows, [fx, fy, fz], component);
            }
            Form::Vm(axis) => {
                let [first, second] = Form::matrix_axes(axis);
                let corner = vertices[axis] + at.lower[second] * vertices[first] + at.lower[first];
                let rows = [at.lower[axis], corner, corner + vertices[first]];
                let fractions = [at.fractions[axis], at.fractions[first], at.fractions[second]];
                add_to_vector_and_matrix(simd, factors, gradients, stride, rows, fractions, component);
            }
        }
    }
}

/// The number at `fraction` between two of `rows`, the first of which is there.
#[inline(always)]
fn between<T: Real, S: Simd>(simd: S, rows: &[T], stride: usize, fraction: T::Register<S>) -> T::Register<S> {
    let (lower, upper) = (T::load(simd, rows), T::load(simd, &rows[stride..]));
    T::times_plus(simd, fraction, T::minus(simd, upper, lower), lower)
}

/// Shares `gradient` between two of `rows`, the first of which is there, by `fraction`.
#[inline(always)]
fn share<T: Real, S: Simd>(simd: S, rows: &mut [T], stride: usize, fraction: T::Register<S>, gradient: T::Register<S>) {
    // The lower part is the rest, so that both always add up to the gradient.
    let to_upper = T::times(simd, fraction, gradient);
    let to_lower = T::minus(simd, gradient, to_upper);
    T::store(simd, rows, T::plus(simd, T::load(simd, rows), to_lower));
    let rows = &mut rows[stride..];
    T::store(simd, rows, T::plus(simd, T::load(simd, rows), to_upper));
}

/// [`BlockGeometry::add`] for three vectors, whose lower rows are `rows`: the gradient of each of x·y·z has the product of the
/// other two.
#[inline(always)]
fn add_to_vectors<T: Real, S: Simd>(
    simd: S,
    factors: &[T],
    gradients: &mut [T],
    stride: usize,
    rows: [usize; 3],
    [fx, fy, fz]: [T; 3],
    component: impl Fn(usize) -> T::Register<S>,
) {
    // No `map` over arrays of registers: it is compiled for the least instruction set.
    let fractions = [T::splat(simd, fx), T::splat(simd, fy), T::splat(simd, fz)];
    let firsts = [rows[0] * stride, rows[1] * stride, rows[2] * stride];
    for first in (0..stride).step_by(T::lanes::<S>()) {
        let mut values = fractions;
        for a in 0..3 {
            values[a] = between(simd, &factors[firsts[a] + first..], stride, fractions[a]);
        }
        let gradient = component(first);
        let [x, y, z] = values;
        // Five products for three gradients, instead of six.
        let with_x = T::times(simd, gradient, x);
        let of_axes =
            [T::times(simd, T::times(simd, gradient, y), z), T::times(simd, with_x, z), T::times(simd, with_x, y)];
        for a in 0..3 {
            share(simd, &mut gradients[firsts[a] + first..], stride, fractions[a], of_axes[a]);
        }
    }
}

/// [`BlockGeometry::add`] for a vector and a matrix. `rows` are the lower row of the vector, and those of the matrix at the lower
/// and the upper vertex of its second axis; the fractions are those of the vector and of the axes of the matrix.
#[inline(always)]
fn add_to_vector_and_matrix<T: Real, S: Simd>(
    simd: S,
    factors: &[T],
    gradients: &mut [T],
    stride: usize,
    rows: [usize; 3],
    [of_vector, of_first, of_second]: [T; 3],
    component: impl Fn(usize) -> T::Register<S>,
) {
    let [of_vector, of_first, of_second] =
        [T::splat(simd, of_vector), T::splat(simd, of_first), T::splat(simd, of_second)];
    let firsts = [rows[0] * stride, rows[1] * stride, rows[2] * stride];
    for first in (0..stride).step_by(T::lanes::<S>()) {
        let vector = between(simd, &factors[firsts[0] + first..], stride, of_vector);
        let lower = between(simd, &factors[firsts[1] + first..], stride, of_first);
        let upper = between(simd, &factors[firsts[2] + first..], stride, of_first);
        let matrix = T::times_plus(simd, of_second, T::minus(simd, upper, lower), lower);
        let gradient = component(first);
        share(simd, &mut gradients[firsts[0] + first..], stride, of_vector, T::times(simd, gradient, matrix));
        let of_matrix = T::times(simd, gradient, vector);
        let to_upper = T::times(simd, of_second, of_matrix);
        share(simd, &mut gradients[firsts[1] + first..], stride, of_first, T::minus(simd, of_matrix, to_upper));
        share(simd, &mut gradients[firsts[2] + first..], stride, of_first, to_upper);
    }
}
