//! Dense products by the kernels of `gemm`. A product of our own reached 0.95 of their speed
//! (docs/experiments/2026-11-21-step-optimizations.md). The crate `gemm` itself would compile kernels for complex numbers, too.
//!
//! Besides `factors.rs` the only file of the crate with `unsafe` code: kernels take pointers and strides. The views below
//! check every bound before the call.
#![expect(unsafe_code, reason = "kernels take pointers and strides")]

use gemm_common::Parallelism;

use super::Real;

/// A matrix view: element (i, j) is `values[i·row_stride + j·column_stride]`.
#[derive(Clone, Copy, Debug)]
pub struct Matrix<'a, T> {
    values: &'a [T],
    rows: usize,
    columns: usize,
    row_stride: usize,
    column_stride: usize,
}

/// A writable matrix view, row-major.
#[derive(Debug)]
pub struct MatrixMut<'a, T> {
    values: &'a mut [T],
    rows: usize,
    columns: usize,
    row_stride: usize,
}

/// Panics unless the last element of a view of this shape lies within `len` values.
fn check_bounds(rows: usize, columns: usize, row_stride: usize, column_stride: usize, len: usize) {
    // Checked: a product that wraps would let a view of any number of rows pass, and the kernel trusts the view.
    let last = |count: usize, stride| (count - 1).checked_mul(stride);
    let end = || last(rows, row_stride)?.checked_add(last(columns, column_stride)?)?.checked_add(1);
    let fits = rows == 0 || columns == 0 || end().is_some_and(|end| end <= len);
    assert!(fits, "{rows}×{columns} matrix of strides {row_stride}, {column_stride} in {len} values");
}

impl<'a, T> Matrix<'a, T> {
    /// A view of the first `columns` of each row of `row_stride` values.
    ///
    /// # Panics
    ///
    /// If an element of the view lies outside `values`, or rows of a writable view overlap.
    pub fn new(values: &'a [T], rows: usize, columns: usize, row_stride: usize) -> Self {
        check_bounds(rows, columns, row_stride, 1, values.len());
        Self { values, rows, columns, row_stride, column_stride: 1 }
    }

    /// The transposed view of the same values.
    pub fn transposed(self) -> Self {
        Self {
            rows: self.columns,
            columns: self.rows,
            row_stride: self.column_stride,
            column_stride: self.row_stride,
            ..self
        }
    }
}

impl<'a, T> MatrixMut<'a, T> {
    /// A view of the first `columns` of each row of `row_stride` values.
    ///
    /// # Panics
    ///
    /// If an element of the view lies outside `values`, or rows of a writable view overlap.
    pub fn new(values: &'a mut [T], rows: usize, columns: usize, row_stride: usize) -> Self {
        check_bounds(rows, columns, row_stride, 1, values.len());
        assert!(columns <= row_stride || rows <= 1, "rows of {columns} overlap at stride {row_stride}");
        Self { values, rows, columns, row_stride }
    }
}

/// A kernel for column-major products. In this order: rows, columns and terms; the product with its strides between columns
/// and between rows, and whether it is added to; the left and the right factor with such strides; the weights of the product
/// before and of the factors; whether the product and the factors are conjugated; the threads.
pub(crate) type ProductKernel<T> = unsafe fn(
    usize,
    usize,
    usize,
    *mut T,
    isize,
    isize,
    bool,
    *const T,
    isize,
    isize,
    *const T,
    isize,
    isize,
    T,
    T,
    bool,
    bool,
    bool,
    Parallelism,
);

/// The most columns that a kernel computes at once. A partial group of columns costs as much as a full one.
const COLUMNS_AT_ONCE: usize = 16;

/// The number of terms per element from which on the transposed product plus a copy is faster.
const MANY_TERMS: usize = 256;

/// `product` = `left`·`right`, or `product` += `left`·`right` if `accumulate`. Runs on this thread; the order of the
/// sums depends on the shapes alone.
///
/// # Panics
///
/// If the shapes do not agree.
pub fn multiply<T: Real>(product: MatrixMut<T>, left: Matrix<T>, right: Matrix<T>, accumulate: bool) {
    let fits = left.rows == product.rows && right.columns == product.columns && left.columns == right.rows;
    assert!(fits, "the factors' shapes do not agree with the product's");
    if product.rows == 0 || product.columns == 0 {
        return;
    }
    let is_faster_transposed = !product.columns.is_multiple_of(COLUMNS_AT_ONCE)
        && product.rows.is_multiple_of(COLUMNS_AT_ONCE)
        && left.columns >= MANY_TERMS.max(product.rows).max(product.columns);
    if is_faster_transposed {
        multiply_transposed(product, left, right, accumulate);
    } else {
        multiply_in_place(product, left, right, accumulate);
    }
}

/// [`multiply`] through the transposed product, `right`ᵀ·`left`ᵀ.
fn multiply_transposed<T: Real>(product: MatrixMut<T>, left: Matrix<T>, right: Matrix<T>, accumulate: bool) {
    let (rows, columns) = (product.rows, product.columns);
    // The padding avoids a stride that is a power of two, at which a column falls on few sets of the cache.
    let stride = rows + COLUMNS_AT_ONCE;
    let mut transposed_product = vec![T::zero(); columns * stride];
    multiply_in_place(
        MatrixMut::new(&mut transposed_product, columns, rows, stride),
        right.transposed(),
        left.transposed(),
        false,
    );
    for (i, row) in product.values.chunks_mut(product.row_stride).take(rows).enumerate() {
        for (to, from) in row[..columns].iter_mut().zip(transposed_product.chunks_exact(stride)) {
            *to = if accumulate { *to + from[i] } else { from[i] };
        }
    }
}

