//! Dense products through the `gemm` crate.
//!
//! The one place of the crate with `unsafe` code: `gemm` takes pointers and strides; the views below check every
//! bound before it is called.
#![allow(unsafe_code)]

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

/// Panics unless the last element of such a view lies within `len`.
fn check_bounds(rows: usize, columns: usize, row_stride: usize, column_stride: usize, len: usize) {
    let end = if rows == 0 || columns == 0 { 0 } else { (rows - 1) * row_stride + (columns - 1) * column_stride + 1 };
    assert!(end <= len, "{rows}×{columns} matrix of strides {row_stride}, {column_stride} in {len} values");
}

impl<'a, T> Matrix<'a, T> {
    /// The first `columns` of each row of `row_stride` values.
    pub fn new(values: &'a [T], rows: usize, columns: usize, row_stride: usize) -> Self {
        check_bounds(rows, columns, row_stride, 1, values.len());
        Self { values, rows, columns, row_stride, column_stride: 1 }
    }

    /// The same values with rows and columns exchanged.
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
    /// The first `columns` of each row of `row_stride` values.
    pub fn new(values: &'a mut [T], rows: usize, columns: usize, row_stride: usize) -> Self {
        check_bounds(rows, columns, row_stride, 1, values.len());
        assert!(columns <= row_stride || rows <= 1, "rows of {columns} overlap at stride {row_stride}");
        Self { values, rows, columns, row_stride }
    }
}

/// `product` = `left`·`right`, or `product` += `left`·`right` where `accumulate` is set; on this thread, in an order
/// that depends on the shapes alone.
pub fn multiply<T: Real>(product: MatrixMut<T>, left: Matrix<T>, right: Matrix<T>, accumulate: bool) {
    assert!(left.rows == product.rows && right.columns == product.columns && left.columns == right.rows);
    if product.rows == 0 || product.columns == 0 {
        return;
    }
    // SAFETY: the views' constructors checked that every element that shape and strides reach lies in their slices;
    // the shapes agree (asserted above); `product` is borrowed mutably, so it overlaps neither factor.
    unsafe {
        gemm::gemm(
            product.rows,
            product.columns,
            left.columns,
            product.values.as_mut_ptr(),
            1,
            product.row_stride as isize,
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
            gemm::Parallelism::None,
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

    #[test]
    #[should_panic(expected = "matrix of strides")]
    fn view_past_the_end_is_refused() {
        Matrix::new(&[0.0; 5], 2, 3, 3);
    }
}
