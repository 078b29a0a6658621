//! Giving parameters back that pictures hardly need, a quarter of what is left in each round.
//!
//! A round gives up what its rays, random ones of the photographs, find to be worth least:
//! - components of tensors, density's and appearance's, wherever they are: how far pictures change, to first order, when a
//!   component is taken away, for each parameter that this saves. So every tensor has ranks of its own;
//! - resolution of a whole scale, where pictures then lose less than by giving up as many parameters as components.

use rayon::prelude::*;

use super::{BATCHES, RAYS, ResizeStep, Resized, Resizing, Tuning, Worth, resample};
use crate::dataset::View;
use crate::field::Field;
use crate::model::{Factors, Scene};
use crate::random::Random;
use crate::train::{Backward, RayBatch, RaySampler, TrainError};

/// The share of its parameters that a scene keeps in a round.
const KEPT: f64 = 0.75;
/// Where a round costs more than may be lost, the next tries to give up the half; less than this share is left alone.
const MIN_GIVEN: f64 = 0.05;
/// The share of its cells along an axis that a scale keeps where it gives up resolution.
const CELLS_KEPT: f64 = 0.85;
/// The least cells along an axis that are left.
const FEWEST_CELLS: u32 = 2;

/// How far a scene is to be shrunk.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ShrinkGoal {
    /// To at most so many parameters.
    Parameters(u64),
    /// As far as the photographs' rays lose at most so many dB.
    Loss(f64),
}

/// Shrinks `scene`, which was trained on `views`. `stepped` hears of every training step, and ends everything by an error. The
/// same arguments always give the same result, on any number of threads. A scene that is small enough already stays as it is.
///
/// # Errors
///
/// Where no ray meets the scene, training diverges, or `stepped` says so.
pub fn shrink<E: From<TrainError>>(
    scene: Scene,
    views: &[View],
    goal: ShrinkGoal,
    tuning: &Tuning,
    stepped: &mut dyn FnMut(&ResizeStep) -> Result<(), E>,
) -> Result<Resized, E> {
    let mut resizing = Resizing::begin(&scene, views, tuning, stepped)?;
    let mut good = scene;
    let mut kept = KEPT;
    loop {
        let held = good.nonzero_parameter_count();
        let fewer = (kept * held as f64) as u64;
        let most = match goal {
            ShrinkGoal::Parameters(most) if held <= most => break,
            ShrinkGoal::Parameters(most) => most.max(fewer),
            ShrinkGoal::Loss(_) => fewer,
        };
        let choosing = resizing.choosing(&good);
        let smaller = smaller(&good, resizing.photographs(), &choosing, most, &resizing.random());
        if smaller.nonzero_parameter_count() >= held {
            // Nothing but shared weights is left.
            break;
        }
        let tuned = resizing.round(smaller, 0)?;
        let before = resizing.psnr;
        let Some(round) = resizing.rounds.last_mut() else { break };
        if matches!(goal, ShrinkGoal::Loss(most) if is_too_much(before - round.psnr, most)) {
            round.is_taken = false;
            kept = 1.0 - 0.5 * (1.0 - kept);
            if 1.0 - kept < MIN_GIVEN {
                break;
            }
        } else {
            good = tuned;
        }
    }
    resizing.finish(good)
}

/// Whether `lost` dB are more than `most`. What is not a number is.
fn is_too_much(lost: f64, most: f64) -> bool {
    lost.is_nan() || lost > most
}

/// `scene` with at most `most` parameters, or nothing but those that all tensors share; `choosing`'s rays choose.
fn smaller(scene: &Scene, photographs: &RaySampler<'_>, choosing: &RayBatch, most: u64, random: &Random) -> Scene {
    let worth = worth(scene, &Field::new(scene), photographs, random);
    let mut best: Option<(f64, Scene)> = None;
    for coarser in (0..scene.scales.len()).map(Some).chain([None]) {
        let mut candidate = scene.clone();
        if coarser.is_some_and(|s| !make_coarser(&mut candidate, s)) {
            continue;
        }
        worth.least(&candidate, most).clear(&mut candidate);
        let psnr = choosing.psnr(&Field::new(&candidate));
        if best.as_ref().is_none_or(|(other, _)| psnr >= *other) {
            best = Some((psnr, candidate));
        }
    }
    best.expect("one candidate keeps all resolutions").1
}

/// Lowers the resolution of scale `s`; false where it is as low as it may be. The march's step stays.
fn make_coarser(scene: &mut Scene, s: usize) -> bool {
    let from = scene.scales[s].cloud.resolution;
    let fewer = |d: u32| ((CELLS_KEPT * f64::from(d)).round() as u32).clamp(FEWEST_CELLS.min(d), d);
    let to = from.map(fewer);
    resample(&mut scene.scales[s], to);
    to != from
}

/// By how much pictures' mean squared error would rise if a component of `scene` were taken away, to first order of the
/// pictures.
fn worth(scene: &Scene, field: &Field<f32>, photographs: &RaySampler<'_>, random: &Random) -> Worth {
    let mut backward = Backward::new(field);
    let mut worth = Worth::nothing(scene);
    let count = photographs.kept_count().min(RAYS);
    for n in 0..BATCHES {
        let batch = RayBatch::draw(photographs, field, &random.substream(0), n * count as u64, count);
        let gradients = backward.picture_gradients(field, &batch.rays, &random.substream(1).substream(n));
        for (s, (scale, [density, appearance])) in scene.scales.iter().zip(&mut worth.scales).enumerate() {
            let (factors, resolution) = (&scale.factors, scale.cloud.resolution);
            let parts = [
                (density, &factors.density, &gradients.density[s], factors.density_rank),
                (appearance, &factors.appearance, &gradients.appearance[s], factors.appearance_rank),
            ];
            for (worth, values, gradients, rank) in parts {
                let rank = rank as usize;
                let len = Factors::rows(resolution) * rank;
                // A component is linear in each of its three vectors, so that any of them tells.
                let of_axis = Factors::axis_ranges(resolution)[0].clone();
                (worth.par_chunks_mut(rank)).zip(values.par_chunks(len).zip(gradients.par_chunks(len))).for_each(
                    |(worth, (values, gradients))| {
                        for (c, worth) in worth.iter_mut().enumerate() {
                            let along = of_axis.clone().map(|row| row * rank + c);
                            let change: f64 = along.map(|at| f64::from(values[at]) * f64::from(gradients[at])).sum();
                            *worth += change * change / BATCHES as f64;
                        }
                    },
                );
            }
        }
    }
    worth
}
