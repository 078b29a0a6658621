//! After training: giving parameters back that pictures hardly need.
//!
//! In: a trained scene and its photographs. Out: the same scene with fewer parameters, which are those that a file holds
//! ([`Scene::held_parameter_count`]). Parameters go in rounds, a quarter of what is left in each, and short training after
//! each round lets the others take over what those did. A round gives up what its rays, random ones of the photographs, find
//! to be worth least:
//! - components of tensors, density's and appearance's, wherever they are: how far pictures change, to first order, when a
//!   component is taken away, for each parameter that this saves. So every tensor has ranks of its own;
//! - resolution of a whole scale, where pictures then lose less than by giving up as many parameters as components.
//!
//! At the end ranks that no tensor needs any more are left out of all.

use rayon::prelude::*;
use serde::Serialize;

use super::backward::Backward;
use super::cleared::Cleared;
use super::{Photographs, RayBatch, ScaleConfig, StepReport, TrainConfig, TrainError, Trainer, drop_unused, upsample};
use crate::dataset::View;
use crate::field::Field;
use crate::model::{Factors, Scene};
use crate::random::Random;

/// The share of its parameters that a scene keeps in a round.
const KEPT: f64 = 0.75;
/// Where a round costs more than may be lost, the next tries to give up the half; less than this share is left alone.
const LEAST_GIVEN: f64 = 0.05;
/// The share of its cells along an axis that a scale keeps where it gives up resolution.
const CELLS_KEPT: f64 = 0.85;
/// The least cells along an axis that are left.
const FEWEST_CELLS: u32 = 2;
/// Learning rates begin at this share of training's own: about where those of a preset end.
const RATE: f64 = 0.25;
/// The last training is this many times as long as those between rounds.
const LAST_LENGTH: u64 = 2;
/// Batches of rays that say what components are worth, and the rays of each.
const BATCHES: u64 = 24;
const RAYS: usize = 8192;
/// Rays that choose among resolutions, and others that measure what everything cost, at most.
const CHOOSING: usize = 1 << 15;
const MEASURED: usize = 1 << 16;

/// How far a scene is to be shrunk.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ShrinkGoal {
    /// To at most so many parameters.
    Parameters(u64),
    /// As far as the photographs' rays lose at most so many dB.
    Loss(f64),
}

/// How a scene is to be shrunk.
#[derive(Clone, Debug)]
pub struct Shrink {
    /// How far.
    pub goal: ShrinkGoal,
    /// Steps of training after each round; the last one has twice as many.
    pub steps: u64,
    /// Of the run that made the scene: batches, learning rates, regularisation. Its schedule and scales are not used.
    pub config: TrainConfig,
}

/// Where shrinking is.
#[derive(Clone, Debug)]
pub struct ShrinkStep {
    /// Number of the round.
    pub round: usize,
    /// Steps of its training that are done, and all.
    pub steps: [u64; 2],
    /// The last one.
    pub report: StepReport,
}

/// What a round came to.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ShrinkRound {
    /// Parameters that are left.
    pub parameters: u64,
    /// \[scale\] cells of a tensor.
    pub resolutions: Vec<[u32; 3]>,
    /// dB on rays of the photographs before training goes on.
    pub psnr_cleared: f64,
    /// dB on the same rays after it.
    pub psnr: f64,
    /// Whether it was taken; not where it cost too much.
    pub is_taken: bool,
}

/// A scene that has shrunk.
#[derive(Clone, Debug)]
pub struct Shrunk {
    /// The scene.
    pub scene: Scene,
    /// Parameters that it had, and has.
    pub parameters: [u64; 2],
    /// dB on rays of the photographs, before and after.
    pub psnr: [f64; 2],
    /// What happened between.
    pub rounds: Vec<ShrinkRound>,
}

