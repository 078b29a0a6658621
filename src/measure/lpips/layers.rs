//! Convolutions and pooling of some rows of a map.

use std::ops::Range;

use rayon::prelude::*;

use super::architecture::{Convolution, Pool};
use super::weights::Kernel;
use crate::field::{Matrix, MatrixMut, multiply};

/// Numbers of the patches of a task: a task's matrix product is large enough to pack its factors once.
const PATCH_VALUES: usize = 1 << 20;
/// The most pixels of a task.
const MAX_PIXELS: usize = 1024;

/// Rows of a map of features.
#[derive(Debug)]
pub(super) struct Rows {
    /// The first row's number in the map.
    pub(super) first: usize,
    pub(super) columns: usize,
    pub(super) channels: usize,
    /// \[rows\]\[columns\]\[channels\].
    pub(super) values: Vec<f32>,
}

impl Rows {
    /// Features of a row by its number in the map.
    pub(super) fn row(&self, row: usize) -> &[f32] {
        let length = self.columns * self.channels;
        &self.values[(row - self.first) * length..][..length]
    }
}

/// Rows `rows` of the convolution of a map of `height` rows, rectified. `source` has all rows that they depend on.
///
/// Each pixel's patch is a row of a matrix, whose product with the kernel is the result.
pub(super) fn convolve(
    source: &Rows,
    height: usize,
    rows: Range<usize>,
    convolution: &Convolution,
    kernel: &Kernel,
) -> Rows {
    let columns = convolution.extent(source.columns).expect("a size that leaves features");
    let (terms, outputs) = (convolution.terms(), convolution.outputs);
    let pixels_at_once = (PATCH_VALUES / terms).clamp(1, MAX_PIXELS);
    let mut values = vec![0.0; rows.len() * columns * outputs];
    values.par_chunks_mut(pixels_at_once * outputs).enumerate().for_each_init(Vec::new, |patches, (task, results)| {
        let pixels = results.len() / outputs;
        patches.resize(pixels * terms, 0.0);
        for (n, patch) in patches.chunks_exact_mut(terms).enumerate() {
            let pixel = task * pixels_at_once + n;
            copy_patch(source, height, [rows.start + pixel / columns, pixel % columns], convolution, patch);
        }
        multiply(
            MatrixMut::new(results, pixels, outputs, outputs),
            Matrix::new(patches, pixels, terms, terms),
            Matrix::new(&kernel.values, terms, outputs, outputs),
            false,
        );
        for result in results.chunks_exact_mut(outputs) {
            result.iter_mut().zip(&kernel.bias).for_each(|(value, bias)| *value = (*value + bias).max(0.0));
        }
    });
    Rows { first: rows.start, columns, channels: outputs, values }
}

/// The features under the kernel of the pixel `row`, `column` of a result: \[rows\]\[columns\]\[inputs\], zero outside of
/// the map.
fn copy_patch(source: &Rows, height: usize, [row, column]: [usize; 2], convolution: &Convolution, patch: &mut [f32]) {
    let &Convolution { edge, stride, padding, inputs, .. } = convolution;
    // Positions are counted from the first zero of the padding.
    let (top, left) = (row * stride, column * stride);
    let within = left.max(padding)..(left + edge).min(source.columns + padding);
    for (i, part) in patch.chunks_exact_mut(edge * inputs).enumerate() {
        let inside = (top + i).checked_sub(padding).filter(|&row| row < height && !within.is_empty());
        let Some(row) = inside else {
            part.fill(0.0);
            continue;
        };
        let (before, after) = ((within.start - left) * inputs, (within.end - left) * inputs);
        part[..before].fill(0.0);
        part[before..after]
            .copy_from_slice(&source.row(row)[(within.start - padding) * inputs..(within.end - padding) * inputs]);
        part[after..].fill(0.0);
    }
}

