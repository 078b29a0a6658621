//! The sections of the settings.

use glam::DVec3;
use serde::{Deserialize, Serialize};

use super::Exposure;
use strivec_capture::prior::CANONICAL_HALF_EXTENT;
use strivec_format::model::{Aggregation, Coverage, DecoderMode, FactorKind, Form, Reduction, Rules};

/// Steps that the paper's schedule is written for (paper, Implementation).
const PAPER_STEPS: u64 = 30_000;

/// The steps, and what happens after which of them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ScheduleConfig {
    /// Optimizer steps.
    pub steps: u64,
    /// Steps after which the factors are upsampled to their next resolution.
    pub upsample_at: Vec<u64>,
    /// Steps after which the occupancy is estimated anew. The first of them shrinks the bounds to it.
    pub occupancy_at: Vec<u64>,
    /// Remove tensors whose boxes are empty with every new occupancy. Pictures stay the same, and files get smaller.
    pub prune: bool,
    /// The most bytes of the file: if it is larger, the scene is trained for that size in the end. If absent, there is no
    /// such limit.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub max_file_bytes: Option<u64>,
}

/// The photographs, and what is behind the scene in them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct PhotographConfig {
    /// The most pixels along a photograph's longer side: larger ones are downscaled when they are loaded, unless a factor
    /// is given. If absent, there is no such limit.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub max_side: Option<u32>,
    /// sRGB color behind transparent pixels, in \[0, 1\].
    pub background: [f32; 3],
    /// Compare every ray of a photograph with transparent parts on a random background of its own, so that no part of
    /// the scene can pass for background. The prior and all rendering keep `background`.
    pub random_background: bool,
    /// Degree of the sky, the color behind the scene by direction (spec 4.11), 1 to 4; 0: none, `background` is behind
    /// the scene. A sky excludes `random_background`. `None`: none, unless the prior finds that there is one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sky_degree: Option<u32>,
    /// The photographs whose exposure and white balance are fitted.
    pub exposure: Exposure,
}

/// The refinement of cameras.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct PoseConfig {
    /// Refine the cameras' poses.
    pub refine: bool,
    /// Refine one factor of all focal lengths, and the poses with it.
    pub refine_focal_length: bool,
}

/// The rays of a step, and the samples on them that count.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SamplingConfig {
    /// Rays per step.
    pub batch_rays: usize,
    /// Candidates for each ray of a step, of which those with larger errors are drawn more often and count less each. 1
    /// draws all rays alike.
    pub ray_candidates: u32,
    /// Select the rays to train on anew with every new occupancy, so that none is spent on space that proved empty.
    pub refilter_rays: bool,
    /// Russian roulette on colors in training: a sample of less than this visibility weight is shaded with a
    /// probability of its weight over this, and then has this weight. The expected pixel stays the same. 0 shades all
    /// samples.
    pub color_roulette: f64,
    /// Russian roulette on density gradients in training: the threshold in means of a chunk of rays. 0 keeps all
    /// gradients.
    pub density_roulette: f64,
}

/// Start, learning rates and decay of the parameters.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct OptimizerConfig {
    /// Standard deviation of the factors at the start.
    pub factor_deviation: f64,
    /// Learning rate of the factors after each restart of the optimizer.
    pub factor_learning_rate: f64,
    /// Learning rate of the appearance matrices and the decoder after each restart of the optimizer.
    pub network_learning_rate: f64,
    /// Learning rate of the sky after each restart of the optimizer.
    pub sky_learning_rate: f64,
    /// Factor by which learning rates fall over a whole run without restarts.
    pub learning_rate_decay: f64,
    /// The share of the steps at the end over which learning rates fall linearly to 0, besides their decay.
    pub cooldown: f64,
    /// Weight decay of the factors: the share of themselves that they lose in a step, in learning rates (Loshchilov and
    /// Hutter, 2019). 0 turns it off.
    pub factor_decay: f64,
}

