//! Settings of a training run: everything that the result depends on besides the photographs.
//!
//! They are a crate of their own because it is built with little optimization, and its readers and writers are many.
//!
//! [`TrainConfig`] is made of sections, which are the tables of its TOML form (`sections.rs`). A section holds the names, the
//! paper's values and the descriptions of its settings, and `check.rs` their ranges.

#![forbid(unsafe_code)]

mod check;
mod error;
mod exposure;
mod near_names;
mod presets;
mod sections;
#[cfg(test)]
mod tests;
mod toml;

use glam::DVec3;
use serde::{Deserialize, Serialize};

pub use error::ConfigError;
pub use exposure::Exposure;
pub use presets::Preset;
pub use sections::{
    BootstrapOptions, DecoderConfig, FinishConfig, LeanConfig, LossConfig, OptimizerConfig, PhotographConfig,
    PoseConfig, SamplingConfig, ScaleConfig, ScheduleConfig, SpaceConfig,
};

use strivec_capture::prior;
use strivec_capture::prior::{CoarseOptions, Unbounded, VoxelBoxes};
use strivec_format::geometry::{Aabb, Similarity};
use strivec_format::model::{Rules, Sky, TensorCloud};

/// A training run's settings. They have a TOML form, in which every field may be left out.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct TrainConfig {
    /// The preset that the settings began as.
    pub preset: Preset,
    /// Random seed.
    pub seed: u64,
    /// The steps, and what happens after which of them.
    pub schedule: ScheduleConfig,
    /// The photographs, and what is behind the scene in them.
    pub photographs: PhotographConfig,
    /// The refinement of cameras.
    pub poses: PoseConfig,
    /// The rays of a step, and the samples on them that count.
    pub sampling: SamplingConfig,
    /// Start, learning rates and decay of the parameters.
    pub optimizer: OptimizerConfig,
    /// Terms of the loss besides colors.
    pub loss: LossConfig,
    /// Components that training gives up.
    pub lean: LeanConfig,
    /// The rules of the march for the last steps.
    pub finish: FinishConfig,
    /// The space that the scene takes up.
    pub space: SpaceConfig,
    /// The rules of the field and of the march that training starts from (spec 3.2). Other than in a scene, `step` is in
    /// cells of scale 0, at any of its resolutions; [`TrainConfig::rules`] gives the scene's. A contraction makes the
    /// scene unbounded. `sky` is absent: [`PhotographConfig::sky_degree`] sets the sky that is trained.
    #[serde(deserialize_with = "toml::partial_rules")]
    pub model: Rules,
    /// The shape of the decoder.
    pub decoder: DecoderConfig,
    /// The coarse reconstruction.
    pub prior: CoarseOptions,
    /// The prior from tri-vectors alone.
    pub bootstrap: BootstrapOptions,
    /// The scales, coarsest first.
    pub scales: Vec<ScaleConfig>,
}

/// δ for a cloud at its current resolution: this many of its cells, averaged over the axes (spec 4.8).
pub fn march_step(cloud: &TensorCloud, cells: f64) -> f64 {
    cells * cloud.cell_size().element_sum() / 3.0
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

    /// Steps of a training for a file's size, after one with these settings: a quarter.
    pub fn steps_for_size(&self) -> u64 {
        self.schedule.steps.div_ceil(4)
    }

    /// The rules of a scene whose first scale is `cloud`, at its present resolution, before the first step.
    pub fn rules(&self, cloud: &TensorCloud) -> Rules {
        Rules { step: march_step(cloud, self.model.step), sky: self.sky(), ..self.model.clone() }
    }

    /// The sky before the first step: about of the background's color in every direction.
    pub fn sky(&self) -> Option<Sky> {
        let degree = self.photographs.sky_degree.filter(|&degree| degree > 0)?;
        Some(Sky::of_color(degree, self.photographs.background))
    }

    /// The space of an unbounded scene whose inner box is known.
    pub fn unbounded(&self) -> Option<Unbounded> {
        let [min, max] = self.space.inner_box?;
        Some(Unbounded::around(&Aabb { min, max }, self.model.contraction?))
    }

    /// The map to model space of a prior that fills `bounds`: that of an unbounded scene is there already.
    ///
    /// # Errors
    ///
    /// If `bounds` have no extent.
    pub fn model_from_prior(&self, bounds: &Aabb) -> Result<Similarity, prior::Error> {
        match self.model.contraction {
            None => prior::canonical_map(bounds, self.space.half_extent),
            Some(_) => Ok(Similarity::IDENTITY),
        }
    }
}
