//! Resizing after training: scenes with fewer parameters, or with more.
//!
//! In: a trained scene and its photographs. Out: the same scene with another number of parameters, counted without
//! components of zeros ([`Scene::nonzero_parameter_count`]). It changes in rounds, and a short training after each
//! round adapts the rest.

mod grow;
mod ranks;
mod shrink;

use serde::Serialize;

pub use grow::grow;
pub use shrink::{ShrinkGoal, shrink};

use super::{
    FinishConfig, LeanConfig, RayBatch, RaySampler, ScaleConfig, StepReport, TrainConfig, TrainError, Trainer,
    prune_dead_components, upsample,
};
use crate::dataset::View;
use crate::field::Field;
use crate::model::{Scale, Scene};
use crate::random::Random;

/// Learning rates of a round start at this share of the run's: about where those of a preset end.
const LEARNING_RATE_SHARE: f64 = 0.25;
/// The last training has this many times the steps of a round.
const LAST_TRAINING: u64 = 2;
/// Each candidate of a round is trained for the round's steps divided by this.
const TRIAL_DIVISOR: u64 = 4;
/// The most rays that choose among scenes.
const SELECTION_RAYS: usize = 1 << 15;
/// The most rays that measure the result; others than those that choose.
const EVAL_RAYS: usize = 1 << 16;

/// Training between the changes of a scene.
#[derive(Clone, Debug)]
pub struct Tuning {
    /// Steps of training after each round; the last training has twice as many.
    pub steps: u64,
    /// Settings of the run that made the scene. Its schedule and scales are not used.
    pub config: TrainConfig,
}

/// Progress of resizing.
#[derive(Clone, Debug)]
pub struct ResizeStep {
    /// Index of the round.
    pub round: usize,
    /// Steps of the round's training, with those of its candidates: done, and total.
    pub steps: [u64; 2],
    /// The last step.
    pub report: StepReport,
}

/// The result of a round.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ResizeRound {
    /// Parameters after the round.
    pub parameters: u64,
    /// \[scale\] cells of a tensor after the round.
    pub resolutions: Vec<[u32; 3]>,
    /// PSNR on rays of the photographs before the round's training, in dB.
    pub psnr_at_once: f64,
    /// PSNR on the same rays after it, in dB.
    pub psnr: f64,
    /// True if the round was kept. It is discarded if it loses too much.
    pub is_taken: bool,
}

/// The result of resizing.
#[derive(Clone, Debug)]
pub struct Resized {
    /// The scene.
    pub scene: Scene,
    /// Parameters before and after.
    pub parameters: [u64; 2],
    /// PSNR on rays of the photographs before and after, in dB.
    pub psnr: [f64; 2],
    /// All rounds, with the discarded ones.
    pub rounds: Vec<ResizeRound>,
}

impl Resized {
    /// True if any round was kept. If not, the scene is the given one.
    pub fn is_resized(&self) -> bool {
        self.rounds.iter().any(|round| round.is_taken)
    }
}

/// Called after each training step; an error that it returns ends the run.
type OnStep<'s, E> = &'s mut dyn FnMut(&ResizeStep) -> Result<(), E>;

/// A scene that is being resized.
struct Resizing<'v, 's, E> {
    trainer: Trainer<'v>,
    seed: u64,
    steps: u64,
    /// Rays that measure the result.
    evaluation: RayBatch,
    /// Parameters of the original scene.
    parameters: u64,
    /// PSNR of the original scene on `evaluation`, in dB.
    psnr: f64,
    steps_before: u64,
    rounds: Vec<ResizeRound>,
    on_step: OnStep<'s, E>,
}

impl<'v, 's, E: From<TrainError>> Resizing<'v, 's, E> {
    fn begin(scene: &Scene, views: &'v [View], tuning: &Tuning, on_step: OnStep<'s, E>) -> Result<Self, E> {
        let Tuning { steps, config } = tuning;
        let trainer = Trainer::new(tuned(config, scene, *steps), scene.clone(), views)?;
        let field = Field::new(scene);
        let count = trainer.ray_count().min(EVAL_RAYS);
        let evaluation = RayBatch::draw(trainer.sampler(), &field, &Random::new(config.seed, "measured"), 0, count);
        Ok(Self {
            seed: config.seed,
            steps: *steps,
            parameters: scene.nonzero_parameter_count(),
            psnr: evaluation.psnr(&field),
            steps_before: scene.provenance.steps,
            rounds: Vec::new(),
            trainer,
            evaluation,
            on_step,
        })
    }

