//! Shrinking: each round removes a quarter of the remaining parameters.
//!
//! A round removes the least important parameters, estimated on random rays of the photographs:
//! - components of tensors, of density and of appearance, wherever they are. Each is ranked by its importance per
//!   parameter, so every tensor gets ranks of its own;
//! - the resolution of a whole scale, if this costs the pictures less than removing as many parameters in components.

use super::{ResizeStep, Resized, Resizing, Tuning, resample};
use crate::dataset::View;
use crate::field::Field;
use crate::model::Scene;
use crate::random::Random;
use crate::train::importance::ComponentImportance;
use crate::train::{RayBatch, RaySampler, TrainError};

/// Share of its parameters that a scene keeps in a round.
const KEPT_SHARE: f64 = 0.75;
/// After a round that loses too much, the next one removes half the share. Shrinking ends if it is less than this.
const MIN_REMOVED_SHARE: f64 = 0.05;
/// Share of its cells along an axis that a scale keeps if its resolution is reduced.
const CELLS_KEPT: f64 = 0.85;
/// The least number of cells along an axis.
const MIN_CELLS: u32 = 2;

/// The size that a scene is shrunk to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ShrinkGoal {
    /// At most this many parameters.
    Parameters(u64),
    /// As few parameters as lose at most this PSNR on rays of the photographs, in dB.
    Loss(f64),
}

/// Shrinks `scene`, which was trained on `views`. `on_step` is called after each training step; an error that it
/// returns ends the run. The same arguments always give the same result, on any number of threads. A scene that meets
/// the goal stays as it is, and so does a scene if every round loses too much ([`Resized::is_resized`]).
///
/// # Errors
///
/// If no ray passes through the scene, training diverges, or `on_step` returns an error.
pub fn shrink<E: From<TrainError>>(
    scene: Scene,
    views: &[View],
    goal: ShrinkGoal,
    tuning: &Tuning,
    on_step: &mut dyn FnMut(&ResizeStep) -> Result<(), E>,
) -> Result<Resized, E> {
    let mut resizing = Resizing::begin(&scene, views, tuning, on_step)?;
    let mut good = scene;
    let mut kept = KEPT_SHARE;
    loop {
        let parameters = good.nonzero_parameter_count();
        let fewer = (kept * parameters as f64) as u64;
        let most = match goal {
            ShrinkGoal::Parameters(most) if parameters <= most => break,
            ShrinkGoal::Parameters(most) => most.max(fewer),
            ShrinkGoal::Loss(_) => fewer,
        };
        let selection = resizing.selection_rays(&good);
        let smaller = smaller(&good, resizing.sampler(), &selection, most, &resizing.random());
        if smaller.nonzero_parameter_count() >= parameters {
            // Only shared weights are left.
            break;
        }
        let tuned = resizing.round(smaller, 0)?;
        let before = resizing.psnr;
        let Some(round) = resizing.rounds.last_mut() else { break };
        if matches!(goal, ShrinkGoal::Loss(most) if is_too_much(before - round.psnr, most)) {
            round.is_taken = false;
            kept = 1.0 - 0.5 * (1.0 - kept);
            if 1.0 - kept < MIN_REMOVED_SHARE {
                break;
            }
        } else {
            good = tuned;
        }
    }
    resizing.finish(good)
}

/// True if `lost` dB are more than `most`, or not a number.
fn is_too_much(lost: f64, most: f64) -> bool {
    lost.is_nan() || lost > most
}

/// `scene` with at most `most` parameters, or with the shared weights alone. The rays of `selection` choose the scale
/// whose resolution is reduced, if any.
fn smaller(scene: &Scene, sampler: &RaySampler<'_>, selection: &RayBatch, most: u64, random: &Random) -> Scene {
    let importance = ComponentImportance::of_removal(scene, &Field::new(scene), sampler, random);
    let mut best: Option<(f64, Scene)> = None;
    for coarser in (0..scene.scales.len()).map(Some).chain([None]) {
        let mut candidate = scene.clone();
        if coarser.is_some_and(|s| !make_coarser(&mut candidate, s)) {
            continue;
        }
        importance.least_important(&candidate, most).apply(&mut candidate);
        let psnr = selection.psnr(&Field::new(&candidate));
        if best.as_ref().is_none_or(|(other, _)| psnr >= *other) {
            best = Some((psnr, candidate));
        }
    }
    best.expect("one candidate keeps all resolutions").1
}

/// Lowers the resolution of scale `s`. Returns `false` if it is as low as possible. The march's step stays.
fn make_coarser(scene: &mut Scene, s: usize) -> bool {
    let from = scene.scales[s].cloud.resolution;
    let fewer = |d: u32| ((CELLS_KEPT * f64::from(d)).round() as u32).clamp(MIN_CELLS.min(d), d);
    let to = from.map(fewer);
    resample(&mut scene.scales[s], to);
    to != from
}
