//! Growing: more parameters where they reduce the error of pictures most.
//!
//! A round makes one of these changes. None of them changes the field at once, except that the march's step gets
//! shorter with the cells of the coarsest scale. A short training of each finds the change that reduces the error most
//! per parameter:
//! - more components, for a third more parameters. Every tensor gets a few new ones, with two random vectors and one of
//!   zeros. Those are kept that have the steepest descent of the photographs' error along the third vector, per
//!   parameter;
//! - twice the resolution of a scale, or of all scales.
//!
//! Growing ends if the bound leaves no room, or if no change reduces the error.

use std::collections::HashMap;
use std::ops::Range;

use rayon::prelude::*;
use safetensors::SafeTensors;
use safetensors::tensor::{Dtype, TensorView};
use serde::{Deserialize, Serialize};

use super::ranks::{drop_ranks, set_components};
use super::{Tuning, compacted, tuned};
use crate::dataset::View;
use crate::field::Field;
use crate::model::{Scale, Scene};
use crate::random::Random;
use crate::train::checkpoint::malformed;
use crate::train::importance::ComponentImportance;
use crate::train::{
    CheckpointError, RayBatch, RaySampler, StepReport, TrainConfig, TrainError, Trainer, march_step, upsample,
};

/// Ratio of the parameters after a round of components to those before.
const GROWTH: f64 = 4.0 / 3.0;
/// Number of new density components, and of new appearance components, that every tensor gets before the selection.
const NEW_COMPONENTS: usize = 4;
/// The most cells along an axis.
const MAX_CELLS: u32 = 1024;
/// Standard deviation of the entries of new vectors: about that of trained ones.
const DEVIATION: f64 = 0.3;
/// The last training has this many times the steps of a round.
const LAST_TRAINING: u64 = 2;
/// Each candidate of a round is trained for the round's steps divided by this.
const TRIAL_DIVISOR: u64 = 4;
/// The most rays that choose among scenes.
const SELECTION_RAYS: usize = 1 << 15;

/// Progress of growing.
#[derive(Clone, Debug)]
pub struct GrowStep {
    /// Index of the round.
    pub round: usize,
    /// Steps of the round's training, with those of its candidates: done, and total.
    pub steps: [u64; 2],
    /// The last step.
    pub report: StepReport,
}

/// The result of a round.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct GrowRound {
    /// Parameters after the round.
    pub parameters: u64,
    /// \[scale\] cells of a tensor after the round.
    pub resolutions: Vec<[u32; 3]>,
    /// PSNR on rays of the photographs before the round's training, in dB.
    pub psnr_at_once: f64,
    /// PSNR on the same rays after it, in dB.
    pub psnr: f64,
}

/// Called after each training step; an error that it returns ends the run.
type OnStep<'s, E> = &'s mut dyn FnMut(&GrowStep) -> Result<(), E>;

/// A scene that is growing.
#[derive(Debug)]
pub struct Growing<'v> {
    trainer: Trainer<'v>,
    config: TrainConfig,
    /// Steps of a round.
    steps: u64,
    max_parameters: u64,
    /// Parameters and PSNR of the original scene, and its steps.
    parameters: u64,
    psnr: f64,
    steps_before: u64,
    rounds: Vec<GrowRound>,
    scene: Scene,
}

/// The state of growing with which, and with the original and the current scene, it resumes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct GrowState {
    /// Settings of the run that made the scene.
    pub config: TrainConfig,
    /// Steps of a round.
    pub steps: u64,
    /// The most parameters.
    pub max_parameters: u64,
    parameters: u64,
    psnr: f64,
    rounds: Vec<GrowRound>,
    /// Steps of all trainings, and the exposures of the photographs as numbers.
    trained: u64,
    exposures: Vec<f64>,
}