/// Shrinks `scene`, which was trained on `views`. `stepped` hears of every training step, and ends everything by an error. The same arguments always give the same result, on any number of threads. A scene that is
/// small enough already stays as it is.
///
/// # Errors
///
/// Where no ray meets the scene, training diverges, or `stepped` says so.
pub fn shrink<E: From<TrainError>>(
    scene: Scene,
    views: &[View],
    how: &Shrink,
    stepped: &mut dyn FnMut(&ShrinkStep) -> Result<(), E>,
) -> Result<Shrunk, E> {
    let config = tuning(&how.config, &scene, how.steps);
    let mut trainer = Trainer::new(config, scene.clone(), views)?;
    let order = Random::new(how.config.seed, "shrink");
    let measured = {
        let field = Field::new(&scene);
        let count = trainer.ray_count().min(MEASURED);
        RayBatch::draw(trainer.photographs(), &field, &order.substream(0), 0, count)
    };
    let psnr_of = |scene: &Scene| measured.psnr(&Field::new(scene));
    let (parameters_before, psnr_before) = (scene.held_parameter_count(), psnr_of(&scene));
    let steps_before = scene.provenance.steps;
    let mut good = scene;
    let mut rounds: Vec<ShrinkRound> = Vec::new();
    let mut kept = KEPT;
    loop {
        let held = good.held_parameter_count();
        let fewer = (kept * held as f64) as u64;
        let most = match how.goal {
            ShrinkGoal::Parameters(most) if held <= most => break,
            ShrinkGoal::Parameters(most) => most.max(fewer),
            ShrinkGoal::Loss(_) => fewer,
        };
        let of_round = order.substream(1 + rounds.len() as u64);
        let smaller = smaller(&good, trainer.photographs(), most, &of_round);
        if smaller.held_parameter_count() >= held {
            // Nothing but shared weights is left.
            break;
        }
        let psnr_cleared = psnr_of(&smaller);
        trainer.continue_from(smaller, how.steps);
        let tuned = train(&mut trainer, how.steps, rounds.len(), stepped)?;
        let mut round = ShrinkRound {
            parameters: tuned.held_parameter_count(),
            resolutions: tuned.scales.iter().map(|s| s.cloud.resolution).collect(),
            psnr_cleared,
            psnr: psnr_of(&tuned),
            is_taken: true,
        };
        if matches!(how.goal, ShrinkGoal::Loss(most) if is_too_much(psnr_before - round.psnr, most)) {
            round.is_taken = false;
            rounds.push(round);
            kept = 1.0 - 0.5 * (1.0 - kept);
            if 1.0 - kept < LEAST_GIVEN {
                break;
            }
            continue;
        }
        rounds.push(round);
        good = tuned;
    }
    if rounds.iter().any(|r| r.is_taken) {
        trainer.continue_from(good.clone(), LAST_LENGTH * how.steps);
        let tuned = train(&mut trainer, LAST_LENGTH * how.steps, rounds.len(), stepped)?;
        if psnr_of(&tuned) >= psnr_of(&good) {
            good = tuned;
        }
        drop_unused(&mut good, trainer.photographs(), how.config.seed);
        drop_ranks(&mut good);
        good.provenance.steps = steps_before + trainer.steps_done();
    }
    let (parameters_after, psnr_after) = (good.held_parameter_count(), psnr_of(&good));
    Ok(Shrunk {
        scene: good,
        parameters: [parameters_before, parameters_after],
        psnr: [psnr_before, psnr_after],
        rounds,
    })
}

/// Whether `lost` dB are more than `most`. What is not a number is.
fn is_too_much(lost: f64, most: f64) -> bool {
    lost.is_nan() || lost > most
}

