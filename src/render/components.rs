//! Dropping the smallest components of tensors.

use crate::model::{Block, Scale};

/// Keeps a `share` of the components of each block of each tensor, but at least one: those with the largest product of their
/// factors' lengths. Appearance components are columns of a matrix that all tensors share, so all tensors keep the same.
pub(super) fn keep_components(scale: &mut Scale, share: f64) {
    let resolution = scale.cloud.resolution;
    let kept = |rank: usize| ((share * rank as f64).ceil() as usize).clamp(1, rank);
    for block in &mut scale.factors.density {
        let rank = block.rank as usize;
        let keep = kept(rank);
        let mut values = Vec::with_capacity(block.values.len() / rank * keep);
        for tensor in block.values.chunks_exact(block.tensor_len(resolution)) {
            let chosen = largest(&sizes(block, tensor, resolution), keep);
            values.extend(tensor.chunks_exact(rank).flat_map(|row| chosen.iter().map(|&c| row[c])));
        }
        (block.values, block.rank) = (values, keep as u32);
    }
    let matrix = &mut scale.appearance_matrix;
    let all = matrix.rank as usize;
    let (mut columns, mut first) = (Vec::new(), 0);
    for block in &mut scale.factors.appearance {
        let rank = block.rank as usize;
        let mut sums = vec![0.0; rank];
        for tensor in block.values.chunks_exact(block.tensor_len(resolution)) {
            sums.iter_mut().zip(sizes(block, tensor, resolution)).for_each(|(sum, size)| *sum += size);
        }
        for (c, sum) in sums.iter_mut().enumerate() {
            let column = matrix.weights.iter().skip(first + c).step_by(all);
            *sum *= column.map(|w| f64::from(*w).powi(2)).sum::<f64>().sqrt();
        }
        let chosen = largest(&sums, kept(rank));
        block.values = block.values.chunks_exact(rank).flat_map(|row| chosen.iter().map(|&c| row[c])).collect();
        block.rank = chosen.len() as u32;
        columns.extend(chosen.iter().map(|c| first + c));
        first += rank;
    }
    matrix.weights = matrix.weights.chunks_exact(all).flat_map(|row| columns.iter().map(|&c| row[c])).collect();
    matrix.rank = columns.len() as u32;
}

/// \[component\] the product of the lengths of the factors of a `tensor` of `block`.
fn sizes(block: &Block, tensor: &[f32], resolution: [u32; 3]) -> Vec<f64> {
    let (rank, factors) = (block.rank as usize, block.form.factors(resolution));
    let length = |c: usize, rows: &std::ops::Range<usize>| {
        rows.clone().map(|row| f64::from(tensor[row * rank + c]).powi(2)).sum::<f64>().sqrt()
    };
    (0..rank).map(|c| factors.iter().map(|rows| length(c, rows)).product()).collect()
}

/// The indices of the `count` largest of `values`, ascending.
fn largest(values: &[f64], count: usize) -> Vec<usize> {
    let mut order: Vec<usize> = (0..values.len()).collect();
    order.sort_by(|&a, &b| values[b].total_cmp(&values[a]));
    order.truncate(count);
    order.sort_unstable();
    order
}
