//! The presets.

use super::{
    BootstrapOptions, ConfigError, DecoderConfig, FieldConfig, FinishConfig, LeanConfig, ScaleConfig, TrainConfig,
};
use crate::Exposure;
use strivec_capture::prior::{CANONICAL_HALF_EXTENT, CoarseOptions};
use strivec_format::model::{DecoderMode, FactorKind, Reduction};

/// Steps that the presets' schedules are written for (paper, Implementation).
const PRESET_STEPS: u64 = 30_000;
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

impl Default for TrainConfig {
    /// The preset [`TrainConfig::DEFAULT_PRESET`].
    fn default() -> Self {
        best()
    }
}

impl TrainConfig {
    /// The presets' names.
    pub const PRESETS: [&str; 10] = ["12", "24", "48", "96", "fast", "per-ray", "best", "preview", "scannet", "360"];
    /// The preset of settings that name none.
    pub const DEFAULT_PRESET: &str = "best";

    /// The preset `name`.
    ///
    /// # Errors
    ///
    /// [`ConfigError::UnknownPreset`].
    pub fn preset(name: &str) -> Result<Self, ConfigError> {
        let mut preset = match name {
            "12" | "24" | "48" | "96" => paper(name.parse().expect("a number")),
            "best" => best(),
            "preview" => preview(),
            "per-ray" => {
                let mut preset = paper(48);
                preset.decoder.mode = DecoderMode::PerRay;
                preset.refilter_rays = false;
                preset.color_roulette = 0.002;
                preset
            }
            "fast" => {
                let mut preset = paper(48);
                preset.refilter_rays = false;
                preset.scales.truncate(2);
                preset.scales.iter_mut().for_each(|s| s.top_k = 2);
                preset
            }
            "scannet" => {
                let mut preset = paper(48).with_steps(SCAN_STEPS);
                preset.half_extent = SCAN_HALF_EXTENT;
                preset.field.density_reduction = Reduction::Mean;
                preset.scales = scan_scales();
                preset
            }
            "360" => {
                let mut preset = best().with_steps(SURROUNDINGS_STEPS);
                preset.batch_rays = 4096;
                (preset.learning_rate_decay, preset.cooldown, preset.factor_decay) = (DECAY, 0.0, 0.0);
                preset.shell = Some(SURROUNDINGS_SHELL);
                preset.factor_learning_rate = 0.03;
                preset.density_l1 = 1e-4;
                preset.scales = surroundings_scales();
                preset.field.step_cells = FieldConfig::default().step_cells;
                preset
            }
            _ => return Err(ConfigError::UnknownPreset { name: name.into(), known: Self::PRESETS.join(", ") }),
        };
        preset.preset = name.into();
        Ok(preset)
    }

    /// This run in `steps` steps. The schedule is scaled along, but no occupancy is estimated before step 300, as
    /// hardly any density has grown by then, and no march of the end begins before step 1000.
    pub fn with_steps(self, steps: u64) -> Self {
        let scaled = |at: &u64| (*at as f64 * steps as f64 / self.steps as f64).round().max(1.0) as u64;
        let mut occupancy_at: Vec<u64> =
            self.occupancy_at.iter().map(|at| scaled(at).max(EARLIEST_OCCUPANCY.min(*at))).collect();
        occupancy_at.dedup();
        let from = self.finish.from.max(EARLIEST_FINISH as f64 / steps as f64).min(1.0);
        let finish = FinishConfig { from, ..self.finish.clone() };
        Self { upsample_at: self.upsample_at.iter().map(scaled).collect(), occupancy_at, finish, steps, ..self }
    }
}