    fn sampler(&self) -> &RaySampler<'v> {
        self.trainer.sampler()
    }

    /// The stream of the next round: substreams 0 and 1 are for the importance of components, 2 for the choice among
    /// scenes, 3 for new components.
    fn random(&self) -> Random {
        Random::new(self.seed, "resize").substream(self.rounds.len() as u64)
    }

    /// Rays that choose among scenes that replace `scene`.
    fn selection_rays(&self, scene: &Scene) -> RayBatch {
        let count = self.sampler().active_ray_count().min(SELECTION_RAYS);
        RayBatch::draw(self.sampler(), &Field::new(scene), &self.random().substream(2), 0, count)
    }

    fn psnr_of(&self, scene: &Scene) -> f64 {
        self.evaluation.psnr(&Field::new(scene))
    }

    /// Trains each of `candidates` briefly, and `scene` as well, and makes a round of the candidate with the highest
    /// gain of PSNR per parameter. Returns `None` if none gains anything.
    fn round_of_best(&mut self, scene: &Scene, mut candidates: Vec<Scene>) -> Result<Option<Scene>, E> {
        if candidates.is_empty() {
            return Ok(None);
        }
        let steps = self.steps.div_ceil(TRIAL_DIVISOR);
        let trials = (1 + candidates.len() as u64) * steps;
        let selection = self.selection_rays(scene);
        let mut psnrs = Vec::new();
        for candidate in std::iter::once(scene).chain(&candidates) {
            let done = psnrs.len() as u64 * steps;
            let trained = self.train(candidate.clone(), steps, [done, trials + self.steps])?;
            psnrs.push(selection.psnr(&Field::new(&trained)));
        }
        let parameters = scene.nonzero_parameter_count();
        let gain = |n: usize| (psnrs[n + 1] - psnrs[0]) / (candidates[n].nonzero_parameter_count() - parameters) as f64;
        let best = (0..candidates.len()).filter(|&n| gain(n) > 0.0).max_by(|&a, &b| gain(a).total_cmp(&gain(b)));
        best.map(|n| self.round(candidates.swap_remove(n), trials)).transpose()
    }

    /// Trains `changed` and records it as a round, which has had this many steps of `trials` before.
    fn round(&mut self, changed: Scene, trials: u64) -> Result<Scene, E> {
        let psnr_at_once = self.psnr_of(&changed);
        let tuned = self.train(changed, self.steps, [trials, trials + self.steps])?;
        self.rounds.push(ResizeRound {
            parameters: tuned.nonzero_parameter_count(),
            resolutions: tuned.scales.iter().map(|s| s.cloud.resolution).collect(),
            psnr_at_once,
            psnr: self.psnr_of(&tuned),
            is_taken: true,
        });
        Ok(tuned)
    }

    /// Trains `scene` for `steps`, after the first `done` of the round's `total` steps.
    fn train(&mut self, scene: Scene, steps: u64, [done, total]: [u64; 2]) -> Result<Scene, E> {
        self.trainer.continue_from(scene, steps);
        for n in 1..=steps {
            let report = self.trainer.step()?;
            (self.on_step)(&ResizeStep { round: self.rounds.len(), steps: [done + n, total], report })?;
        }
        Ok(self.trainer.scene())
    }

    /// Trains the last round's scene longer, and removes dead components and unused ranks.
    fn finish(mut self, mut good: Scene) -> Result<Resized, E> {
        if self.rounds.iter().any(|r| r.is_taken) {
            let steps = LAST_TRAINING * self.steps;
            let tuned = self.train(good.clone(), steps, [0, steps])?;
            if self.psnr_of(&tuned) >= self.psnr_of(&good) {
                good = tuned;
            }
            prune_dead_components(&mut good, self.sampler(), self.seed)?;
            ranks::drop_ranks(&mut good);
            let taken = self.rounds.iter().filter(|r| r.is_taken).count() as u64;
            good.provenance.steps = self.steps_before + (taken + LAST_TRAINING) * self.steps;
        }
        Ok(Resized {
            parameters: [self.parameters, good.nonzero_parameter_count()],
            psnr: [self.psnr, self.psnr_of(&good)],
            rounds: self.rounds,
            scene: good,
        })
    }
}

/// Settings to continue the training of `scene` for `steps`, without any schedule.
fn tuned(config: &TrainConfig, scene: &Scene, steps: u64) -> TrainConfig {
    let of_scale = |s: &Scale| ScaleConfig {
        // No tensor is placed.
        pitch: (2.0 * s.cloud.half_edge).to_array(),
        edge: (2.0 * s.cloud.half_edge).to_array(),
        resolutions: vec![s.cloud.resolution],
        density_rank: s.factors.density_rank,
        appearance_rank: s.factors.appearance_rank,
        top_k: s.top_k,
    };
    TrainConfig {
        steps,
        upsample_at: Vec::new(),
        occupancy_at: Vec::new(),
        lean: LeanConfig::off(),
        finish: FinishConfig::default(),
        factor_learning_rate: LEARNING_RATE_SHARE * config.factor_learning_rate,
        network_learning_rate: LEARNING_RATE_SHARE * config.network_learning_rate,
        sky_learning_rate: LEARNING_RATE_SHARE * config.sky_learning_rate,
        scales: scene.scales.iter().map(of_scale).collect(),
        ..config.clone()
    }
}

/// Gives the tensors of `scale` another resolution: their vectors are resampled.
fn resample(scale: &mut Scale, to: [u32; 3]) {
    let from = scale.cloud.resolution;
    let factors = &mut scale.factors;
    factors.density = upsample(&factors.density, factors.density_rank as usize, from, to);
    factors.appearance = upsample(&factors.appearance, factors.appearance_rank as usize, from, to);
    scale.cloud.resolution = to;
}
