//! The presets.

use std::str::FromStr;

use serde::{Deserialize, Serialize};

use super::near_names::near_names;
use super::sections::paper_rules;
use super::{
    BootstrapOptions, ConfigError, DecoderConfig, FinishConfig, LeanConfig, LossConfig, OptimizerConfig,
    PhotographConfig, PoseConfig, SamplingConfig, ScaleConfig, ScheduleConfig, SpaceConfig, TrainConfig,
};
use strivec_capture::prior::CoarseOptions;
use strivec_format::geometry::Contraction;
use strivec_format::model::{DecoderMode, FactorKind, Reduction};

/// Steps of the best quality. 4000 more gain 0.01 dB (docs/experiments/2026-11-28-whole-schedule.md).
const BEST_STEPS: u64 = 39_000;
/// Rays per step of the best quality. Half of the paper's rays per step gain 0.2 to 0.3 dB from as many rays
/// (docs/experiments/2026-11-26-rays-by-error.md).
const BEST_BATCH: usize = 2048;
/// The factor by which learning rates fall over a run (paper, Implementation).
const DECAY: f64 = 0.1;
/// The factor by which learning rates of the best quality fall over a run, and the share of its steps at the end in
/// which they fall to 0 (docs/experiments/2026-11-26-learning-rates.md).
const BEST_DECAY: f64 = 0.25;
const BEST_COOLDOWN: f64 = 0.15;
/// The most that one percent of the parameters may cost, in dB. From 9.3 to 4.5 million parameters, lego loses 0.1 dB
/// (docs/experiments/2026-11-26-frame-in-tiles.md).
const BEST_MAX_LOSS: f64 = 0.1;
/// The weight decay of the factors. Three times as much is too much (docs/experiments/2026-11-26-weight-decay.md), and
/// so is as much in the longer runs of the best quality (docs/experiments/2026-11-28-weight-decay-in-full.md).
const PREVIEW_FACTOR_DECAY: f64 = 0.01;
const BEST_FACTOR_DECAY: f64 = 0.003;
/// A step of the march in cells of the best quality's first scale, as long as the paper's half of a wider cell.
const FINE_STEP_CELLS: f64 = 2.0 / 3.0;
/// Steps of the preset for scans (paper, The ScanNet dataset).
const SCAN_STEPS: u64 = 100_000;
/// Steps of the preset for unbounded scenes, and the shell around their inner cube (the paper's runs on Mip-NeRF 360).
const SURROUNDINGS_STEPS: u64 = 120_000;
const SURROUNDINGS_SHELL: f64 = 0.4;
/// Steps of the preset for a first look, and the most pixels along a photograph's side.
const PREVIEW_STEPS: u64 = 1400;
const PREVIEW_SIDE: u32 = 256;
/// The share of the steps of a first look in which learning rates fall to 0.
const PREVIEW_COOLDOWN: f64 = 0.2;
/// Short runs estimate the occupancy no earlier than this: space that is empty at that step stays empty. At step 67
/// of a scan nearly everything still was.
const EARLIEST_OCCUPANCY: u64 = 300;
/// Short runs keep faint samples at least until this step, since surfaces are still thick.
/// The fox in 1500 steps loses 0.2 dB if it begins at step 300 (docs/experiments/2026-11-26-tight-occupancy.md).
const EARLIEST_FINISH: u64 = 1000;
/// Half the largest extent of a scan in model units: about the extent of a room in meters.
const SCAN_HALF_EXTENT: f64 = 4.8;

/// A preset of model and schedule.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(into = "&'static str", try_from = "String")]
pub enum Preset {
    /// The paper's model with 12 appearance components.
    Paper12,
    /// The paper's model with 24 appearance components.
    Paper24,
    /// The paper's main model, with 48 appearance components.
    Paper48,
    /// The paper's model with 96 appearance components.
    Paper96,
    /// Two scales and two neighbors per scale.
    Fast,
    /// 48 appearance components and a decoder per ray.
    PerRay,
    /// The best quality; the preset of settings that name none.
    #[default]
    Best,
    /// The best quality for small photographs, in about a minute.
    Preview,
    /// Four scales for rooms.
    Scannet,
    /// Two scales in contracted space.
    Unbounded,
}

