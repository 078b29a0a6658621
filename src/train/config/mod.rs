//! Settings of a training run: everything that the result depends on besides the photographs.

mod check;
mod error;
mod presets;
#[cfg(test)]
mod tests;
mod toml;

use glam::DVec3;
use serde::{Deserialize, Serialize};

pub use error::ConfigError;

use super::Exposure;
use strivec_capture::prior;
use strivec_capture::prior::{CoarseOptions, Unbounded, VoxelBoxes};
use strivec_format::geometry::{Aabb, Contraction, Similarity};
use strivec_format::model::{Aggregation, Coverage, DecoderMode, FactorKind, Form, Reduction, Rules, Sky};

/// A training run's settings. They have a TOML form, in which every field may be left out.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct TrainConfig {
    /// The preset that the settings began as.
    pub preset: String,
    /// Random seed.
    pub seed: u64,
    /// Optimizer steps.
    pub steps: u64,
    /// Rays per step.
    pub batch_rays: usize,
    /// Candidates for each ray of a step, of which those with larger errors are drawn more often and count less each. 1
    /// draws all rays alike.
    pub ray_candidates: u32,
    /// The most pixels along a photograph's longer side: larger ones are downscaled when they are loaded, unless a factor is
    /// given. If absent, there is no such limit.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub max_photograph_side: Option<u32>,
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
    /// Refine the cameras' poses.
    pub refine_poses: bool,
    /// With the poses, refine one factor of all focal lengths.
    pub refine_focal_length: bool,
    /// Select the rays to train on anew with every new occupancy, so that none is spent on space that proved empty.
    pub refilter_rays: bool,
    /// Remove tensors whose boxes are empty with every new occupancy. Pictures stay the same, and files get smaller.
    pub prune: bool,
    /// Distances at which rays begin and end, in the dataset's units; found from the cameras if absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub near_far: Option<[f64; 2]>,
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
    /// Weight decay of the factors: the share of themselves that they lose in a step, in learning rates (Loshchilov and Hutter,
    /// 2019). 0 turns it off.
    pub factor_decay: f64,
    /// Weight of the mean absolute density factor in the loss, per axis and scale (paper, Implementation). 0 turns it
    /// off.
    pub density_l1: f64,
    /// Weights in the loss of the mean squared difference between neighboring vertices of density factors, and of appearance
    /// factors (TensoRF's total variation).
    pub density_variation: f64,
    /// See `density_variation`.
    pub appearance_variation: f64,
    /// Weight in the loss of the mean visibility that is not where points were matched between photographs (`prior/stereo.rs`),
    /// over rays through such points. 0 turns it off.
    pub distance_weight: f64,
    /// Russian roulette on colors in training: a sample of less than this visibility weight is shaded with a
    /// probability of its weight over this, and then has this weight. The expected pixel stays the same. 0 shades all
    /// samples.
    pub color_roulette: f64,
    /// Russian roulette on density gradients in training: the threshold in means of a chunk of rays. 0 keeps all
    /// gradients.
    pub density_roulette: f64,
    /// The most bytes of the file: if it is larger, the scene is trained for that size in the end. If absent, there is no such
    /// limit.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub max_file_bytes: Option<u64>,
    /// Components that training gives up.
    pub lean: LeanConfig,
    /// The rules of the march for the last steps.
    pub finish: FinishConfig,
    /// Standard deviation of the factors at the start.
    pub factor_deviation: f64,
    /// Steps after which the factors are upsampled to their next resolution.
    pub upsample_at: Vec<u64>,
    /// Steps after which the occupancy is estimated anew. The first of them shrinks the bounds to it.
    pub occupancy_at: Vec<u64>,
    /// Width of the shell into which space around the inner box is contracted (spec 4.9); if absent, the scene is bounded.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub shell: Option<f64>,
    /// Smallest and largest corner of the inner box of an unbounded scene, in the dataset's units; found from the cameras
    /// if absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub inner_box: Option<[DVec3; 2]>,
    /// Half the largest extent of a bounded scene, in model units. The scales' pitches are relative to it.
    pub half_extent: f64,
    /// The rules of the field and of the march.
    pub field: FieldConfig,
    /// The shape of the decoder.
    pub decoder: DecoderConfig,
    /// The coarse reconstruction.
    pub prior: CoarseOptions,
    /// The prior from tri-vectors alone.
    pub bootstrap: BootstrapOptions,
    /// The scales, coarsest first.
    pub scales: Vec<ScaleConfig>,
}

