//! After training: fewer parameters, or more, where pictures say so.
//!
//! In: a trained scene and its photographs. Out: the same scene with another number of parameters, which are those that a file
//! holds ([`Scene::nonzero_parameter_count`]). It changes in rounds, and short training after each round lets all others adapt.

mod grow;
mod ranks;
mod shrink;

use serde::Serialize;

pub use grow::grow;
pub use shrink::{ShrinkGoal, shrink};

use super::component_mask::ComponentMask;
use super::{
    RayBatch, RaySampler, ScaleConfig, StepReport, TrainConfig, TrainError, Trainer, prune_dead_components, upsample,
};
use crate::dataset::View;
use crate::field::Field;
use crate::model::{Factors, Scale, Scene};
use crate::random::Random;

/// Learning rates begin at this share of training's own: about where those of a preset end.
const RATE: f64 = 0.25;
/// The last training is this many times as long as those between rounds.
const LAST_LENGTH: u64 = 2;
/// Where there are several ways to go on, each is tried for this part of a round's training.
const TRIALS_SHARE: u64 = 4;
/// Batches of rays that say what components are worth, and the rays of each.
const BATCHES: u64 = 24;
const RAYS: usize = 8192;
/// Rays that choose among scenes, at most.
const CHOOSING: usize = 1 << 15;
/// Rays that measure what everything cost, at most; other ones than those that decide.
const MEASURED: usize = 1 << 16;

/// How a scene is trained while it changes.
#[derive(Clone, Debug)]
pub struct Tuning {
    /// Steps of training after each round; the last one has twice as many.
    pub steps: u64,
    /// Of the run that made the scene: batches, learning rates, regularization. Its schedule and scales are not used.
    pub config: TrainConfig,
}

/// Where resizing is.
#[derive(Clone, Debug)]
pub struct ResizeStep {
    /// Number of the round.
    pub round: usize,
    /// Steps of its training that are done, and all, with those of choosing what the round is.
    pub steps: [u64; 2],
    /// The last one.
    pub report: StepReport,
}

/// What a round came to.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ResizeRound {
    /// Parameters that there are then.
    pub parameters: u64,
    /// \[scale\] cells of a tensor.
    pub resolutions: Vec<[u32; 3]>,
    /// dB on rays of the photographs before training goes on.
    pub psnr_at_once: f64,
    /// dB on the same rays after it.
    pub psnr: f64,
    /// Whether it was taken; not where it cost too much.
    pub is_taken: bool,
}

/// A scene of another size.
#[derive(Clone, Debug)]
pub struct Resized {
    /// The scene.
    pub scene: Scene,
    /// Parameters that it had, and has.
    pub parameters: [u64; 2],
    /// dB on rays of the photographs, before and after.
    pub psnr: [f64; 2],
    /// What happened between.
    pub rounds: Vec<ResizeRound>,
}

/// Hears of every training step, and ends everything by an error.
type Stepped<'s, E> = &'s mut dyn FnMut(&ResizeStep) -> Result<(), E>;

/// A scene that is being resized.
struct Resizing<'v, 's, E> {
    trainer: Trainer<'v>,
    seed: u64,
    steps: u64,
    measured: RayBatch,
    /// Of the scene as it came.
    parameters: u64,
    psnr: f64,
    steps_before: u64,
    rounds: Vec<ResizeRound>,
    stepped: Stepped<'s, E>,
}

impl<'v, 's, E: From<TrainError>> Resizing<'v, 's, E> {
    fn begin(scene: &Scene, views: &'v [View], tuning: &Tuning, stepped: Stepped<'s, E>) -> Result<Self, E> {
        let Tuning { steps, config } = tuning;
        let trainer = Trainer::new(tuned(config, scene, *steps), scene.clone(), views)?;
        let field = Field::new(scene);
        let count = trainer.ray_count().min(MEASURED);
        let measured = RayBatch::draw(trainer.photographs(), &field, &Random::new(config.seed, "measured"), 0, count);
        Ok(Self {
            seed: config.seed,
            steps: *steps,
            parameters: scene.nonzero_parameter_count(),
            psnr: measured.psnr(&field),
            steps_before: scene.provenance.steps,
            rounds: Vec::new(),
            trainer,
            measured,
            stepped,
        })
    }