impl Preset {
    /// Every preset.
    pub const ALL: [Self; 10] = [
        Self::Paper12,
        Self::Paper24,
        Self::Paper48,
        Self::Paper96,
        Self::Fast,
        Self::PerRay,
        Self::Best,
        Self::Preview,
        Self::Scannet,
        Self::Unbounded,
    ];

    /// The name in settings and in scenes.
    pub fn name(self) -> &'static str {
        self.description()[0]
    }

    /// Purpose of the preset, in one line.
    pub fn purpose(self) -> &'static str {
        self.description()[1]
    }

    /// The name and the purpose.
    fn description(self) -> [&'static str; 2] {
        match self {
            Self::Paper12 => ["12", "the paper's model with 12 appearance components"],
            Self::Paper24 => ["24", "the paper's model with 24 appearance components"],
            Self::Paper48 => ["48", "the paper's main model, with 48 appearance components"],
            Self::Paper96 => ["96", "the paper's model with 96 appearance components"],
            Self::Fast => ["fast", "two scales, two neighbors per scale, for quick tries"],
            Self::PerRay => ["per-ray", "48 with the network evaluated once per ray instead of once per sample"],
            Self::Best => ["best", "per-ray with a color per sample and more view-dependent detail: the best pictures"],
            Self::Preview => {
                ["preview", "a first look in about a minute, from photographs of at most 256 pixels a side"]
            }
            Self::Scannet => ["scannet", "four scales, 100 000 steps, for rooms"],
            Self::Unbounded => ["360", "two scales in contracted space, 120 000 steps, for captures without an edge"],
        }
    }

    /// The settings.
    pub fn config(self) -> TrainConfig {
        let config = match self {
            Self::Paper12 => paper(12),
            Self::Paper24 => paper(24),
            Self::Paper48 => paper(48),
            Self::Paper96 => paper(96),
            Self::Fast => fast(),
            Self::PerRay => per_ray(),
            Self::Best => best(),
            Self::Preview => preview(),
            Self::Scannet => scannet(),
            Self::Unbounded => unbounded(),
        };
        TrainConfig { preset: self, ..config }
    }
}

impl FromStr for Preset {
    type Err = ConfigError;

    /// # Errors
    ///
    /// [`ConfigError::UnknownPreset`].
    fn from_str(name: &str) -> Result<Self, ConfigError> {
        Self::ALL.into_iter().find(|preset| preset.name() == name).ok_or_else(|| {
            let names = Self::ALL.map(Self::name);
            let near =
                near_names(name, names).first().map_or_else(String::new, |near| format!("; did you mean {near}?"));
            ConfigError::UnknownPreset { name: name.into(), near, known: names.join(", ") }
        })
    }
}

impl TryFrom<String> for Preset {
    type Error = ConfigError;

    fn try_from(name: String) -> Result<Self, ConfigError> {
        name.parse()
    }
}

impl From<Preset> for &'static str {
    fn from(preset: Preset) -> Self {
        preset.name()
    }
}

impl Default for TrainConfig {
    /// The settings of the preset [`Preset::default`].
    fn default() -> Self {
        Preset::default().config()
    }
}

impl TrainConfig {
    /// The settings of the preset `name`.
    ///
    /// # Errors
    ///
    /// [`ConfigError::UnknownPreset`].
    pub fn preset(name: &str) -> Result<Self, ConfigError> {
        name.parse().map(Preset::config)
    }

    /// This run in `steps` steps. The schedule is scaled along, but no occupancy is estimated before step 300, as
    /// hardly any density has grown by then, and no march of the end begins before step 1000. In fewer steps, components may
    /// cost less when they are given up ([`LeanConfig::max_loss`]), by the square root of the share of steps: less of it is
    /// won back.
    pub fn with_steps(mut self, steps: u64) -> Self {
        let before = self.schedule.steps as f64;
        let scaled = |at: u64| (at as f64 * steps as f64 / before).round().max(1.0) as u64;
        let schedule = &mut self.schedule;
        schedule.steps = steps;
        schedule.upsample_at.iter_mut().for_each(|at| *at = scaled(*at));
        schedule.occupancy_at.iter_mut().for_each(|at| *at = scaled(*at).max(EARLIEST_OCCUPANCY.min(*at)));
        schedule.occupancy_at.dedup();
        self.finish.from = self.finish.from.max(EARLIEST_FINISH as f64 / steps as f64).min(1.0);
        // At a twentieth of the steps, a fifth of the limit is 0.35 dB better on held-out photographs of the fox, and 0.6 dB on
        // those of a room (docs/experiments/2026-11-30-captures.md).
        self.lean.max_loss *= (steps as f64 / before).min(1.0).sqrt();
        self
    }
}