impl<'v> Growing<'v> {
    /// Begins to grow `scene`, which was trained on `views`, to at most `max_parameters`. The same arguments always give the
    /// same result, on any number of threads.
    ///
    /// # Errors
    ///
    /// If no ray passes through the scene.
    pub fn begin(scene: Scene, views: &'v [View], max_parameters: u64, tuning: Tuning) -> Result<Self, TrainError> {
        let Tuning { steps, mut config } = tuning;
        // Trainings this short do not move cameras.
        config.refine_poses = false;
        let trainer = Trainer::new(tuned(&config, &scene, steps), scene.clone(), views)?;
        Ok(Self {
            steps,
            max_parameters,
            parameters: scene.nonzero_parameter_count(),
            psnr: trainer.psnr(),
            steps_before: scene.provenance.steps,
            rounds: Vec::new(),
            trainer,
            config,
            scene,
        })
    }

    /// Continues growing, which began with the same scene and photographs as this, from `state` and its `scene`.
    ///
    /// # Errors
    ///
    /// If it did not.
    pub fn resume(mut self, state: GrowState, scene: Scene) -> Result<Self, CheckpointError> {
        let of = |parameters, psnr: f64| format!("{parameters} parameters, {psnr} dB on the photographs");
        let [expected, found] = [of(state.parameters, state.psnr), of(self.parameters, self.psnr)];
        if expected != found {
            return Err(malformed("the scene that grows", expected, found));
        }
        self.trainer.set_past(state.trained, &state.exposures)?;
        (self.rounds, self.scene) = (state.rounds, scene);
        Ok(self)
    }

    /// The current scene.
    pub fn scene(&self) -> &Scene {
        &self.scene
    }

    /// All rounds.
    pub fn rounds(&self) -> &[GrowRound] {
        &self.rounds
    }

    /// PSNR of `scene` on rays of the photographs, in dB: the same rays on every call.
    pub fn psnr_of(&self, scene: &Scene) -> f64 {
        self.trainer.psnr_of(scene)
    }

    /// The state after the last round.
    pub fn state(&self) -> GrowState {
        GrowState {
            config: self.config.clone(),
            steps: self.steps,
            max_parameters: self.max_parameters,
            parameters: self.parameters,
            psnr: self.psnr,
            rounds: self.rounds.clone(),
            trained: self.trainer.steps_done(),
            exposures: self.trainer.checkpoint().exposures.to_numbers(),
        }
    }

    /// One round: trains each larger scene briefly, and the current one as well, then the one with the highest gain of PSNR
    /// per parameter longer. Returns `false` if none fits or gains anything. `on_step` is called after each training
    /// step; an error that it returns ends the run.
    ///
    /// # Errors
    ///
    /// If training diverges, or `on_step` returns an error.
    pub fn round<E: From<TrainError>>(&mut self, on_step: OnStep<'_, E>) -> Result<bool, E> {
        let mut candidates = self.candidates();
        if candidates.is_empty() {
            return Ok(false);
        }
        let steps = self.steps.div_ceil(TRIAL_DIVISOR);
        let trials = (1 + candidates.len() as u64) * steps;
        let selection = self.selection_rays();
        let mut psnrs = Vec::new();
        for candidate in std::iter::once(self.scene.clone()).chain(candidates.iter().cloned()) {
            let done = psnrs.len() as u64 * steps;
            let trained = self.train(candidate, steps, [done, trials + self.steps], on_step)?;
            psnrs.push(selection.psnr(&Field::new(&trained)));
        }
        let parameters = self.scene.nonzero_parameter_count();
        let gain = |n: usize| (psnrs[n + 1] - psnrs[0]) / (candidates[n].nonzero_parameter_count() - parameters) as f64;
        let best = (0..candidates.len()).filter(|&n| gain(n) > 0.0).max_by(|&a, &b| gain(a).total_cmp(&gain(b)));
        let Some(best) = best else { return Ok(false) };
        let larger = candidates.swap_remove(best);
        let psnr_at_once = self.trainer.psnr_of(&larger);
        self.scene = self.train(larger, self.steps, [trials, trials + self.steps], on_step)?;
        self.rounds.push(GrowRound {
            parameters: self.scene.nonzero_parameter_count(),
            resolutions: self.scene.scales.iter().map(|s| s.cloud.resolution).collect(),
            psnr_at_once,
            psnr: self.trainer.psnr_of(&self.scene),
        });
        Ok(true)
    }