/// The rules of the field and of the march that training starts from (spec 3.2).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct FieldConfig {
    /// Points that are in the model: covered by all scales, or by any (spec 4.1).
    pub coverage: Coverage,
    /// Weights of the neighbors of a scale (spec 4.4).
    pub aggregation: Aggregation,
    /// Combination of the density features of scales (spec 4.5).
    pub density_reduction: Reduction,
    /// Combination of the appearance features of scales (spec 4.6).
    pub appearance_reduction: Reduction,
    /// See [`Rules::density_shift`].
    pub density_shift: f64,
    /// See [`Rules::distance_scale`].
    pub distance_scale: f64,
    /// The march's step in cells of scale 0, at any of its resolutions.
    pub step_cells: f64,
    /// See [`Rules::min_transmittance`].
    pub min_transmittance: f64,
    /// See [`Rules::min_weight`].
    pub min_weight: f64,
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
    /// as those of a cube with the resolutions below ([`TrainConfig::fitted`]).
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

/// The box of a tensor over the whole scene, in boxes of what is occupied: so that rounding leaves nothing outside.
const WHOLE: f64 = 1.0 + 1e-4;
/// The most cells along an axis (spec 5).
const MAX_CELLS: f64 = 1024.0;

impl TrainConfig {
    /// These settings for a scene on `occupied`, which is in the dataset's space or, for an unbounded scene, in contracted space:
    /// scales with [`ScaleConfig::whole_scene`] get the scene's box.
    ///
    /// # Errors
    ///
    /// If the box of `occupied` has no extent.
    pub fn fitted(&self, occupied: &VoxelBoxes) -> Result<Self, prior::Error> {
        let mut config = self.clone();
        if config.scales.iter().all(|scale| !scale.whole_scene) {
            return Ok(config);
        }
        let map = config.model_from_prior(&occupied.bounds())?;
        let size = WHOLE * occupied.mapped(&map).bounds().size();
        for scale in config.scales.iter_mut().filter(|scale| scale.whole_scene) {
            (scale.pitch, scale.edge, scale.whole_scene) = (size.to_array(), size.to_array(), false);
            for cells in &mut scale.resolutions {
                let all: f64 = cells.iter().map(|&d| f64::from(d)).product();
                let cell = (size.element_product() / all).cbrt();
                *cells = (size / cell).round().clamp(DVec3::ONE, DVec3::splat(MAX_CELLS)).as_uvec3().to_array();
            }
        }
        Ok(config)
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

/// Settings of [`super::bootstrap_prior`].
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

impl Default for FieldConfig {
    fn default() -> Self {
        Self {
            coverage: Coverage::All,
            aggregation: Aggregation::Normalized,
            density_reduction: Reduction::Sum,
            appearance_reduction: Reduction::Sum,
            density_shift: -10.0,
            distance_scale: 25.0,
            step_cells: 0.5,
            min_transmittance: 1e-3,
            min_weight: 1e-4,
        }
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
}

impl Default for LeanConfig {
    fn default() -> Self {
        // Rounds between 0.03 and 0.6 of the steps are as good as later ones, and leave less to compute
        // (docs/experiments/2026-11-25-lean-training.md). The limit leaves lego about 7 million parameters
        // (docs/experiments/2026-11-26-adam.md).
        Self { max_loss: 0.06, max_parameters: None, max_drop: None, during: [1.0 / 30.0, 0.6], rounds: 34 }
    }
}

impl FieldConfig {
    /// The rules with the march's step `step`, in model units.
    pub fn rules(&self, step: f64) -> Rules {
        Rules {
            coverage: self.coverage,
            aggregation: self.aggregation,
            density_reduction: self.density_reduction,
            appearance_reduction: self.appearance_reduction,
            density_shift: self.density_shift,
            distance_scale: self.distance_scale,
            step,
            min_transmittance: self.min_transmittance,
            min_weight: self.min_weight,
            contraction: None,
            sky: None,
        }
    }
}

impl TrainConfig {
    /// Steps of a training for a file's size, after one with these settings: a quarter.
    pub fn steps_for_size(&self) -> u64 {
        self.steps.div_ceil(4)
    }

    /// The contraction of an unbounded scene.
    pub fn contraction(&self) -> Option<Contraction> {
        self.shell.map(|shell| Contraction { shell })
    }

    /// The sky before the first step: about of the background's color in every direction.
    pub fn sky(&self) -> Option<Sky> {
        self.sky_degree.filter(|&degree| degree > 0).map(|degree| Sky::of_color(degree, self.background))
    }

    /// The space of an unbounded scene whose inner box is known.
    pub fn unbounded(&self) -> Option<Unbounded> {
        let [min, max] = self.inner_box?;
        Some(Unbounded::around(&Aabb { min, max }, self.contraction()?))
    }

    /// The map to model space of a prior that fills `bounds`: that of an unbounded scene is there already.
    pub(super) fn model_from_prior(&self, bounds: &Aabb) -> Result<Similarity, prior::Error> {
        match self.shell {
            None => prior::canonical_map(bounds, self.half_extent),
            Some(_) => Ok(Similarity::IDENTITY),
        }
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
