//! After training: clearing what none of its rays makes use of.
//!
//! In: a trained scene and its photographs. Out: the same scene with exact zeros in place of some components, which files
//! leave out. A tensor without components still covers, ranks and weighs (DESIGN, section 2.11).
//!
//! What is cleared, in this order, judged by a sample of the rays that were trained on:
//! - a tensor's appearance, where it is a neighbor of no sample that gets a color;
//! - a tensor's density, where every sample that it is a neighbor of is empty, before and after. To be empty before is not
//!   enough: it may be the tensor that keeps the sample so;
//! - components that are too small to matter wherever they are.
//!
//! Other rays than those that decided then measure what it cost. More than [`MAX_LOSS`] is not paid.

use rayon::prelude::*;
use serde::Serialize;

use super::chunk::RAYS_PER_CHUNK;
use super::component_mask::ComponentMask;
use super::{RayBatch, RaySampler};
use crate::field::{Field, Samples, vectorized};
use crate::geometry::Ray;
use crate::model::{Factors, Scene};
use crate::random::Random;

/// Rays that decide what is made use of, at most.
const SELECTION_RAYS: usize = 1 << 18;
/// Other rays that measure what it cost, at most.
const MEASURED: usize = 1 << 15;
/// dB that clearing may cost on the rays that measure it.
pub const MAX_LOSS: f64 = 0.01;
/// By this much all small components of a tensor together may change its density feature, or any of its appearance
/// features: a thousandth of σ where that is small, and less than a thousandth of what the network tells apart.
const MAX_CHANGE: f64 = 1e-3;
/// After so many looks at what clearing densities wakes up, those that still wake something keep theirs.
const MAX_LOOKS: usize = 8;

/// What was cleared.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct DeadComponents {
    /// Tensors of which nothing is left.
    pub tensors_dropped: u64,
    /// Components of tensors, of density and of appearance; those of `tensors_dropped` included.
    pub components_dropped: u64,
    /// Factor entries in them.
    pub parameters_saved: u64,
    /// On rays of the photographs, in dB.
    pub psnr_before: f64,
    /// On the same rays; at most [`MAX_LOSS`] less.
    pub psnr_after: f64,
}

/// Clears what the rays of `photographs` make no use of in `scene`, which was trained on them. The same scene,
/// photographs and `seed` always give the same result, on any number of threads. Where nothing is unused, or clearing it
/// would cost more than [`MAX_LOSS`], the scene stays as it is.
pub fn prune_dead_components(scene: &mut Scene, photographs: &RaySampler<'_>, seed: u64) -> DeadComponents {
    let mut field = Field::<f32>::new(scene);
    // A permutation of the rays: the first ones decide, the next ones measure. Where there are few, they do both.
    let kept = photographs.kept_count();
    let looked_at = kept.min(SELECTION_RAYS);
    let order = Random::new(seed, "unused");
    let draw = |first: usize, count: usize| RayBatch::draw(photographs, &field, &order, first as u64, count);
    let (looked, measured) = (draw(0, looked_at), draw(looked_at, kept.min(MEASURED)));

    let psnr_before = measured.psnr(&field);
    let mut cleared = ComponentMask::nothing(scene);
    clear_idle_tensors(&mut cleared, scene, &mut field, &looked);
    let idle = cleared.clone();
    clear_small_components(&mut cleared, scene);
    for cleared in [cleared, idle] {
        cleared.write_to(scene, &mut field);
        let psnr_after = measured.psnr(&field);
        // The second where pictures fit exactly. What is not a number costs too much.
        if psnr_before - psnr_after <= MAX_LOSS || psnr_after == psnr_before {
            let (tensors_dropped, components_dropped, parameters_saved) = cleared.count(scene);
            if components_dropped == 0 {
                break;
            }
            cleared.clear(scene);
            return DeadComponents { tensors_dropped, components_dropped, parameters_saved, psnr_before, psnr_after };
        }
    }
    DeadComponents { psnr_before, psnr_after: psnr_before, ..DeadComponents::default() }
}

/// Clears the density of tensors that touch only empty samples, and the appearance of those that touch no colored one.
/// Leaves in `field` what the scene then is.
fn clear_idle_tensors(cleared: &mut ComponentMask, scene: &Scene, field: &mut Field<f32>, looked: &RayBatch) {
    let mut used = uses(looked, field);
    let mut idle: Vec<bool> = used.iter().map(|u| !u.density).collect();
    for look in 0.. {
        cleared.set_tensors(scene, 0, &idle);
        cleared.write_to(scene, field);
        let now = uses(looked, field);
        let woken = idle.iter().zip(&now).any(|(&idle, now)| idle && now.density);
        if !woken {
            used.iter_mut().zip(&now).for_each(|(used, now)| used.appearance |= now.appearance);
            break;
        }
        for (now, idle) in now.iter().zip(&mut idle) {
            // What woke something keeps its density, so this ends.
            *idle &= !now.density && look < MAX_LOOKS;
        }
    }
    let idle: Vec<bool> = used.iter().map(|u| !u.appearance).collect();
    cleared.set_tensors(scene, 1, &idle);
}

/// Clears the smallest components of each tensor, as many as together change no feature by more than [`MAX_CHANGE`].
///
/// A component adds at most the product of its vectors' largest magnitudes to a feature; an appearance component that times
/// its weight in the appearance matrix. A scale's weights add up to 1 at most, so this holds for a sample, scale by scale.
fn clear_small_components(cleared: &mut ComponentMask, scene: &Scene) {
    for (scale, cleared) in scene.scales.iter().zip(&mut cleared.scales) {
        let (rows, axes) = (Factors::rows(scale.cloud.resolution), Factors::axis_ranges(scale.cloud.resolution));
        let matrix = &scale.appearance_matrix;
        let heaviest = |c: usize| {
            let weights = matrix.weights.iter().skip(c).step_by(matrix.rank as usize);
            weights.fold(0.0, |largest: f64, w| largest.max(f64::from(w.abs())))
        };
        let [density, appearance] = cleared;
        let density_gains = vec![1.0; scale.factors.density_rank as usize];
        let appearance_gains: Vec<f64> = (0..matrix.rank as usize).map(heaviest).collect();
        for (values, cleared, gains) in [
            (&scale.factors.density, density, density_gains),
            (&scale.factors.appearance, appearance, appearance_gains),
        ] {
            let rank = gains.len();
            let tensors = values.par_chunks_exact(rows * rank).zip(cleared.par_chunks_exact_mut(rank));
            tensors.for_each(|(values, cleared)| {
                let largest = |c: usize, a: usize| {
                    let of_axis = axes[a].clone().map(|row| f64::from(values[row * rank + c].abs()));
                    of_axis.fold(0.0, f64::max)
                };
                let mut bounds: Vec<(f64, usize)> =
                    (0..rank).map(|c| (gains[c] * largest(c, 0) * largest(c, 1) * largest(c, 2), c)).collect();
                bounds.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
                let mut change = 0.0;
                for (bound, c) in bounds {
                    change += bound;
                    if change > MAX_CHANGE {
                        break;
                    }
                    cleared[c] = true;
                }
            });
        }
    }
}

/// What a tensor is a neighbor of.
#[derive(Clone, Copy, Default)]
struct Use {
    /// A sample that is not empty.
    density: bool,
    /// A sample that gets a color.
    appearance: bool,
}

/// What each tensor of `field`, counted over all scales, is used for. A sample is empty where it would get no color even
/// on a clear ray.
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
    // Whether something is used does not depend on the order in which it is found out.
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
