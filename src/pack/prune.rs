//! Pruning of unimportant components.

use crate::model::{Factors, Scene};
use crate::train::FactorImportance;

/// Writes zeros over the components whose absence adds at most `max_error` each to the mean squared error of pictures.
/// Returns their share of all components.
pub fn prune(scene: &mut Scene, importance: &FactorImportance, max_error: f64) -> f64 {
    let (mut pruned, mut all) = (0u64, 0u64);
    for (s, scale) in scene.scales.iter_mut().enumerate() {
        let rows = Factors::rows(scale.cloud.resolution);
        let factors = &mut scale.factors;
        for (values, rank, importance) in [
            (&mut factors.density, factors.density_rank as usize, &importance.density[s]),
            (&mut factors.appearance, factors.appearance_rank as usize, &importance.appearance[s]),
        ] {
            let absences = importance.components.chunks_exact(rank);
            for (values, absences) in values.chunks_exact_mut(rows * rank).zip(absences) {
                for (c, &absent) in absences.iter().enumerate() {
                    all += 1;
                    if absent <= max_error {
                        pruned += 1;
                        (0..rows).for_each(|row| values[row * rank + c] = 0.0);
                    }
                }
            }
        }
    }
    pruned as f64 / all.max(1) as f64
}
