//! Scaling the factors of components, which does not change their products.

use std::ops::Range;

use rayon::prelude::*;

use strivec_format::model::{Block, Scene};

/// Scales the factors of each component of `scene` so that their largest numbers are equally large: one quantization step then
/// suits all of them.
pub fn balance(scene: &mut Scene) {
    for scale in &mut scene.scales {
        scale.factors.blocks_mut().for_each(|block| balance_block(block, scale.cloud.resolution));
    }
}

/// Scales the factors of each component of `block`, of tensors of `resolution` cells, so that their largest numbers are
/// equally large.
pub fn balance_block(block: &mut Block, resolution: [u32; 3]) {
    let (factors, rank, len) = (block.form.factors(resolution), block.rank as usize, block.tensor_len(resolution));
    block.values.par_chunks_exact_mut(len).for_each(|values| {
        for c in 0..rank {
            let largest =
                |rows: &Range<usize>| entries(rows, rank, c).map(|at| f64::from(values[at].abs())).fold(0.0, f64::max);
            let gains: Vec<f64> = factors.iter().map(|rows| 1.0 / largest(rows)).collect();
            if gains.iter().all(|gain| gain.is_finite()) {
                scale_factors(values, rank, c, &factors, &gains);
            }
        }
    });
}

/// The places of component `c` of a tensor in a factor of these `rows`.
pub(super) fn entries(rows: &Range<usize>, rank: usize, c: usize) -> impl Iterator<Item = usize> {
    rows.clone().map(move |row| row * rank + c)
}

/// Scales the `factors` of component `c` of a tensor by gains in the proportions of `gains`, all positive, whose product is 1.
/// Returns by how much those are larger.
pub(super) fn scale_factors(values: &mut [f32], rank: usize, c: usize, factors: &[Range<usize>], gains: &[f64]) -> f64 {
    let product = gains.iter().product::<f64>();
    let mean = if gains.len() == 3 { product.cbrt() } else { product.sqrt() };
    for (rows, gain) in factors.iter().zip(gains) {
        entries(rows, rank, c).for_each(|at| values[at] = (f64::from(values[at]) * gain / mean) as f32);
    }
    mean
}