    fn photographs(&self) -> &RaySampler<'v> {
        self.trainer.photographs()
    }

    /// Of the next round: substreams 0 and 1 say what components are worth, 2 chooses among scenes, 3 is for new components.
    fn random(&self) -> Random {
        Random::new(self.seed, "resize").substream(self.rounds.len() as u64)
    }

    /// Rays that choose among scenes as large as `scene`.
    fn choosing(&self, scene: &Scene) -> RayBatch {
        let count = self.photographs().kept_count().min(CHOOSING);
        RayBatch::draw(self.photographs(), &Field::new(scene), &self.random().substream(2), 0, count)
    }

    fn psnr_of(&self, scene: &Scene) -> f64 {
        self.measured.psnr(&Field::new(scene))
    }

    /// Goes on with the one of `ways` that is most worth its parameters after a short training beside `scene`'s own, and books that as a
    /// round; with none where none is better than `scene` then.
    fn round_of_best(&mut self, scene: &Scene, mut ways: Vec<Scene>) -> Result<Option<Scene>, E> {
        if ways.is_empty() {
            return Ok(None);
        }
        let of_each = self.steps.div_ceil(TRIALS_SHARE);
        let trials = (1 + ways.len() as u64) * of_each;
        let choosing = self.choosing(scene);
        let mut psnrs = Vec::new();
        for way in std::iter::once(scene).chain(&ways) {
            let done = psnrs.len() as u64 * of_each;
            let trained = self.train(way.clone(), of_each, [done, trials + self.steps])?;
            psnrs.push(choosing.psnr(&Field::new(&trained)));
        }
        let held = scene.nonzero_parameter_count();
        let worth = |n: usize| (psnrs[n + 1] - psnrs[0]) / (ways[n].nonzero_parameter_count() - held) as f64;
        let best = (0..ways.len()).filter(|&n| worth(n) > 0.0).max_by(|&a, &b| worth(a).total_cmp(&worth(b)));
        best.map(|n| self.round(ways.swap_remove(n), trials)).transpose()
    }

    /// Goes on with `changed`, after so many steps of `trials`, and books that as a round.
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

    /// The `steps` after the first `done` of `all` that a round has.
    fn train(&mut self, scene: Scene, steps: u64, [done, all]: [u64; 2]) -> Result<Scene, E> {
        self.trainer.continue_from(scene, steps);
        for n in 1..=steps {
            let report = self.trainer.step()?;
            (self.stepped)(&ResizeStep { round: self.rounds.len(), steps: [done + n, all], report })?;
        }
        Ok(self.trainer.scene())
    }

    /// The last training of what the rounds led to, and what no tensor needs left out.
    fn finish(mut self, mut good: Scene) -> Result<Resized, E> {
        if self.rounds.iter().any(|r| r.is_taken) {
            let last = LAST_LENGTH * self.steps;
            let tuned = self.train(good.clone(), last, [0, last])?;
            if self.psnr_of(&tuned) >= self.psnr_of(&good) {
                good = tuned;
            }
            prune_dead_components(&mut good, self.photographs(), self.seed);
            ranks::drop_ranks(&mut good);
            let taken = self.rounds.iter().filter(|r| r.is_taken).count() as u64;
            good.provenance.steps = self.steps_before + (taken + LAST_LENGTH) * self.steps;
        }
        Ok(Resized {
            parameters: [self.parameters, good.nonzero_parameter_count()],
            psnr: [self.psnr, self.psnr_of(&good)],
            rounds: self.rounds,
            scene: good,
        })
    }
}

/// The settings under which `scene` goes on for `steps`, without any schedule.
fn tuned(config: &TrainConfig, scene: &Scene, steps: u64) -> TrainConfig {
    let of_scale = |s: &Scale| ScaleConfig {
        // Nothing is placed any more.
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
        factor_learning_rate: RATE * config.factor_learning_rate,
        network_learning_rate: RATE * config.network_learning_rate,
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

/// What components of tensors are worth.
struct Worth {
    /// \[scale\] density and appearance, \[tensor\]\[component\].
    scales: Vec<[Vec<f64>; 2]>,
}

impl Worth {
    /// Of all components of `scene` nothing yet.
    fn nothing(scene: &Scene) -> Self {
        let zeros = |s: &[Vec<bool>; 2]| s.each_ref().map(|c| vec![0.0; c.len()]);
        Self { scales: ComponentMask::nothing(scene).scales.iter().map(zeros).collect() }
    }

    /// All components of `scene` that it holds: what each is worth for each of the parameters it holds, how many these are, and
    /// where it is (scale, part, component of all tensors); what is worth least comes first.
    fn ranking(&self, scene: &Scene) -> Vec<(f64, u64, [usize; 3])> {
        let mut components = Vec::new();
        for (s, (scale, worth)) in scene.scales.iter().zip(&self.scales).enumerate() {
            let rows = Factors::rows(scale.cloud.resolution);
            let parts = [
                (&scale.factors.density, scale.factors.density_rank as usize),
                (&scale.factors.appearance, scale.factors.appearance_rank as usize),
            ];
            for (part, (values, rank)) in parts.into_iter().enumerate() {
                let held =
                    Factors::nonzero_components(values, rows, rank).into_iter().enumerate().filter(|(_, held)| *held);
                components.extend(held.map(|(n, _)| (worth[part][n] / rows as f64, rows as u64, [s, part, n])));
            }
        }
        components.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.2.cmp(&b.2)));
        components
    }

    /// The components of `scene` that are worth least for each parameter they hold, so many that `most` parameters are left.
    fn least(&self, scene: &Scene, most: u64) -> ComponentMask {
        let mut cleared = ComponentMask::nothing(scene);
        let mut held = scene.nonzero_parameter_count();
        for (_, parameters, [s, part, n]) in self.ranking(scene) {
            if held <= most {
                break;
            }
            cleared.scales[s][part][n] = true;
            held -= parameters;
        }
        cleared
    }
}
