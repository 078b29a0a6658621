//! The importance of the components of tensors, estimated from rays of the photographs.

use rayon::prelude::*;

use crate::field::{Field, FieldFactors, FieldScale};
use crate::model::Scene;
use crate::random::Random;
use crate::train::component_mask::ComponentMask;
use crate::train::{Backward, BatchRoulette, RayBatch, RaySampler};

/// Batches of rays that importance is averaged over.
const BATCHES: u64 = 24;
/// The most rays of a batch.
const BATCH_RAYS: usize = 8192;

/// Dependence of the pictures on each component of each tensor. Its unit is that of a squared error, per component.
#[derive(Clone, Debug)]
pub(in crate::train) struct ComponentImportance {
    /// \[scale\]\[block\]\[tensor\]\[component\].
    scales: Vec<Vec<Vec<f64>>>,
}

/// The place of a component in the ranking.
#[derive(Clone, Copy, Debug)]
struct Ranked {
    /// Importance per parameter.
    importance: f64,
    /// Parameters of the component.
    parameters: u64,
    /// Scale, block, component counted over all tensors.
    index: [usize; 3],
}

impl ComponentImportance {
    fn zeros(scene: &Scene) -> Self {
        let zeros = |s: &Vec<Vec<bool>>| s.iter().map(|c| vec![0.0; c.len()]).collect();
        Self { scales: ComponentMask::none(scene).scales.iter().map(zeros).collect() }
    }

    /// Importance of the new components of `scene`: the squared length of the gradient of the error against the
    /// photographs with respect to their last factor. \[scale\]\[block\] `old_ranks` are the numbers of components that are
    /// not new; their importance is infinite. Uses substream 0 of `random`.
    pub(in crate::train) fn of_addition(
        scene: &Scene,
        old_ranks: &[Vec<usize>],
        sampler: &RaySampler<'_>,
        random: &Random,
    ) -> Self {
        let sums = error_gradients(scene, sampler, random);
        let mut result = Self::zeros(scene);
        for (((scale, importance), sums), old) in scene.scales.iter().zip(&mut result.scales).zip(&sums).zip(old_ranks)
        {
            let resolution = scale.cloud.resolution;
            for (((importance, sums), &old), block) in
                importance.iter_mut().zip(sums).zip(old).zip(scale.factors.blocks())
            {
                let (rank, len) = (block.rank as usize, block.tensor_len(resolution));
                let last = block.form.factors(resolution).pop().unwrap_or_default();
                importance.par_chunks_mut(rank).zip(sums.par_chunks(len)).for_each(|(importance, gradient)| {
                    importance[..old].fill(f64::INFINITY);
                    for (c, importance) in importance.iter_mut().enumerate().skip(old) {
                        *importance = last.clone().map(|row| f64::from(gradient[row * rank + c]).powi(2)).sum();
                    }
                });
            }
        }
        result
    }

    /// The nonzero components of `scene`, least important per parameter first.
    fn ranking(&self, scene: &Scene) -> Vec<Ranked> {
        let mut components = Vec::new();
        for (s, (scale, importance)) in scene.scales.iter().zip(&self.scales).enumerate() {
            for (b, block) in scale.factors.blocks().enumerate() {
                let rows = block.form.rows(scale.cloud.resolution);
                let nonzero = block.nonzero_components(scale.cloud.resolution);
                components.extend(nonzero.iter().enumerate().filter(|(_, nonzero)| **nonzero).map(|(n, _)| Ranked {
                    importance: importance[b][n] / rows as f64,
                    parameters: rows as u64,
                    index: [s, b, n],
                }));
            }
        }
        components.sort_by(|a, b| a.importance.total_cmp(&b.importance).then(a.index.cmp(&b.index)));
        components
    }

    /// A mask of the least important components of `scene`, as many as must go to leave at most `max_parameters`. The
    /// ranks of `scene` are those of the estimate; its resolutions may differ.
    pub(in crate::train) fn least_important(&self, scene: &Scene, max_parameters: u64) -> ComponentMask {
        let mut mask = ComponentMask::none(scene);
        let mut left = scene.nonzero_parameter_count();
        for Ranked { parameters, index: [s, b, n], .. } in self.ranking(scene) {
            if left <= max_parameters {
                break;
            }
            mask.scales[s][b][n] = true;
            left -= parameters;
        }
        mask
    }
}

/// \[scale\]\[block\] the gradient of the mean squared error against the photographs, laid out as the factors of `scene`.
fn error_gradients(scene: &Scene, sampler: &RaySampler<'_>, random: &Random) -> Vec<Vec<Vec<f32>>> {
    let field = Field::new(scene);
    let mut backward = Backward::new(&field);
    let zeros = |block: &FieldFactors<f32>| vec![0.0; block.values().len()];
    let mut sums: Vec<Vec<Vec<f32>>> = field.scales.iter().map(|s| s.blocks().map(zeros).collect()).collect();
    let count = sampler.active_ray_count().min(BATCH_RAYS);
    for n in 0..BATCHES {
        let batch = RayBatch::draw(sampler, &field, &random.substream(0), n * count as u64, count);
        let gradients = backward.gradients(&field, &batch.rays, &batch.targets, BatchRoulette::default());
        for (sums, gradients) in sums.iter_mut().flatten().zip(gradients.factors.into_iter().flatten()) {
            sums.par_iter_mut().zip(gradients).for_each(|(sum, g)| *sum += g / BATCHES as f32);
        }
    }
    let dense = |(scale, sums): (&FieldScale<f32>, Vec<Vec<f32>>)| {
        scale.blocks().zip(sums).map(|(block, sums)| block.held().dense(&sums)).collect()
    };
    field.scales.iter().zip(sums).map(dense).collect()
}
