//! The ranks that all tensors of a scale share.

use crate::model::{Factors, Scene};

/// Lowers the ranks of each scale as far as no nonzero component is lost. Density components may be in any order, so
/// the rank is the most that a tensor has. Appearance components have their columns in the appearance matrix, so only
/// those are dropped that are zero in every tensor. Pictures stay the same but for the order of sums.
pub(super) fn drop_ranks(scene: &mut Scene) {
    for scale in &mut scene.scales {
        let rows = Factors::rows(scale.cloud.resolution);
        let factors = &mut scale.factors;
        let rank = factors.density_rank as usize;
        let nonzero = Factors::nonzero_components(&factors.density, rows, rank);
        let kept: Vec<Vec<usize>> =
            nonzero.chunks_exact(rank).map(|nonzero| (0..rank).filter(|&c| nonzero[c]).collect()).collect();
        let most = kept.iter().map(Vec::len).max().unwrap_or(0).max(1);
        factors.density = with_components(&factors.density, rows, rank, most, |n| &kept[n]);
        factors.density_rank = most as u32;

        let rank = factors.appearance_rank as usize;
        let nonzero = Factors::nonzero_components(&factors.appearance, rows, rank);
        let mut kept: Vec<usize> = (0..rank).filter(|&c| nonzero.iter().skip(c).step_by(rank).any(|&n| n)).collect();
        if kept.is_empty() {
            kept.push(0);
        }
        factors.appearance = with_components(&factors.appearance, rows, rank, kept.len(), |_| &kept);
        factors.appearance_rank = kept.len() as u32;
        let matrix = &mut scale.appearance_matrix;
        matrix.weights = matrix.weights.chunks_exact(rank).flat_map(|row| kept.iter().map(|&c| row[c])).collect();
        matrix.rank = kept.len() as u32;
    }
}

/// `values` of `rank` components, with the components `kept`(tensor) first and zeros after them, `new_rank` in all.
pub(super) fn with_components<'k>(
    values: &[f32],
    rows: usize,
    rank: usize,
    new_rank: usize,
    kept: impl Fn(usize) -> &'k Vec<usize>,
) -> Vec<f32> {
    let mut changed = Vec::with_capacity(values.len() / rank * new_rank);
    for (n, tensor) in values.chunks_exact(rows * rank).enumerate() {
        for row in tensor.chunks_exact(rank) {
            let end = changed.len() + new_rank;
            changed.extend(kept(n).iter().map(|&c| row[c]));
            changed.resize(end, 0.0);
        }
    }
    changed
}
