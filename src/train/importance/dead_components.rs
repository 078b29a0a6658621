//! Dead components: those that no ray of the photographs depends on. They are removed after training.
//!
//! In: a trained scene and its photographs. Out: the same scene with exact zeros for the dead components, which files
//! leave out. A tensor without components still takes part in coverage, ranking and weighting (spec 3.10).
//!
//! A sample of the rays that were trained on decides, in this order:
//! - the appearance of a tensor is dead if the tensor is a neighbor of no shaded sample;
//! - the density of a tensor is dead if every sample that it is a neighbor of is empty, both with and without it. It is
//!   not enough that they are empty with it, as its negative density feature may be the reason;
//! - components are dead that are too small to matter anywhere.
//!
//! Other rays measure the loss. Nothing is removed if it is more than [`MAX_LOSS`].

use std::ops::Range;

use rayon::prelude::*;
use serde::Serialize;

use crate::component_mask::ComponentMask;
use crate::{RAYS_PER_CHUNK, RayBatch, RaySampler, TrainError};
use strivec_field::{Field, Samples, vectorized};
use strivec_format::color_map::ColorMap;
use strivec_format::geometry::Ray;
use strivec_format::model::Scene;
use strivec_format::random::Random;

/// The most rays that decide.
const SELECTION_RAYS: usize = 1 << 18;
/// The most other rays that measure the loss.
const EVAL_RAYS: usize = 1 << 15;
/// The PSNR that pruning may cost, in dB.
pub const MAX_LOSS: f64 = 0.01;
/// The most that all small components of a tensor together may change its density feature, or any of its appearance
/// features. It is a thousandth of σ if σ is small, and less than a thousandth of the differences that the decoder
/// responds to.
const MAX_CHANGE: f64 = 1e-3;
/// Rounds of density pruning. Tensors whose removal still fills an empty sample after the last round keep their
/// density.
const MAX_ROUNDS: usize = 8;

/// The components that were removed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct DeadComponents {
    /// Tensors without any component left.
    pub tensors_dropped: u64,
    /// Components of density and of appearance, with those of `tensors_dropped`.
    pub components_dropped: u64,
    /// Factor entries in them.
    pub parameters_saved: u64,
    /// PSNR on rays of the photographs before, in dB.
    pub psnr_before: f64,
    /// PSNR on the same rays after, in dB; at most [`MAX_LOSS`] less.
    pub psnr_after: f64,
}

/// Writes zeros over the dead components of `scene`, which was trained on the photographs of `sampler`; \[view\] `maps` lead
/// from the scene's colors to theirs, none if empty. The same scene, photographs and `seed` always give the same result, on any
/// number of threads. The scene stays as it is if no component is dead, or if pruning would cost more than [`MAX_LOSS`].
///
/// # Errors
///
/// [`TrainError::EmptyScene`] if all components are dead: every photograph would show the background.
pub fn prune_dead_components(
    scene: &mut Scene,
    sampler: &RaySampler<'_>,
    maps: &[ColorMap],
    seed: u64,
) -> Result<DeadComponents, TrainError> {
    let mut field = Field::<f32>::unlimited(scene);
    // The sequence is a permutation of the rays: the first ones decide, the next ones measure. If there are few, they
    // do both.
    let count = sampler.active_ray_count();
    let selecting = count.min(SELECTION_RAYS);
    let order = Random::new(seed, "unused");
    let draw = |first: usize, count: usize| RayBatch::draw(sampler, &field, &order, first as u64, count);
    let (selection, evaluation) = (draw(0, selecting), draw(selecting, count.min(EVAL_RAYS)));

    let psnr_before = evaluation.psnr(&field, maps);
    let mut mask = ComponentMask::none(scene);
    mask_idle_tensors(&mut mask, scene, &mut field, &selection);
    let idle = mask.clone();
    mask_small_components(&mut mask, scene);
    // Without the small components, if those cost too much.
    for mask in [mask, idle] {
        mask.write_to(scene, &mut field);
        let psnr_after = evaluation.psnr(&field, maps);
        // PSNRs are equal and infinite if pictures fit exactly. A PSNR that is not a number is a loss.
        if psnr_before - psnr_after <= MAX_LOSS || psnr_after == psnr_before {
            let (tensors_dropped, components_dropped, parameters_saved) = mask.count(scene);
            if components_dropped == 0 {
                break;
            }
            mask.apply(scene);
            if scene.scales.iter().all(|s| s.nonzero_parameter_count() == s.appearance_matrix.weights.len() as u64) {
                return Err(TrainError::EmptyScene { steps: scene.provenance.steps });
            }
            return Ok(DeadComponents {
                tensors_dropped,
                components_dropped,
                parameters_saved,
                psnr_before,
                psnr_after,
            });
        }
    }
    Ok(DeadComponents { psnr_before, psnr_after: psnr_before, ..DeadComponents::default() })
}

