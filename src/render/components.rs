//! Dropping the smallest components of tensors.

use crate::model::{Factors, Scale};

/// Keeps a `share` of each tensor's components, at least one of density and one of appearance: those with the largest
/// product of their vectors' lengths. Appearance components are columns of a matrix that all tensors share, so all
/// tensors keep the same.
pub(super) fn keep_components(scale: &mut Scale, share: f64) {
    let ranges = Factors::axis_ranges(scale.cloud.resolution);
    let rows = Factors::rows(scale.cloud.resolution);
    let kept = |rank: usize| ((share * rank as f64).ceil() as usize).clamp(1, rank);
    // [component] the product over axes of the lengths of its vectors.
    let sizes = |tensor: &[f32], rank: usize| -> Vec<f64> {
        let length = |c: usize, range: &std::ops::Range<usize>| {
            range.clone().map(|row| f64::from(tensor[row * rank + c]).powi(2)).sum::<f64>().sqrt()
        };
        (0..rank).map(|c| ranges.iter().map(|range| length(c, range)).product()).collect()
    };
    let factors = &mut scale.factors;

    let (rank, tensor_len) = (factors.density_rank as usize, rows * factors.density_rank as usize);
    let keep = kept(rank);
    let mut density = Vec::with_capacity(factors.density.len() / rank * keep);
    for tensor in factors.density.chunks_exact(tensor_len) {
        let chosen = largest(&sizes(tensor, rank), keep);
        density.extend(tensor.chunks_exact(rank).flat_map(|row| chosen.iter().map(|&c| row[c])));
    }
    (factors.density, factors.density_rank) = (density, keep as u32);

    let (rank, tensor_len) = (factors.appearance_rank as usize, rows * factors.appearance_rank as usize);
    let keep = kept(rank);
    let mut sums = vec![0.0; rank];
    for tensor in factors.appearance.chunks_exact(tensor_len) {
        sums.iter_mut().zip(sizes(tensor, rank)).for_each(|(sum, size)| *sum += size);
    }
    let matrix = &mut scale.appearance_matrix;
    for (c, sum) in sums.iter_mut().enumerate() {
        let column = matrix.weights.iter().skip(c).step_by(rank);
        *sum *= column.map(|w| f64::from(*w).powi(2)).sum::<f64>().sqrt();
    }
    let chosen = largest(&sums, keep);
    let pick = |values: &[f32]| -> Vec<f32> {
        values.chunks_exact(rank).flat_map(|row| chosen.iter().map(|&c| row[c])).collect()
    };
    (factors.appearance, factors.appearance_rank) = (pick(&factors.appearance), keep as u32);
    (matrix.weights, matrix.rank) = (pick(&matrix.weights), keep as u32);
}

/// The indices of the `count` largest of `values`, ascending.
fn largest(values: &[f64], count: usize) -> Vec<usize> {
    let mut order: Vec<usize> = (0..values.len()).collect();
    order.sort_by(|&a, &b| values[b].total_cmp(&values[a]));
    order.truncate(count);
    order.sort_unstable();
    order
}
