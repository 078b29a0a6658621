//! Pruning of unimportant components.

use crate::model::{Factors, Scene};
use crate::train::FactorImportance;

/// Writes zeros over the components whose absence adds at most `max_error` each to the mean squared error of pictures.
/// Returns their share of all components.
pub fn prune(scene: &mut Scene, importance: &FactorImportance, max_error: f64) -> f64 {
    let (mut pruned, mut all) = (0u64, 0u64);
    for (s, scale) in scene.scales.iter_mut().enumerate() {
        let resolution = scale.cloud.resolution;
        let (rows, axes) = (Factors::rows(resolution), Factors::axis_ranges(resolution));
        let factors = &mut scale.factors;
        for (values, rank, h) in [
            (&mut factors.density, factors.density_rank as usize, &importance.density[s]),
            (&mut factors.appearance, factors.appearance_rank as usize, &importance.appearance[s]),
        ] {
            for (values, h) in values.chunks_exact_mut(rows * rank).zip(h.chunks_exact(rows * rank)) {
                for c in 0..rank {
                    let cost = |a: usize| {
                        let of_axis = axes[a].clone().map(|row| row * rank + c);
                        of_axis.map(|at| f64::from(h[at]) * f64::from(values[at]).powi(2)).sum::<f64>()
                    };
                    all += 1;
                    if cost(0).min(cost(1)).min(cost(2)) <= max_error {
                        pruned += 1;
                        (0..rows).for_each(|row| values[row * rank + c] = 0.0);
                    }
                }
            }
        }
    }
    pruned as f64 / all.max(1) as f64
}
