//! Pruning of unimportant components.

use crate::FactorImportance;
use strivec_format::model::Scene;

/// Writes zeros over the components whose absence adds at most `max_error` each to the mean squared error of pictures.
/// Returns their share of all components.
pub fn prune(scene: &mut Scene, importance: &FactorImportance, max_error: f64) -> f64 {
    let (mut pruned, mut all) = (0u64, 0u64);
    for (scale, importance) in scene.scales.iter_mut().zip(&importance.scales) {
        for (block, importance) in scale.factors.blocks_mut().zip(importance) {
            let (rank, len) = (block.rank as usize, block.tensor_len(scale.cloud.resolution));
            let absences = importance.components.chunks_exact(rank);
            for (values, absences) in block.values.chunks_exact_mut(len).zip(absences) {
                for (c, &absent) in absences.iter().enumerate() {
                    all += 1;
                    if absent <= max_error {
                        pruned += 1;
                        values.iter_mut().skip(c).step_by(rank).for_each(|v| *v = 0.0);
                    }
                }
            }
        }
    }
    pruned as f64 / all.max(1) as f64
}
