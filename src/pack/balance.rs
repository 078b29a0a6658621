//! Scaling the vectors of components, which does not change their products.

use std::ops::Range;

use rayon::prelude::*;

use crate::model::{Factors, Scene};

/// Scales the vectors of each component of `scene` so that their largest numbers are equally large: one quantization step then
/// suits all three.
pub fn balance(scene: &mut Scene) {
    for scale in &mut scene.scales {
        let (resolution, factors) = (scale.cloud.resolution, &mut scale.factors);
        balance_part(&mut factors.density, factors.density_rank, resolution);
        balance_part(&mut factors.appearance, factors.appearance_rank, resolution);
    }
}

/// The same for `values`, density or appearance of a scale: \[tensor\]\[axis\]\[vertex\]\[component\].
pub fn balance_part(values: &mut [f32], rank: u32, resolution: [u32; 3]) {
    let (axes, rows, rank) = (Factors::axis_ranges(resolution), Factors::rows(resolution), rank as usize);
    values.par_chunks_exact_mut(rows * rank).for_each(|values| {
        for c in 0..rank {
            let largest =
                |axis: &Range<usize>| entries(axis, rank, c).map(|at| f64::from(values[at].abs())).fold(0.0, f64::max);
            let gains = axes.each_ref().map(|axis| 1.0 / largest(axis));
            if gains.iter().all(|gain| gain.is_finite()) {
                scale_vectors(values, rank, c, &axes, gains);
            }
        }
    });
}

/// The places of component `c` of a tensor on an axis.
pub(super) fn entries(axis: &Range<usize>, rank: usize, c: usize) -> impl Iterator<Item = usize> {
    axis.clone().map(move |row| row * rank + c)
}

/// Scales the vectors of component `c` of a tensor by gains in the proportions of `gains`, all positive, whose product is 1.
/// Returns by how much those are larger.
pub(super) fn scale_vectors(
    values: &mut [f32],
    rank: usize,
    c: usize,
    axes: &[Range<usize>; 3],
    gains: [f64; 3],
) -> f64 {
    let mean = (gains[0] * gains[1] * gains[2]).cbrt();
    for (axis, gain) in axes.iter().zip(gains) {
        entries(axis, rank, c).for_each(|at| values[at] = (f64::from(values[at]) * gain / mean) as f32);
    }
    mean
}