/// Weights of terms of the loss besides colors; 0 turns a term off.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct LossConfig {
    /// Weight of the mean absolute density factor, per axis and scale (paper, Implementation).
    pub density_l1: f64,
    /// Weight of the mean squared difference between neighboring vertices of density factors (TensoRF's total variation).
    pub density_variation: f64,
    /// Weight of the mean squared difference between neighboring vertices of appearance factors.
    pub appearance_variation: f64,
    /// Weight of the mean visibility that is not where points were matched between photographs (`prior/stereo.rs`), over
    /// rays through such points.
    pub distance_weight: f64,
}

/// The space that the scene takes up.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SpaceConfig {
    /// Distances at which rays begin and end, in the dataset's units; found from the cameras if absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub near_far: Option<[f64; 2]>,
    /// Smallest and largest corner of the inner box of an unbounded scene, in the dataset's units; found from the cameras
    /// if absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub inner_box: Option<[DVec3; 2]>,
    /// True if the scene is unbounded: contracted around its inner box. Decided by what photographs show if absent, or if the
    /// rules have a contraction.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub unbounded: Option<bool>,
    /// Half the largest extent of a bounded scene, in model units. The scales' pitches are relative to it.
    pub half_extent: f64,
}

/// The schedule on which training gives up the components, and the cells, that pictures depend on least.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct LeanConfig {
    /// Components are given up as long as one percent of the parameters costs at most this at once, in dB of PSNR on the
    /// photographs; further training wins most of it back. The limit rises to this from 0. 0 turns it off.
    pub max_loss: f64,
    /// More components are given up until at most this many parameters are left; if absent, none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub max_parameters: Option<u64>,
    /// Components are given up for their worth only while PSNR on rays of the photographs is less than this below that at the
    /// start, in dB, for runs that begin with a trained scene; if absent, whatever it is.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub max_drop: Option<f64>,
    /// The shares of the steps after which this begins and ends.
    pub during: [f64; 2],
    /// How often components are given up between them.
    pub rounds: u32,
}

/// The rules of the march for the last steps: they skip samples that hardly show. Earlier steps need the gradients of
/// faint samples, because they find the geometry.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct FinishConfig {
    /// Share of the steps after whose next estimate of the occupancy these settings hold; 1: never. 0 is for runs that
    /// begin with a trained scene: where all this is left out, its occupancy stays.
    pub from: f64,
    /// See [`Rules::min_transmittance`].
    pub min_transmittance: f64,
    /// See [`Rules::min_weight`].
    pub min_weight: f64,
    /// The occupancy is estimated without a margin then, and from then on: where no sample has at least this
    /// opacity, space is empty. 0: it is estimated as before.
    pub min_alpha: f64,
    /// All this is left out until the next estimate if it costs more than this at once, in dB of PSNR on rays of the
    /// photographs: a scene that is still faint needs its faint samples.
    pub max_loss: f64,
}

/// The shape of the decoder (spec 3.5).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct DecoderConfig {
    /// Calls of the decoder: per sample, per ray, or per ray with a residual of each sample.
    pub mode: DecoderMode,
    /// P, the length of the appearance feature.
    pub features: u32,
    /// Frequencies of the positional encoding of the features.
    pub feature_frequencies: u32,
    /// Frequencies of the positional encoding of the direction.
    pub direction_frequencies: u32,
    /// Widths of the hidden layers.
    pub hidden: Vec<u32>,
}

/// The tensors of a scale. Lengths are in model units, per axis.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ScaleConfig {
    /// One tensor over the box of the occupied space: pitch and edge become its size, and the cells along its axes are as many
    /// as those of a cube with the resolutions below ([`TrainConfig::fitted`](super::TrainConfig::fitted)).
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub whole_scene: bool,
    /// Distance between lattice cells.
    pub pitch: [f64; 3],
    /// Edge of a tensor's box.
    pub edge: [f64; 3],
    /// Cells of a tensor at the start, and after each upsampling.
    pub resolutions: Vec<[u32; 3]>,
    /// The factors of a component. Those with a matrix are spread evenly over the axes.
    #[serde(default)]
    pub factors: FactorKind,
    /// Density components; along all axes together.
    pub density_rank: u32,
    /// Appearance components, alike.
    pub appearance_rank: u32,
    /// The most neighbors that a point aggregates.
    pub top_k: u32,
}