/// The settings under which `scene` goes on for `steps`, without any schedule.
fn tuning(config: &TrainConfig, scene: &Scene, steps: u64) -> TrainConfig {
    let of_scale = |s: &crate::model::Scale| ScaleConfig {
        // Nothing is placed any more.
        pitch: (2.0 * s.cloud.half).to_array(),
        edge: (2.0 * s.cloud.half).to_array(),
        resolutions: vec![s.cloud.resolution],
        density_rank: s.factors.density_rank,
        appearance_rank: s.factors.appearance_rank,
        top_k: s.top_k,
    };
    TrainConfig {
        steps,
        upsample_at: Vec::new(),
        occupancy_at: Vec::new(),
        factor_learning_rate: RATE * config.factor_learning_rate,
        network_learning_rate: RATE * config.network_learning_rate,
        scales: scene.scales.iter().map(of_scale).collect(),
        ..config.clone()
    }
}

fn train<E: From<TrainError>>(
    trainer: &mut Trainer<'_>,
    steps: u64,
    round: usize,
    stepped: &mut dyn FnMut(&ShrinkStep) -> Result<(), E>,
) -> Result<Scene, E> {
    for n in 1..=steps {
        stepped(&ShrinkStep { round, steps: [n, steps], report: trainer.step()? })?;
    }
    Ok(trainer.scene())
}

/// `scene` with at most `most` parameters, or nothing but those that all tensors share.
fn smaller(scene: &Scene, photographs: &Photographs<'_>, most: u64, random: &Random) -> Scene {
    let field = Field::new(scene);
    let worth = Worth::measure(scene, &field, photographs, random);
    let choosing = RayBatch::draw(photographs, &field, &random.substream(2), 0, photographs.kept_count().min(CHOOSING));
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
    let scale = &mut scene.scales[s];
    let from = scale.cloud.resolution;
    let fewer = |d: u32| ((CELLS_KEPT * f64::from(d)).round() as u32).clamp(FEWEST_CELLS.min(d), d);
    let to = from.map(fewer);
    let factors = &mut scale.factors;
    factors.density = upsample(&factors.density, factors.density_rank as usize, from, to);
    factors.appearance = upsample(&factors.appearance, factors.appearance_rank as usize, from, to);
    scale.cloud.resolution = to;
    to != from
}

/// What components are worth.
struct Worth {
    /// \[scale\] density and appearance, \[tensor\]\[component\]: by how much pictures' mean squared error would rise if the
    /// component were taken away, to first order of the pictures.
    scales: Vec<[Vec<f64>; 2]>,
}

impl Worth {
    fn measure(scene: &Scene, field: &Field<f32>, photographs: &Photographs<'_>, random: &Random) -> Self {
        let mut backward = Backward::new(field);
        let mut worth = Self {
            scales: Cleared::nothing(scene).scales.iter().map(|s| s.each_ref().map(|c| vec![0.0; c.len()])).collect(),
        };
        let count = photographs.kept_count().min(RAYS);
        for n in 0..BATCHES {
            let batch = RayBatch::draw(photographs, field, &random.substream(0), n * count as u64, count);
            let gradients = backward.picture_gradients(field, &batch.rays, &random.substream(1).substream(n));
            for (s, (scale, worth)) in scene.scales.iter().zip(&mut worth.scales).enumerate() {
                let rows = Factors::rows(scale.cloud.resolution);
                // A component is linear in each of its three vectors, so that any of them tells.
                let of_axis = Factors::axis_ranges(scale.cloud.resolution)[0].clone();
                let [density, appearance] = worth;
                for (worth, values, gradients, rank) in [
                    (density, &scale.factors.density, &gradients.density[s], scale.factors.density_rank as usize),
                    (
                        appearance,
                        &scale.factors.appearance,
                        &gradients.appearance[s],
                        scale.factors.appearance_rank as usize,
                    ),
                ] {
                    let len = rows * rank;
                    (worth.par_chunks_mut(rank)).zip(values.par_chunks(len).zip(gradients.par_chunks(len))).for_each(
                        |(worth, (values, gradients))| {
                            for (c, worth) in worth.iter_mut().enumerate() {
                                let along = of_axis.clone().map(|row| row * rank + c);
                                let change: f64 =
                                    along.map(|at| f64::from(values[at]) * f64::from(gradients[at])).sum();
                                *worth += change * change / BATCHES as f64;
                            }
                        },
                    );
                }
            }
        }
        worth
    }

