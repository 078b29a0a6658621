//! The ranks that all tensors of a scale share.

use strivec_format::model::{Block, Scene};

/// Lowers the ranks of each scale as far as no nonzero component is lost. Density components may be in any order, so
/// the rank is the most that a tensor has. Appearance components have their columns in the appearance matrix, so only
/// those are dropped that are zero in every tensor. Pictures stay the same but for the order of sums.
pub(super) fn drop_ranks(scene: &mut Scene) {
    for scale in &mut scene.scales {
        let resolution = scale.cloud.resolution;
        for block in &mut scale.factors.density {
            let rank = block.rank as usize;
            let nonzero = block.nonzero_components(resolution);
            let kept: Vec<Vec<usize>> =
                nonzero.chunks_exact(rank).map(|nonzero| (0..rank).filter(|&c| nonzero[c]).collect()).collect();
            let most = kept.iter().map(Vec::len).max().unwrap_or(0).max(1);
            set_components(block, resolution, most, |n| &kept[n]);
        }
        let mut columns = Vec::new();
        let mut first = 0;
        for block in &mut scale.factors.appearance {
            let rank = block.rank as usize;
            let nonzero = block.nonzero_components(resolution);
            let is_kept = |c: &usize| nonzero.iter().skip(*c).step_by(rank).any(|&n| n);
            let mut kept: Vec<usize> = (0..rank).filter(is_kept).collect();
            if kept.is_empty() {
                kept.push(0);
            }
            set_components(block, resolution, kept.len(), |_| &kept);
            columns.extend(kept.iter().map(|c| first + c));
            first += rank;
        }
        let matrix = &mut scale.appearance_matrix;
        matrix.weights = matrix.weights.chunks_exact(first).flat_map(|row| columns.iter().map(|&c| row[c])).collect();
        matrix.rank = columns.len() as u32;
    }
}

/// Gives tensors of `resolution` cells the components `kept`(tensor) of `block` first and zeros after them, `rank` in all.
pub(super) fn set_components<'k>(
    block: &mut Block,
    resolution: [u32; 3],
    rank: usize,
    kept: impl Fn(usize) -> &'k Vec<usize>,
) {
    let old_rank = block.rank as usize;
    let mut changed = Vec::with_capacity(block.values.len() / old_rank * rank);
    for (n, tensor) in block.values.chunks_exact(block.tensor_len(resolution)).enumerate() {
        for row in tensor.chunks_exact(old_rank) {
            let end = changed.len() + rank;
            changed.extend(kept(n).iter().map(|&c| row[c]));
            changed.resize(end, 0.0);
        }
    }
    (block.values, block.rank) = (changed, rank as u32);
}