/// Masks the density of tensors that are neighbors of empty samples alone, and the appearance of those that are
/// neighbors of no shaded sample. Leaves the masked scene in `field`.
fn mask_idle_tensors(mask: &mut ComponentMask, scene: &Scene, field: &mut Field<f32>, selection: &RayBatch) {
    let mut used = uses(selection, field);
    let mut idle: Vec<bool> = used.iter().map(|u| !u.density).collect();
    for round in 0.. {
        mask.set_tensors(scene, true, &idle);
        mask.write_to(scene, field);
        let now = uses(selection, field);
        let is_any_filled = idle.iter().zip(&now).any(|(&idle, now)| idle && now.density);
        if !is_any_filled {
            used.iter_mut().zip(&now).for_each(|(used, now)| used.appearance |= now.appearance);
            break;
        }
        for (now, idle) in now.iter().zip(&mut idle) {
            // A tensor that fills an empty sample keeps its density, so the loop ends.
            *idle &= !now.density && round < MAX_ROUNDS;
        }
    }
    let idle: Vec<bool> = used.iter().map(|u| !u.appearance).collect();
    mask.set_tensors(scene, false, &idle);
}

/// Masks the smallest components of each tensor, as many as together change no feature by more than [`MAX_CHANGE`].
///
/// A component adds at most the product of its factors' largest magnitudes to a feature; an appearance component that
/// times its weight in the appearance matrix. A scale's weights add up to 1 at most, so this holds for a sample, scale
/// by scale.
fn mask_small_components(mask: &mut ComponentMask, scene: &Scene) {
    for (scale, masks) in scene.scales.iter().zip(&mut mask.scales) {
        let (resolution, matrix) = (scale.cloud.resolution, &scale.appearance_matrix);
        let heaviest = |c: usize| {
            let weights = matrix.weights.iter().skip(c).step_by(matrix.rank as usize);
            weights.fold(0.0, |largest: f64, w| largest.max(f64::from(w.abs())))
        };
        let gains = vec![1.0; scale.factors.density_rank() as usize].into_iter();
        let mut gains = gains.chain((0..matrix.rank as usize).map(heaviest));
        for (block, masks) in scale.factors.blocks().zip(masks) {
            let rank = block.rank as usize;
            let gains: Vec<f64> = gains.by_ref().take(rank).collect();
            let factors = block.form.factors(resolution);
            let tensors = block.values.par_chunks_exact(block.tensor_len(resolution));
            tensors.zip(masks.par_chunks_exact_mut(rank)).for_each(|(values, mask)| {
                let largest = |c: usize, rows: &Range<usize>| {
                    rows.clone().map(|row| f64::from(values[row * rank + c].abs())).fold(0.0, f64::max)
                };
                let bound = |c: usize| gains[c] * factors.iter().map(|rows| largest(c, rows)).product::<f64>();
                let mut bounds: Vec<(f64, usize)> = (0..rank).map(|c| (bound(c), c)).collect();
                bounds.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
                let mut change = 0.0;
                for (bound, c) in bounds {
                    change += bound;
                    if change > MAX_CHANGE {
                        break;
                    }
                    mask[c] = true;
                }
            });
        }
    }
}

/// The samples that a tensor is a neighbor of.
#[derive(Clone, Copy, Default)]
struct Use {
    /// One of them is not empty.
    density: bool,
    /// One of them is shaded.
    appearance: bool,
}

/// \[tensor\] the uses of the tensors of `field`, counted over all scales. A sample is empty if it would not be shaded
/// even at transmittance 1.
fn uses(batch: &RayBatch, field: &Field<f32>) -> Vec<Use> {
    let min_weight = field.rules.min_weight as f32;
    let none = || (vec![Use::default(); field.tensor_count()], Samples::default());
    let look = |(mut uses, mut samples): (Vec<Use>, Samples<f32>), rays: &[Ray]| {
        vectorized(
            #[inline(always)]
            || field.march(rays, &mut samples),
        );
        let scales = field.scales.len();
        for &place in &samples.order {
            let place = place as usize;
            let now =
                Use { density: samples.alphas[place] > min_weight, appearance: samples.weight(place) > min_weight };
            if !now.density {
                continue;
            }
            for pair in (0..scales).flat_map(|s| samples.contributions_of(place, s, scales)) {
                let of_tensor = &mut uses[pair.tensor as usize];
                of_tensor.density = true;
                of_tensor.appearance |= now.appearance;
            }
        }
        (uses, samples)
    };
    // A union does not depend on the order.
    let union = |mut a: Vec<Use>, b: Vec<Use>| {
        for (a, b) in a.iter_mut().zip(b) {
            a.density |= b.density;
            a.appearance |= b.appearance;
        }
        a
    };
    let least = batch.rays.len().div_ceil(RAYS_PER_CHUNK).div_ceil(16).max(1);
    (batch.rays.par_chunks(RAYS_PER_CHUNK).with_min_len(least))
        .fold(none, look)
        .map(|(uses, _)| uses)
        .reduce(|| vec![Use::default(); field.tensor_count()], union)
}