/// Settings of the prior from tri-vectors alone, the paper's own.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct BootstrapOptions {
    /// Steps of each round. The first round covers the box of all frusta, each later one the box of the occupied voxels
    /// of the round before, or the same box if there were none. Less than 100 steps find hardly any voxel.
    pub steps: Vec<u64>,
    /// Rays per step.
    pub batch_rays: usize,
    /// Density and appearance components of each of the eight tensors.
    pub components: u32,
    /// Cells along the longest axis of a tensor in the last round; half as many in the round before it, and so on. A
    /// voxel is such a cell.
    pub resolution: u32,
    /// Occupied voxels have an α over one voxel edge above this.
    pub occupied_alpha: f64,
    /// Occupied voxels are next to a sample of more than this visibility weight.
    pub min_visibility_weight: f64,
    /// Approximate number of rays that find these samples, evenly spread over all photographs.
    pub visibility_rays: u32,
}

impl Default for ScheduleConfig {
    fn default() -> Self {
        Self {
            steps: PAPER_STEPS,
            upsample_at: vec![2000, 3000, 4000, 5500, 7000],
            occupancy_at: vec![2000, 4000, 8000, 16_000, 24_000],
            prune: false,
            max_file_bytes: None,
        }
    }
}

impl Default for PhotographConfig {
    fn default() -> Self {
        Self {
            max_side: None,
            background: [1.0; 3],
            random_background: false,
            sky_degree: None,
            exposure: Exposure::default(),
        }
    }
}

impl Default for SamplingConfig {
    fn default() -> Self {
        Self {
            batch_rays: 4096,
            // Four candidates for a ray are no better than two (docs/experiments/2026-11-26-rays-by-error.md).
            ray_candidates: 2,
            refilter_rays: true,
            // 27 % fewer shaded samples without a measurable loss (docs/experiments/2026-11-21-step-optimizations.md).
            color_roulette: 0.001,
            // Density gradients take a fifth of their time (docs/experiments/2026-11-21-step-optimizations.md).
            density_roulette: 1.0,
        }
    }
}

impl Default for OptimizerConfig {
    fn default() -> Self {
        Self {
            factor_deviation: 0.2,
            factor_learning_rate: 0.02,
            network_learning_rate: 0.001,
            sky_learning_rate: 0.02,
            // The paper's (Implementation).
            learning_rate_decay: 0.1,
            cooldown: 0.0,
            factor_decay: 0.0,
        }
    }
}

impl Default for LossConfig {
    fn default() -> Self {
        Self {
            density_l1: 1e-5,
            density_variation: 0.0,
            appearance_variation: 0.0,
            // Ten times as much loses 0.5 dB on held-out photographs (docs/experiments/2026-11-25-regularizing.md).
            distance_weight: 0.01,
        }
    }
}

impl Default for SpaceConfig {
    fn default() -> Self {
        Self { near_far: None, inner_box: None, unbounded: None, half_extent: CANONICAL_HALF_EXTENT }
    }
}

/// The paper's rules; the march's step is in cells of scale 0.
pub(super) fn paper_rules() -> Rules {
    Rules {
        coverage: Coverage::All,
        aggregation: Aggregation::Normalized,
        density_reduction: Reduction::Sum,
        appearance_reduction: Reduction::Sum,
        density_shift: -10.0,
        distance_scale: 25.0,
        step: 0.5,
        min_transmittance: 1e-3,
        min_weight: 1e-4,
        contraction: None,
        sky: None,
    }
}

impl PoseConfig {
    /// True if cameras move.
    pub fn is_on(&self) -> bool {
        self.refine || self.refine_focal_length
    }
}

impl FinishConfig {
    /// The march stays as it is.
    pub fn off() -> Self {
        Self { from: 1.0, min_transmittance: 1e-3, min_weight: 1e-4, min_alpha: 0.0, max_loss: 0.5 }
    }
}