/// [`multiply`] for a product that is not empty and factors whose shapes agree with it.
fn multiply_in_place<T: Real>(product: MatrixMut<T>, left: Matrix<T>, right: Matrix<T>, accumulate: bool) {
    let fits = left.rows == product.rows && right.columns == product.columns && left.columns == right.rows;
    assert!(fits, "the factors' shapes do not agree with the product's");
    let (rows, columns) = (product.rows, product.columns);
    // The kernel wants its product column by column: a product by rows is that of the transposed factors.
    let (rows, columns, strides, left, right) = match product.row_stride {
        1 => (rows, columns, [1, 1], left, right),
        row_stride => (columns, rows, [row_stride, 1], right.transposed(), left.transposed()),
    };
    // SAFETY: the views' constructors checked that every element that shape and strides reach lies in their slices;
    // the shapes agree (asserted above); `product` is borrowed mutably, so it overlaps neither factor.
    unsafe {
        T::product_kernel()(
            rows,
            columns,
            left.columns,
            product.values.as_mut_ptr(),
            strides[0] as isize,
            strides[1] as isize,
            accumulate,
            left.values.as_ptr(),
            left.column_stride as isize,
            left.row_stride as isize,
            right.values.as_ptr(),
            right.column_stride as isize,
            right.row_stride as isize,
            T::one(),
            T::one(),
            false,
            false,
            false,
            // Threads work on chunks of rays. One product per thread keeps results independent of their number.
            Parallelism::None,
        );
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn product_with_strides_and_a_transposed_factor() {
        let left = [1.0, 2.0, 9.0, 3.0, 4.0, 9.0]; // 2×2 of stride 3
        let right = [5.0, 6.0, 7.0, 8.0]; // transposed: [[5, 7], [6, 8]]
        let mut product = [1.0f64; 5];
        multiply(
            MatrixMut::new(&mut product, 2, 2, 3),
            Matrix::new(&left, 2, 2, 3),
            Matrix::new(&right, 2, 2, 2).transposed(),
            true,
        );
        assert_eq!(product, [18.0, 24.0, 1.0, 40.0, 54.0]);
    }

    /// Compares products of `rows`×`terms` by `terms`×`columns`, each factor as stored or transposed, with sums in f64,
    /// to within the rounding error.
    fn compare<T: Real>(rows: usize, terms: usize, columns: usize) {
        let value = |i: usize| T::of(((i * 7919 + 13) % 1009) as f64 / 1009.0 - 0.5);
        let (left_values, right_values): (Vec<T>, Vec<T>) =
            ((0..rows * terms).map(value).collect(), (0..terms * columns).map(|i| value(i + 500)).collect());
        let stride = columns + 2;
        for (transposed, accumulate) in [(0, false), (1, false), (2, true), (3, true)] {
            let left = match transposed & 1 {
                0 => Matrix::new(&left_values, rows, terms, terms),
                _ => Matrix::new(&left_values, terms, rows, rows).transposed(),
            };
            let right = match transposed & 2 {
                0 => Matrix::new(&right_values, terms, columns, columns),
                _ => Matrix::new(&right_values, columns, terms, terms).transposed(),
            };
            let mut product = vec![T::one(); rows * stride];
            multiply(MatrixMut::new(&mut product, rows, columns, stride), left, right, accumulate);
            for i in 0..rows {
                for j in 0..stride {
                    let a = |k: usize| left.values[i * left.row_stride + k * left.column_stride].f64();
                    let b = |k: usize| right.values[k * right.row_stride + j * right.column_stride].f64();
                    let mut expected = if j < columns && !accumulate { 0.0 } else { 1.0 };
                    let mut size = 1.0;
                    for k in 0..if j < columns { terms } else { 0 } {
                        expected += a(k) * b(k);
                        size += (a(k) * b(k)).abs();
                    }
                    let tolerance = (terms + 1) as f64 * T::epsilon().f64() * size;
                    let found = product[i * stride + j].f64();
                    assert!((found - expected).abs() <= tolerance, "({i}, {j}): {found} instead of {expected}");
                }
            }
        }
    }

    #[test]
    fn products_of_all_shapes_agree_with_plain_sums() {
        // The last two are computed through their transposes.
        for (rows, terms, columns) in [
            (1, 150, 128),
            (7, 144, 27),
            (61, 128, 3),
            (61, 3, 128),
            (33, 0, 5),
            (3, 300, 128),
            (32, 300, 22),
            (16, 256, 1),
        ] {
            compare::<f32>(rows, terms, columns);
            compare::<f64>(rows, terms, columns);
        }
    }

    #[test]
    #[should_panic(expected = "matrix of strides")]
    fn view_past_the_end_is_refused() {
        Matrix::new(&[0.0; 5], 2, 3, 3);
    }

    #[test]
    #[should_panic(expected = "matrix of strides")]
    fn view_whose_last_element_is_past_any_address_is_refused() {
        // (rows − 1)·stride is a multiple of 2⁶⁴, or of 2³² with 32 bits.
        let half = 1 << (usize::BITS / 2);
        Matrix::new(&[0.0], half + 1, 1, half);
    }

    #[test]
    #[should_panic(expected = "matrix of strides")]
    fn writable_view_whose_last_element_is_past_any_address_is_refused() {
        let half = 1 << (usize::BITS / 2);
        MatrixMut::new(&mut [0.0], half + 1, 1, half);
    }
}