    /// Trains the last round's scene longer, and removes dead components and unused ranks. Without rounds, the scene stays
    /// as it is.
    ///
    /// # Errors
    ///
    /// As [`Growing::round`], and [`TrainError::EmptyScene`].
    pub fn finish<E: From<TrainError>>(&mut self, on_step: OnStep<'_, E>) -> Result<Scene, E> {
        if self.rounds.is_empty() {
            return Ok(self.scene.clone());
        }
        let steps = LAST_TRAINING * self.steps;
        self.train(self.scene.clone(), steps, [0, steps], on_step)?;
        let mut scene = compacted(&self.trainer)?;
        scene.provenance.steps = self.steps_before + (self.rounds.len() as u64 + LAST_TRAINING) * self.steps;
        Ok(scene)
    }

    /// The larger scenes that fit.
    fn candidates(&self) -> Vec<Scene> {
        let (scene, step_cells) = (&self.scene, self.config.field.step_cells);
        let parameters = scene.nonzero_parameter_count();
        let next = self.max_parameters.min((GROWTH * parameters as f64) as u64);
        let scales = scene.scales.len();
        let mut candidates = vec![with_more_components(scene, self.trainer.sampler(), next, &self.random())];
        candidates.extend((0..scales).map(|s| finer(scene, s..s + 1, step_cells)));
        candidates.extend((scales > 1).then(|| finer(scene, 0..scales, step_cells)));
        candidates.retain(|larger| (parameters + 1..=self.max_parameters).contains(&larger.nonzero_parameter_count()));
        candidates
    }

    /// The stream of the next round: substreams 0 and 1 are for the importance of components, 2 for the choice among
    /// scenes, 3 for new components.
    fn random(&self) -> Random {
        Random::new(self.config.seed, "resize").substream(self.rounds.len() as u64)
    }

    /// Rays that choose among scenes.
    fn selection_rays(&self) -> RayBatch {
        let count = self.trainer.ray_count().min(SELECTION_RAYS);
        RayBatch::draw(self.trainer.sampler(), &Field::new(&self.scene), &self.random().substream(2), 0, count)
    }

    /// Trains `scene` for `steps`, after the first `done` of the round's `total` steps.
    fn train<E: From<TrainError>>(
        &mut self,
        scene: Scene,
        steps: u64,
        [done, total]: [u64; 2],
        on_step: OnStep<'_, E>,
    ) -> Result<Scene, E> {
        self.trainer.continue_from(scene, steps);
        for n in 1..=steps {
            let report = self.trainer.step()?;
            on_step(&GrowStep { round: self.rounds.len(), steps: [done + n, total], report })?;
        }
        Ok(self.trainer.scene())
    }
}

impl GrowState {
    /// The bytes of the state, with the current scene's own file in it: a safetensors file.
    pub fn to_bytes(&self, scene_file: &[u8]) -> Vec<u8> {
        let metadata = HashMap::from([
            ("growth".to_string(), serde_json::to_string(self).expect("all keys are texts")),
            ("checksum".to_string(), crc32fast::hash(scene_file).to_string()),
        ]);
        let view = TensorView::new(Dtype::U8, vec![scene_file.len()], scene_file).expect("the length is the file's");
        safetensors::serialize([("scene", view)], Some(metadata)).expect("name and length are sound")
    }

    /// Reads the bytes of [`GrowState::to_bytes`]: the state, and the scene's own file.
    ///
    /// # Errors
    ///
    /// If a part is missing or damaged; the error names it.
    pub fn from_bytes(bytes: &[u8]) -> Result<(Self, Vec<u8>), CheckpointError> {
        let not_safetensors =
            |e: safetensors::SafeTensorError| malformed("file", "a safetensors file", format!("a damaged one ({e})"));
        let (_, header) = SafeTensors::read_metadata(bytes).map_err(not_safetensors)?;
        let file = SafeTensors::deserialize(bytes).map_err(not_safetensors)?;
        let text = |key: &str| {
            let found = header.metadata().as_ref().and_then(|metadata| metadata.get(key));
            found.ok_or_else(|| malformed(&format!("metadata {key}"), "present", "missing"))
        };
        let state: Self = serde_json::from_str(text("growth")?)
            .map_err(|e| malformed("metadata growth", "the state of growing", e))?;
        let scene = file.tensor("scene").map_err(|_| malformed("tensor scene", "present", "missing"))?.data();
        let (expected, found) = (text("checksum")?, crc32fast::hash(scene).to_string());
        if *expected != found {
            return Err(malformed("tensor scene", format!("checksum {expected}"), found));
        }
        state.config.check()?;
        Ok((state, scene.to_vec()))
    }
}

