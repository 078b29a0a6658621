//! The importance of the components of tensors, estimated from rays of the photographs.

use rayon::prelude::*;

use crate::field::{Field, FieldScale};
use crate::model::{Factors, Scene};
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
    /// \[scale\] of density and appearance, \[tensor\]\[component\].
    scales: Vec<[Vec<f64>; 2]>,
}

/// The place of a component in the ranking.
#[derive(Clone, Copy, Debug)]
struct Ranked {
    /// Importance per parameter.
    importance: f64,
    /// Parameters of the component.
    parameters: u64,
    /// Scale, part (density 0, appearance 1), component counted over all tensors.
    index: [usize; 3],
}

impl ComponentImportance {
    fn zeros(scene: &Scene) -> Self {
        let zeros = |s: &[Vec<bool>; 2]| s.each_ref().map(|c| vec![0.0; c.len()]);
        Self { scales: ComponentMask::none(scene).scales.iter().map(zeros).collect() }
    }

    /// Importance of the new components of `scene`: the squared length of the gradient of the error against the
    /// photographs with respect to their third vector. \[scale\] `old_ranks` are the numbers of density and appearance
    /// components that are not new; their importance is infinite. Uses substream 0 of `random`.
    pub(in crate::train) fn of_addition(
        scene: &Scene,
        old_ranks: &[[usize; 2]],
        sampler: &RaySampler<'_>,
        random: &Random,
    ) -> Self {
        let sums = error_gradients(scene, sampler, random);
        let mut result = Self::zeros(scene);
        for (((scale, importance), sums), old) in scene.scales.iter().zip(&mut result.scales).zip(&sums).zip(old_ranks)
        {
            let rows = Factors::rows(scale.cloud.resolution);
            let third = Factors::axis_ranges(scale.cloud.resolution)[2].clone();
            let ranks = [scale.factors.density_rank as usize, scale.factors.appearance_rank as usize];
            for (((importance, sums), &old), rank) in importance.iter_mut().zip(sums).zip(old).zip(ranks) {
                importance.par_chunks_mut(rank).zip(sums.par_chunks(rows * rank)).for_each(|(importance, gradient)| {
                    importance[..old].fill(f64::INFINITY);
                    for (c, importance) in importance.iter_mut().enumerate().skip(old) {
                        *importance = third.clone().map(|row| f64::from(gradient[row * rank + c]).powi(2)).sum();
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
            let rows = Factors::rows(scale.cloud.resolution);
            let parts = [
                (&scale.factors.density, scale.factors.density_rank as usize),
                (&scale.factors.appearance, scale.factors.appearance_rank as usize),
            ];
            for (part, (values, rank)) in parts.into_iter().enumerate() {
                let nonzero = Factors::nonzero_components(values, rows, rank);
                components.extend(nonzero.iter().enumerate().filter(|(_, nonzero)| **nonzero).map(|(n, _)| Ranked {
                    importance: importance[part][n] / rows as f64,
                    parameters: rows as u64,
                    index: [s, part, n],
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
        for Ranked { parameters, index: [s, part, n], .. } in self.ranking(scene) {
            if left <= max_parameters {
                break;
            }
            mask.scales[s][part][n] = true;
            left -= parameters;
        }
        mask
    }
}

/// \[scale\] of density and appearance: the gradient of the mean squared error against the photographs, laid out as the
/// factors of `scene`.
fn error_gradients(scene: &Scene, sampler: &RaySampler<'_>, random: &Random) -> Vec<[Vec<f32>; 2]> {
    let field = Field::new(scene);
    let mut backward = Backward::new(&field);
    let mut sums: Vec<[Vec<f32>; 2]> = field
        .scales
        .iter()
        .map(|s| [vec![0.0; s.density.values().len()], vec![0.0; s.appearance.values().len()]])
        .collect();
    let count = sampler.active_ray_count().min(BATCH_RAYS);
    for n in 0..BATCHES {
        let batch = RayBatch::draw(sampler, &field, &random.substream(0), n * count as u64, count);
        let gradients = backward.gradients(&field, &batch.rays, &batch.targets, BatchRoulette::default());
        for ((sums, density), appearance) in sums.iter_mut().zip(gradients.density).zip(gradients.appearance) {
            for (sums, gradients) in sums.iter_mut().zip([density, appearance]) {
                sums.par_iter_mut().zip(gradients).for_each(|(sum, g)| *sum += g / BATCHES as f32);
            }
        }
    }
    let dense = |(scale, [density, appearance]): (&FieldScale<f32>, [Vec<f32>; 2])| {
        [scale.density.held().dense(&density), scale.appearance.held().dense(&appearance)]
    };
    field.scales.iter().zip(sums).map(dense).collect()
}