impl Default for FinishConfig {
    fn default() -> Self {
        // An early tight occupancy costs nothing and saves a sixth of the time. A least opacity of 0.03 loses the
        // faint cells that blur silhouettes as photographs do (docs/experiments/2026-11-26-tight-occupancy.md); twice
        // the thresholds lose 0.3 dB (docs/experiments/2026-11-26-default-in-full.md).
        Self { from: 0.13, min_transmittance: 2.5e-3, min_weight: 1e-3, min_alpha: 5e-3, max_loss: 0.5 }
    }
}

impl LeanConfig {
    /// All components are kept.
    pub fn off() -> Self {
        Self { max_loss: 0.0, max_parameters: None, ..Self::default() }
    }

    /// True if any component may be given up.
    pub fn is_on(&self) -> bool {
        self.max_loss > 0.0 || self.max_parameters.is_some()
    }

    /// The round after `step` of `steps`, if there is one: from 0 to `rounds`.
    pub fn round_after(&self, step: u64, steps: u64) -> Option<u32> {
        if !self.is_on() {
            return None;
        }
        (0..=self.rounds).rev().find(|&round| self.step_of(round, steps) == step)
    }

    /// True if step number `step` of `steps` measures the worth of components: those of the rounds, and as many before as
    /// a round has.
    pub fn is_measuring(&self, step: u64, steps: u64) -> bool {
        let [first, second, last] = [0, 1, self.rounds].map(|round| self.step_of(round, steps));
        self.is_on() && step + (second - first).max(1) > first && step <= last
    }

    /// The step after which `round` is.
    fn step_of(&self, round: u32, steps: u64) -> u64 {
        let [from, until] = self.during;
        let share = from + (until - from) * f64::from(round) / f64::from(self.rounds);
        ((share * steps as f64).round() as u64).max(1)
    }

    /// In `round`, with `total` parameters: the most dB that one percent of the parameters may cost, and the most
    /// parameters.
    pub fn goals(&self, round: u32, total: u64) -> (f64, u64) {
        let max_loss = self.max_loss * f64::from(round) / f64::from(self.rounds);
        // The parameters beyond `max_parameters` fall with the cube of the share of the rounds that are left.
        let rest = |round: u32| f64::from(self.rounds - round).powi(3);
        let share = if round == 0 { 1.0 } else { rest(round) / rest(round - 1) };
        let most = |end: u64| end.saturating_add((total.saturating_sub(end) as f64 * share) as u64);
        (max_loss, self.max_parameters.map_or(u64::MAX, most))
    }
}

impl Default for LeanConfig {
    fn default() -> Self {
        // Rounds between 0.03 and 0.6 of the steps are as good as later ones, and leave less to compute
        // (docs/experiments/2026-11-25-lean-training.md). The limit leaves lego about 7 million parameters
        // (docs/experiments/2026-11-26-adam.md).
        Self { max_loss: 0.06, max_parameters: None, max_drop: None, during: [1.0 / 30.0, 0.6], rounds: 34 }
    }
}

impl Default for DecoderConfig {
    fn default() -> Self {
        Self {
            mode: DecoderMode::PerSample,
            features: 27,
            feature_frequencies: 2,
            direction_frequencies: 2,
            hidden: vec![128, 128],
        }
    }
}

impl Default for BootstrapOptions {
    fn default() -> Self {
        Self {
            steps: vec![300, 900],
            batch_rays: 1024,
            components: 8,
            resolution: 48,
            occupied_alpha: 3e-3,
            min_visibility_weight: 1e-3,
            visibility_rays: 1_000_000,
        }
    }
}

impl BootstrapOptions {
    /// Number of steps over all rounds.
    pub fn total_steps(&self) -> u64 {
        self.steps.iter().fold(0, |sum, &n| sum.saturating_add(n))
    }
}

impl ScaleConfig {
    /// The forms of density and of appearance components, each with its rank.
    pub fn forms(&self) -> [Vec<(Form, u32)>; 2] {
        let of_rank = |rank: u32| match self.factors {
            FactorKind::Cp => vec![(Form::Cp, rank)],
            FactorKind::Vm => (0..3).map(|axis| (Form::Vm(axis), (rank + 2 - axis as u32) / 3)).collect(),
        };
        [of_rank(self.density_rank), of_rank(self.appearance_rank)]
    }
}