/// `scene` with more components: at most `max_parameters`, or as many as it has if these are more.
fn with_more_components(scene: &Scene, sampler: &RaySampler<'_>, max_parameters: u64, random: &Random) -> Scene {
    let mut larger = scene.clone();
    let ranks = |scale: &Scale| scale.factors.blocks().map(|block| block.rank as usize).collect();
    let old_ranks: Vec<Vec<usize>> = scene.scales.iter().map(ranks).collect();
    for (s, scale) in larger.scales.iter_mut().enumerate() {
        add_components(scale, &random.substream(3).substream(s as u64));
    }
    let importance = ComponentImportance::of_addition(&larger, &old_ranks, sampler, random);
    importance.least_important(&larger, max_parameters).apply(&mut larger);
    drop_ranks(&mut larger);
    larger
}

/// `scene` with twice the resolution of `scales`, and the march's step of the resolution that the coarsest scale then
/// has.
fn finer(scene: &Scene, scales: Range<usize>, step_cells: f64) -> Scene {
    let mut scene = scene.clone();
    for scale in &mut scene.scales[scales] {
        let to = scale.cloud.resolution.map(|cells| if cells > MAX_CELLS / 2 { cells } else { 2 * cells });
        let from = scale.cloud.resolution;
        for block in scale.factors.blocks_mut() {
            block.values = upsample(block.form, &block.values, block.rank as usize, from, to);
        }
        scale.cloud.resolution = to;
    }
    scene.rules.step = scene.rules.step.min(march_step(&scene.scales[0].cloud, step_cells));
    scene
}

/// Adds [`NEW_COMPONENTS`] components of each block to all tensors of `scale`. Their last factors are zeros, so pictures stay
/// the same.
fn add_components(scale: &mut Scale, random: &Random) {
    let resolution = scale.cloud.resolution;
    for (b, block) in scale.factors.blocks_mut().enumerate() {
        let (form, old) = (block.form, block.rank as usize);
        let new = old + NEW_COMPONENTS;
        let kept: Vec<usize> = (0..old).collect();
        set_components(block, resolution, new, |_| &kept);
        let random = random.substream(b as u64);
        let (rows, last) = (form.rows(resolution), form.factors(resolution).pop().unwrap_or_default());
        block.values.par_chunks_mut(rows * new).enumerate().for_each(|(n, tensor)| {
            for (row, numbers) in tensor.chunks_exact_mut(new).enumerate().filter(|(row, _)| !last.contains(row)) {
                for (c, number) in numbers[old..].iter_mut().enumerate() {
                    *number = (DEVIATION * random.normal(((n * rows + row) * NEW_COMPONENTS + c) as u64)) as f32;
                }
            }
        });
    }
    let blocks = scale.factors.appearance.iter().map(|block| block.rank as usize).collect::<Vec<_>>();
    let matrix = &mut scale.appearance_matrix;
    let (old, new) = (matrix.rank as usize, blocks.iter().sum::<usize>());
    let random = random.substream(scale.factors.blocks().count() as u64);
    let bound = 1.0 / (new as f64).sqrt();
    let mut weights = Vec::with_capacity(new * matrix.features as usize);
    for (p, row) in matrix.weights.chunks_exact(old).enumerate() {
        let random = random.substream(p as u64);
        let mut row = row.iter();
        let mut offered = (0..).map(|c| (bound * (2.0 * random.uniform(c) - 1.0)) as f32);
        for rank in &blocks {
            weights.extend(row.by_ref().take(rank - NEW_COMPONENTS));
            weights.extend(offered.by_ref().take(NEW_COMPONENTS));
        }
    }
    (matrix.weights, matrix.rank) = (weights, new as u32);
}