/// The paper's model with this many appearance components (paper, Implementation).
fn paper(appearance_rank: u32) -> TrainConfig {
    TrainConfig {
        preset: appearance_rank.to_string(),
        seed: 0,
        steps: PRESET_STEPS,
        batch_rays: 4096,
        // Four candidates for a ray are no better than two (docs/experiments/2026-11-26-rays-by-error.md).
        ray_candidates: 2,
        max_photograph_side: None,
        max_file_bytes: None,
        background: [1.0; 3],
        random_background: false,
        sky_degree: None,
        exposure: Exposure::Auto,
        refine_poses: false,
        refine_focal_length: false,
        refilter_rays: true,
        prune: false,
        near_far: None,
        factor_learning_rate: 0.02,
        network_learning_rate: 0.001,
        sky_learning_rate: 0.02,
        learning_rate_decay: DECAY,
        cooldown: 0.0,
        factor_decay: 0.0,
        density_l1: 1e-5,
        density_variation: 0.0,
        appearance_variation: 0.0,
        // Ten times as much loses 0.5 dB on held-out photographs (docs/experiments/2026-11-25-regularizing.md).
        distance_weight: 0.01,
        // 27 % fewer shaded samples without a measurable loss (docs/experiments/2026-11-21-step-optimizations.md).
        color_roulette: 0.001,
        // Density gradients take a fifth of their time (docs/experiments/2026-11-21-step-optimizations.md).
        density_roulette: 1.0,
        lean: LeanConfig::default(),
        finish: FinishConfig::default(),
        factor_deviation: 0.2,
        upsample_at: vec![2000, 3000, 4000, 5500, 7000],
        occupancy_at: vec![2000, 4000, 8000, 16_000, 24_000],
        shell: None,
        inner_box: None,
        half_extent: CANONICAL_HALF_EXTENT,
        field: FieldConfig::default(),
        decoder: DecoderConfig::default(),
        prior: CoarseOptions::default(),
        bootstrap: BootstrapOptions::default(),
        scales: preset_scales(appearance_rank),
    }
}

/// The best quality: the paper's model of 48 components with a decoder per ray and a residual per sample.
fn best() -> TrainConfig {
    let mut preset = paper(48);
    preset.preset = "best".into();
    // A color for each sample beside the ray's: 0.25 dB more than one color per ray at a quarter of the resolution
    // (docs/experiments/2026-11-21-training-settings.md).
    preset.decoder.mode = DecoderMode::Residual;
    // Highlights come and go within a few degrees: with six frequencies the views against the sun gain 3 dB
    // (docs/experiments/2026-11-21-training-settings.md). A wider network never cleared the fog of the first steps.
    preset.decoder.direction_frequencies = 6;
    preset.color_roulette = 0.002;
    preset.batch_rays = BEST_BATCH;
    (preset.learning_rate_decay, preset.cooldown) = (BEST_DECAY, BEST_COOLDOWN);
    preset.lean.max_loss = BEST_MAX_LOSS;
    preset.factor_decay = BEST_FACTOR_DECAY;
    // The first two scales have cells about as wide as a pixel of photographs of 800×800, which is best: 0.5 dB more
    // than the paper's, which are 1.4 pixels wide (docs/experiments/2026-11-26-tight-occupancy.md). Training gives up a
    // third of the third scale's anyway.
    let finer = [[29, 43, 65, 93, 125, 161], [15, 23, 35, 47, 63, 81]];
    for (scale, cells) in preset.scales.iter_mut().zip(finer) {
        scale.resolutions = cells.map(|d| [d; 3]).to_vec();
    }
    preset.field.step_cells = FINE_STEP_CELLS;
    preset.with_steps(BEST_STEPS)
}

/// The best quality for small photographs, whose pixels are as large as the tensors' cells, in the steps of about a minute.
fn preview() -> TrainConfig {
    let mut preset = best();
    preset.steps = PREVIEW_STEPS;
    preset.batch_rays = 1024;
    preset.factor_decay = PREVIEW_FACTOR_DECAY;
    (preset.learning_rate_decay, preset.cooldown) = (DECAY, PREVIEW_COOLDOWN);
    preset.max_photograph_side = Some(PREVIEW_SIDE);
    preset.upsample_at = vec![PREVIEW_STEPS / 15];
    preset.occupancy_at = [0.13, 0.27, 0.53].map(|share| (share * PREVIEW_STEPS as f64) as u64).to_vec();
    preset.prior.min_visibility_weight = 0.01;
    preset.field.step_cells = FieldConfig::default().step_cells;
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