/// The paper's model with this many appearance components (paper, Implementation).
fn paper(appearance_rank: u32) -> TrainConfig {
    TrainConfig {
        preset: Preset::Paper48,
        seed: 0,
        schedule: ScheduleConfig::default(),
        photographs: PhotographConfig::default(),
        poses: PoseConfig::default(),
        sampling: SamplingConfig::default(),
        optimizer: OptimizerConfig::default(),
        loss: LossConfig::default(),
        lean: LeanConfig::default(),
        finish: FinishConfig::default(),
        space: SpaceConfig::default(),
        model: paper_rules(),
        decoder: DecoderConfig::default(),
        prior: CoarseOptions::default(),
        bootstrap: BootstrapOptions::default(),
        scales: preset_scales(appearance_rank),
    }
}

/// Fewer scales and neighbors.
fn fast() -> TrainConfig {
    let mut preset = paper(48);
    preset.sampling.refilter_rays = false;
    preset.scales.truncate(2);
    preset.scales.iter_mut().for_each(|scale| scale.top_k = 2);
    preset
}

/// A decoder per ray.
fn per_ray() -> TrainConfig {
    let mut preset = paper(48);
    preset.decoder.mode = DecoderMode::PerRay;
    preset.sampling.refilter_rays = false;
    preset.sampling.color_roulette = 0.002;
    preset
}

/// Rooms (paper, The ScanNet dataset).
fn scannet() -> TrainConfig {
    let mut preset = paper(48).with_steps(SCAN_STEPS);
    preset.space.half_extent = SCAN_HALF_EXTENT;
    preset.space.unbounded = Some(false);
    preset.model.density_reduction = Reduction::Mean;
    preset.scales = scan_scales();
    preset
}

/// Captures without an edge (the paper's runs on Mip-NeRF 360).
fn unbounded() -> TrainConfig {
    let mut preset = best().with_steps(SURROUNDINGS_STEPS);
    preset.sampling.batch_rays = 4096;
    let optimizer = &mut preset.optimizer;
    (optimizer.learning_rate_decay, optimizer.cooldown, optimizer.factor_decay) = (DECAY, 0.0, 0.0);
    optimizer.factor_learning_rate = 0.03;
    preset.loss.density_l1 = 1e-4;
    preset.model.contraction = Some(Contraction { shell: SURROUNDINGS_SHELL });
    preset.model.step = paper_rules().step;
    preset.scales = surroundings_scales();
    preset
}

/// The best quality: the paper's model of 48 components with a decoder per ray and a residual per sample.
fn best() -> TrainConfig {
    let mut preset = paper(48);
    // A color for each sample beside the ray's: 0.25 dB more than one color per ray at a quarter of the resolution
    // (docs/experiments/2026-11-21-training-settings.md).
    preset.decoder.mode = DecoderMode::Residual;
    // Highlights come and go within a few degrees: with six frequencies the views against the sun gain 3 dB
    // (docs/experiments/2026-11-21-training-settings.md). A wider network never cleared the fog of the first steps.
    preset.decoder.direction_frequencies = 6;
    preset.sampling.color_roulette = 0.002;
    preset.sampling.batch_rays = BEST_BATCH;
    (preset.optimizer.learning_rate_decay, preset.optimizer.cooldown) = (BEST_DECAY, BEST_COOLDOWN);
    preset.optimizer.factor_decay = BEST_FACTOR_DECAY;
    // The first two scales have cells about as wide as a pixel of photographs of 800×800, which is best: 0.5 dB more
    // than the paper's, which are 1.4 pixels wide (docs/experiments/2026-11-26-tight-occupancy.md). Training gives up a
    // third of the third scale's anyway.
    let finer = [[29, 43, 65, 93, 125, 161], [15, 23, 35, 47, 63, 81]];
    for (scale, cells) in preset.scales.iter_mut().zip(finer) {
        scale.resolutions = cells.map(|d| [d; 3]).to_vec();
    }
    preset.model.step = FINE_STEP_CELLS;
    preset = preset.with_steps(BEST_STEPS);
    preset.lean.max_loss = BEST_MAX_LOSS;
    preset
}