    /// The components of `scene` that are worth least for each parameter they hold, so many that `most` parameters are left.
    fn least(&self, scene: &Scene, most: u64) -> Cleared {
        let mut cleared = Cleared::nothing(scene);
        // Worth of a parameter, parameters, and where.
        let mut components: Vec<(f64, u64, [usize; 3])> = Vec::new();
        for (s, (scale, worth)) in scene.scales.iter().zip(&self.scales).enumerate() {
            let rows = Factors::rows(scale.cloud.resolution);
            let parts = [
                (&scale.factors.density, scale.factors.density_rank as usize),
                (&scale.factors.appearance, scale.factors.appearance_rank as usize),
            ];
            for (part, (values, rank)) in parts.into_iter().enumerate() {
                for (n, is_held) in Factors::held(values, rows, rank).into_iter().enumerate() {
                    if is_held {
                        components.push((worth[part][n] / rows as f64, rows as u64, [s, part, n]));
                    }
                }
            }
        }
        components.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.2.cmp(&b.2)));
        let mut held = scene.held_parameter_count();
        for (_, parameters, [s, part, n]) in components {
            if held <= most {
                break;
            }
            cleared.scales[s][part][n] = true;
            held -= parameters;
        }
        cleared
    }
}

/// Leaves out of all tensors of a scale what none needs: density components, which may stand in any order, beyond the most
/// that a tensor has; appearance components, whose places the appearance matrix knows, that no tensor has. Pictures stay the
/// same but for the order of sums.
fn drop_ranks(scene: &mut Scene) {
    for scale in &mut scene.scales {
        let rows = Factors::rows(scale.cloud.resolution);
        let factors = &mut scale.factors;
        let rank = factors.density_rank as usize;
        let held = Factors::held(&factors.density, rows, rank);
        let kept: Vec<Vec<usize>> =
            held.chunks_exact(rank).map(|held| (0..rank).filter(|&c| held[c]).collect()).collect();
        let most = kept.iter().map(Vec::len).max().unwrap_or(0).max(1);
        factors.density = with_components(&factors.density, rows, rank, most, |n| &kept[n]);
        factors.density_rank = most as u32;

        let rank = factors.appearance_rank as usize;
        let held = Factors::held(&factors.appearance, rows, rank);
        let mut kept: Vec<usize> = (0..rank).filter(|&c| held.iter().skip(c).step_by(rank).any(|&h| h)).collect();
        if kept.is_empty() {
            kept.push(0);
        }
        factors.appearance = with_components(&factors.appearance, rows, rank, kept.len(), |_| &kept);
        factors.appearance_rank = kept.len() as u32;
        let matrix = &mut scale.appearance_matrix;
        matrix.weights = matrix.weights.chunks_exact(rank).flat_map(|row| kept.iter().map(|&c| row[c])).collect();
        matrix.rank = kept.len() as u32;
    }
}

/// `values` of `rank` components with the components `kept`\[tensor\] first and zeros after them, `new_rank` in all.
fn with_components<'k>(
    values: &[f32],
    rows: usize,
    rank: usize,
    new_rank: usize,
    kept: impl Fn(usize) -> &'k Vec<usize>,
) -> Vec<f32> {
    let mut changed = Vec::with_capacity(values.len() / rank * new_rank);
    for (n, tensor) in values.chunks_exact(rows * rank).enumerate() {
        for row in tensor.chunks_exact(rank) {
            let end = changed.len() + new_rank;
            changed.extend(kept(n).iter().map(|&c| row[c]));
            changed.resize(end, 0.0);
        }
    }
    changed
}