/// Rows `rows` of the pooled map. `source` has all rows that they depend on.
pub(super) fn pool(source: &Rows, rows: Range<usize>, pool: Pool) -> Rows {
    let columns = pool.extent(source.columns).expect("a size that leaves features");
    let channels = source.channels;
    let mut values = vec![f32::NEG_INFINITY; rows.len() * columns * channels];
    values.par_chunks_mut(columns * channels).zip(rows.clone()).for_each(|(result, row)| {
        for (column, maxima) in result.chunks_exact_mut(channels).enumerate() {
            for from in row * pool.stride..row * pool.stride + pool.edge {
                let features = &source.row(from)[column * pool.stride * channels..][..pool.edge * channels];
                for pixel in features.chunks_exact(channels) {
                    maxima.iter_mut().zip(pixel).for_each(|(most, value)| *most = most.max(*value));
                }
            }
        }
    });
    Rows { first: rows.start, columns, channels, values }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn map(rows: Range<usize>, columns: usize, channels: usize) -> Rows {
        let length = columns * channels;
        let values = (rows.start * length..rows.end * length).map(|i| ((i * 7919 + 13) % 1009) as f32 / 1009.0 - 0.5);
        Rows { first: rows.start, columns, channels, values: values.collect() }
    }

    /// The convolution of `source` without patches, in f64.
    fn direct(source: &Rows, height: usize, rows: Range<usize>, layer: &Convolution, kernel: &Kernel) -> Vec<f64> {
        let columns = layer.extent(source.columns).unwrap();
        let mut values = Vec::new();
        for (row, column) in rows.flat_map(|row| (0..columns).map(move |column| (row, column))) {
            for output in 0..layer.outputs {
                let mut sum = f64::from(kernel.bias[output]);
                for (i, j) in (0..layer.edge).flat_map(|i| (0..layer.edge).map(move |j| (i, j))) {
                    let at = |position: usize, n: usize, extent: usize| {
                        (position * layer.stride + n).checked_sub(layer.padding).filter(|&at| at < extent)
                    };
                    let (Some(y), Some(x)) = (at(row, i, height), at(column, j, source.columns)) else { continue };
                    for input in 0..layer.inputs {
                        let weight =
                            kernel.values[((i * layer.edge + j) * layer.inputs + input) * layer.outputs + output];
                        sum += f64::from(weight) * f64::from(source.row(y)[x * layer.inputs + input]);
                    }
                }
                values.push(sum.max(0.0));
            }
        }
        values
    }

    #[test]
    fn convolutions_are_those_without_patches() {
        for (edge, stride, padding, width, height) in
            [(11, 4, 2, 31, 37), (5, 1, 2, 7, 9), (3, 1, 1, 2, 1), (3, 2, 0, 9, 8)]
        {
            let layer = Convolution { edge, stride, padding, inputs: 3, outputs: 5 };
            let kernel = Kernel { values: map(0..edge * edge, 3, 5).values, bias: vec![-0.1, 0.0, 0.1, 0.2, -0.2] };
            let all = layer.extent(height).unwrap();
            for rows in [0..all, 0..1, all / 2..all, all - 1..all] {
                let source = map(layer.source(&rows, height), width, 3);
                let found = convolve(&source, height, rows.clone(), &layer, &kernel).values;
                let expected = direct(&source, height, rows.clone(), &layer, &kernel);
                let is_close = |(found, expected): (&f32, &f64)| (f64::from(*found) - expected).abs() < 1e-5;
                assert_eq!(found.len(), expected.len());
                assert!(found.iter().zip(&expected).all(is_close), "{layer:?}, rows {rows:?}");
            }
        }
    }

    #[test]
    fn pooling_takes_the_largest_of_each_square() {
        let source = map(2..9, 7, 2);
        let pooled = pool(&source, 1..4, Pool { edge: 3, stride: 2 });
        assert_eq!((pooled.first, pooled.columns, pooled.values.len()), (1, 3, 3 * 3 * 2));
        for (n, &found) in pooled.values.iter().enumerate() {
            let (row, column, channel) = (1 + n / 6, n / 2 % 3, n % 2);
            let square = (2 * row..2 * row + 3).flat_map(|y| (2 * column..2 * column + 3).map(move |x| (y, x)));
            let expected = square.map(|(y, x)| source.row(y)[2 * x + channel]).fold(f32::MIN, f32::max);
            assert_eq!(found, expected, "{n}");
        }
    }
}