/// The best quality for small photographs, whose pixels are as large as the tensors' cells, in the steps of about a minute.
fn preview() -> TrainConfig {
    let mut preset = best();
    preset.schedule.steps = PREVIEW_STEPS;
    preset.sampling.batch_rays = 1024;
    preset.optimizer.factor_decay = PREVIEW_FACTOR_DECAY;
    (preset.optimizer.learning_rate_decay, preset.optimizer.cooldown) = (DECAY, PREVIEW_COOLDOWN);
    preset.photographs.max_side = Some(PREVIEW_SIDE);
    preset.schedule.upsample_at = vec![PREVIEW_STEPS / 15];
    preset.schedule.occupancy_at = [0.13, 0.27, 0.53].map(|share| (share * PREVIEW_STEPS as f64) as u64).to_vec();
    preset.prior.min_visibility_weight = 0.01;
    preset.model.step = paper_rules().step;
    // Most of the time goes into samples of fog: an early tight occupancy leaves time for more steps
    // (docs/experiments/2026-11-25-march-of-the-end.md).
    preset.finish =
        FinishConfig { from: 0.25, min_transmittance: 5e-3, min_weight: 2e-3, min_alpha: 0.01, max_loss: 1.0 };
    // With a limit of 0.05 dB, a run of a minute loses 0.8 dB (docs/experiments/2026-11-26-adam.md).
    preset.lean.max_loss = 5e-4;
    for (scale, cells) in preset.scales.iter_mut().zip([[29, 43], [15, 23], [7, 11]]) {
        scale.resolutions = cells.map(|d| [d; 3]).to_vec();
        (scale.density_rank, scale.appearance_rank) = (scale.density_rank / 2, scale.appearance_rank / 2);
    }
    preset
}

/// The paper's three scales (paper, Implementation).
fn preset_scales(appearance_rank: u32) -> Vec<ScaleConfig> {
    vec![
        scale([0.4, 0.6], [29, 43, 65, 85, 103, 121], [32, appearance_rank], 4),
        scale([0.2, 0.3], [15, 23, 35, 43, 53, 61], [24, appearance_rank], 4),
        scale([0.1, 0.15], [7, 11, 17, 21, 27, 31], [16, appearance_rank], 4),
    ]
}

/// Four scales for rooms (paper, The ScanNet dataset). At the last resolution the cells of all scales are of about the
/// same size, and as large relative to the finest pitch as those of [`preset_scales`].
fn scan_scales() -> Vec<ScaleConfig> {
    vec![
        scale([3.0, 5.0], [83, 123, 185, 243, 293, 345], [24, 48], 4),
        scale([1.7, 3.2], [53, 79, 119, 155, 189, 221], [24, 48], 4),
        scale([0.6, 1.6], [27, 39, 59, 77, 95, 111], [16, 48], 2),
        scale([0.3, 0.8], [13, 19, 29, 39, 47, 55], [12, 48], 2),
    ]
}

/// Two scales for contracted space (the paper's runs on Mip-NeRF 360).
fn surroundings_scales() -> Vec<ScaleConfig> {
    vec![
        scale([1.2, 2.4], [101, 137, 185, 241, 281, 323], [48, 48], 4),
        scale([0.6, 1.2], [51, 69, 93, 121, 141, 161], [32, 48], 4),
    ]
}

/// A scale that is the same along all axes.
fn scale(
    [pitch, edge]: [f64; 2],
    resolutions: [u32; 6],
    [density_rank, appearance_rank]: [u32; 2],
    top_k: u32,
) -> ScaleConfig {
    ScaleConfig {
        whole_scene: false,
        pitch: [pitch; 3],
        edge: [edge; 3],
        resolutions: resolutions.map(|d| [d; 3]).to_vec(),
        factors: FactorKind::Cp,
        density_rank,
        appearance_rank,
        top_k,
    }
}
