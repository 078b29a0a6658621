//! Everything that a training run depends on besides its photographs, and the presets.

use serde::{Deserialize, Serialize};

use super::BootstrapOptions;
use crate::model::{Aggregation, Coverage, DecoderMode, Reduction, Rules};
use crate::prior::{CANONICAL_HALF_EXTENT, CoarseOptions};

/// Steps that the presets' schedules are written for (paper, section "Implementation").
const PRESET_STEPS: u64 = 30_000;
/// Steps of the preset for scans (paper, section "The ScanNet dataset").
const SCAN_STEPS: u64 = 100_000;
/// Shortened runs compute the occupancy no earlier: what is still empty then would be empty for good.
const EARLIEST_OCCUPANCY: u64 = 300;
/// Half the largest extent of a scan in model units: about a room's whole extent in meters.
const SCAN_HALF_EXTENT: f64 = 4.8;

/// A training run's settings. TOML in and out; every field may be left out.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct TrainConfig {
    /// The preset that this began as.
    pub preset: String,
    /// Of every random choice.
    pub seed: u64,
    /// Optimizer steps.
    pub steps: u64,
    /// Rays a step.
    pub batch_rays: usize,
    /// sRGB behind the photographs' transparent parts.
    pub background: [f32; 3],
    /// Whether every ray of a photograph with transparent parts is compared on a random background of its own instead,
    /// so that no part of the scene can pass for background. The prior and all rendering keep `background`.
    pub random_background: bool,
    /// Whether every new occupancy decides anew which rays are drawn, so that none is wasted on what has turned out to be
    /// empty.
    pub refilter_rays: bool,
    /// Whether every new occupancy removes the tensors in whose boxes nothing counts any more. Pictures stay the same, and
    /// files get smaller.
    pub prune: bool,
    /// Where rays begin and end, in the dataset's units; found from the cameras where absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub near_far: Option<[f64; 2]>,
    /// Learning rate of the factors after each restart.
    pub factor_learning_rate: f64,
    /// Learning rate of the appearance matrices and the decoder after each restart.
    pub network_learning_rate: f64,
    /// By what learning rates would fall over a whole run without restarts.
    pub learning_rate_decay: f64,
    /// Weight of the mean absolute density factor, of each axis of each scale, in the loss.
    pub density_l1: f64,
    /// Samples that weigh less are colored at random, with a probability of their weight over this, and then weigh this:
    /// the expected pixel stays the same, at less cost. 0 colors all. Rendering never does this.
    pub color_roulette: f64,
    /// Samples whose density's gradient is smaller than this many of a chunk's means are left out at random, in the same
    /// way. 0 leaves out none.
    pub density_roulette: f64,
    /// Standard deviation of the factors at the start.
    pub factor_deviation: f64,
    /// After these steps the factors go to their next resolution.
    pub upsample_at: Vec<u64>,
    /// After these steps the occupancy is computed anew; at the first the bounds shrink to it.
    pub occupancy_at: Vec<u64>,
    /// Half the largest extent of the scene in model units: what the scales' pitches are made for.
    pub half_extent: f64,
    /// The field's and the march's rules.
    pub field: FieldConfig,
    /// The MLP.
    pub decoder: DecoderConfig,
    /// The coarse reconstruction.
    pub prior: CoarseOptions,
    /// What takes its place where tensors of our own find the scene.
    pub bootstrap: BootstrapOptions,
    /// Coarsest first.
    pub scales: Vec<ScaleConfig>,
}

/// The rules that training starts from.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct FieldConfig {
    /// Whether the model is where all scales are.
    pub coverage_all: bool,
    /// Whether neighbors' weights sum to one, or are clamped as the authors' are.
    pub normalized: bool,
    /// Whether scales' density features are averaged instead of added.
    pub density_mean: bool,
    /// Whether scales' appearance features are averaged instead of added.
    pub appearance_mean: bool,
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

/// The decoder's shape.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct DecoderConfig {
    /// Where it is called.
    pub mode: DecoderMode,
    /// P.
    pub features: u32,
    /// Frequencies of PE(features).
    pub feature_frequencies: u32,
    /// Frequencies of PE(direction).
    pub direction_frequencies: u32,
    /// Widths of the hidden layers.
    pub hidden: Vec<u32>,
}

/// One scale's tensors. Lengths are in model units, per axis.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ScaleConfig {
    /// Distance between lattice cells.
    pub pitch: [f64; 3],
    /// What a tensor covers.
    pub edge: [f64; 3],
    /// Cells of a tensor: at the start, and after each upsampling.
    pub resolutions: Vec<[u32; 3]>,
    /// Density components.
    pub density_rank: u32,
    /// Appearance components.
    pub appearance_rank: u32,
    /// Neighbors that a point aggregates.
    pub top_k: u32,
}

impl Default for TrainConfig {
    fn default() -> Self {
        Self {
            preset: "48".into(),
            seed: 0,
            steps: PRESET_STEPS,
            batch_rays: 4096,
            background: [1.0; 3],
            random_background: false,
            refilter_rays: true,
            prune: false,
            near_far: None,
            factor_learning_rate: 0.02,
            network_learning_rate: 0.001,
            learning_rate_decay: 0.1,
            density_l1: 1e-5,
            color_roulette: 0.001,
            density_roulette: 1.0,
            factor_deviation: 0.2,
            upsample_at: vec![2000, 3000, 4000, 5500, 7000],
            occupancy_at: vec![2000, 4000, 8000, 16_000],
            half_extent: CANONICAL_HALF_EXTENT,
            field: FieldConfig::default(),
            decoder: DecoderConfig::default(),
            prior: CoarseOptions::default(),
            bootstrap: BootstrapOptions::default(),
            scales: preset_scales(48),
        }
    }
}

impl Default for FieldConfig {
    fn default() -> Self {
        Self {
            coverage_all: true,
            normalized: true,
            density_mean: false,
            appearance_mean: false,
            density_shift: -10.0,
            distance_scale: 25.0,
            step_cells: 0.5,
            min_transmittance: 1e-3,
            min_weight: 1e-4,
        }
    }
}

impl FieldConfig {
    /// The rules with the step `step`.
    pub fn rules(&self, step: f64) -> Rules {
        let reduction = |mean| if mean { Reduction::Mean } else { Reduction::Sum };
        Rules {
            coverage: if self.coverage_all { Coverage::All } else { Coverage::Any },
            aggregation: if self.normalized { Aggregation::Normalized } else { Aggregation::Clamped },
            density_reduction: reduction(self.density_mean),
            appearance_reduction: reduction(self.appearance_mean),
            density_shift: self.density_shift,
            distance_scale: self.distance_scale,
            step,
            min_transmittance: self.min_transmittance,
            min_weight: self.min_weight,
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

/// The paper's three scales (DESIGN, section 2: Presets).
fn preset_scales(appearance_rank: u32) -> Vec<ScaleConfig> {
    vec![
        scale([0.4, 0.6], [29, 43, 65, 85, 103, 121], [32, appearance_rank], 4),
        scale([0.2, 0.3], [15, 23, 35, 43, 53, 61], [24, appearance_rank], 4),
        scale([0.1, 0.15], [7, 11, 17, 21, 27, 31], [16, appearance_rank], 4),
    ]
}

/// Four scales for rooms (DESIGN, section 2: Presets). In the end cells are of about one size on all scales, as those of
/// [`preset_scales`], and as large relative to the finest pitch.
fn scan_scales() -> Vec<ScaleConfig> {
    vec![
        scale([3.0, 5.0], [83, 123, 185, 243, 293, 345], [24, 48], 4),
        scale([1.7, 3.2], [53, 79, 119, 155, 189, 221], [24, 48], 4),
        scale([0.6, 1.6], [27, 39, 59, 77, 95, 111], [16, 48], 2),
        scale([0.3, 0.8], [13, 19, 29, 39, 47, 55], [12, 48], 2),
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
        pitch: [pitch; 3],
        edge: [edge; 3],
        resolutions: resolutions.map(|d| [d; 3]).to_vec(),
        density_rank,
        appearance_rank,
        top_k,
    }
}

/// What is wrong with a configuration.
#[derive(Debug, thiserror::Error)]
pub enum ConfigError {
    /// No preset of this name.
    #[error("preset: expected one of {}, found {name:?}", TrainConfig::PRESETS.join(", "))]
    UnknownPreset {
        /// What was asked for.
        name: String,
    },
    /// Not TOML, or not these fields.
    #[error("{0}")]
    Toml(Box<toml::de::Error>),
    /// A value that makes no sense.
    #[error("{place}: expected {expected}, found {found}")]
    Value {
        /// The field.
        place: String,
        /// What it should be.
        expected: String,
        /// What it is.
        found: String,
    },
}

impl TrainConfig {
    /// The presets' names.
    pub const PRESETS: [&str; 8] = ["12", "24", "48", "96", "fast", "per-ray", "best", "scannet"];

    /// The preset `name`.
    ///
    /// # Errors
    ///
    /// [`ConfigError::UnknownPreset`].
    pub fn preset(name: &str) -> Result<Self, ConfigError> {
        let mut preset = Self { preset: name.into(), ..Self::default() };
        preset.scales = match name {
            "per-ray" => {
                preset.decoder.mode = DecoderMode::PerRay;
                preset.refilter_rays = false;
                preset.color_roulette = 0.002;
                preset_scales(48)
            }
            "best" => {
                preset.decoder.mode = DecoderMode::Residual;
                // Highlights come and go within a few degrees.
                preset.decoder.direction_frequencies = 6;
                preset.color_roulette = 0.002;
                preset_scales(48)
            }
            "fast" => {
                preset.refilter_rays = false;
                preset_scales(48).into_iter().take(2).map(|s| ScaleConfig { top_k: 2, ..s }).collect()
            }
            "scannet" => {
                preset = preset.with_steps(SCAN_STEPS);
                preset.half_extent = SCAN_HALF_EXTENT;
                preset.field.density_mean = true;
                scan_scales()
            }
            "12" | "24" | "48" | "96" => preset_scales(name.parse().expect("a number")),
            _ => return Err(ConfigError::UnknownPreset { name: name.into() }),
        };
        Ok(preset)
    }

    /// Reads a configuration; what it leaves out is the preset's that it names, or "48"'s. Another `preset` takes the place
    /// of the file's, of its scales and of its decoder.
    ///
    /// # Errors
    ///
    /// Names the line, or the first field that makes no sense.
    pub fn from_toml(text: &str, preset: Option<&str>) -> Result<Self, ConfigError> {
        let toml_error = |e| ConfigError::Toml(Box::new(e));
        let mut given: toml::Table = toml::from_str(text).map_err(toml_error)?;
        // Only the text itself has lines that an error can name.
        toml::from_str::<Self>(text).map_err(toml_error)?;
        if let Some(preset) = preset {
            given.insert("preset".into(), preset.into());
            given.remove("scales");
            given.remove("decoder");
        }
        let preset = given.get("preset").and_then(toml::Value::as_str).unwrap_or("48");
        let mut whole = toml::Table::try_from(Self::preset(preset)?).expect("a configuration has a TOML form");
        overlay(&mut whole, given);
        let config: Self = whole.try_into().map_err(toml_error)?;
        config.check()?;
        Ok(config)
    }

    /// The configuration as commented-free TOML that [`TrainConfig::from_toml`] reads back.
    pub fn to_toml(&self) -> String {
        toml::to_string_pretty(self).expect("a configuration has a TOML form")
    }

    /// The same run in `steps` steps: the schedule is scaled along, but where nothing counts is not asked before step
    /// 300, when there is still hardly anything anywhere.
    pub fn with_steps(self, steps: u64) -> Self {
        let scaled = |at: &u64| (*at as f64 * steps as f64 / self.steps as f64).round().max(1.0) as u64;
        let mut occupancy_at: Vec<u64> =
            self.occupancy_at.iter().map(|at| scaled(at).max(EARLIEST_OCCUPANCY.min(*at))).collect();
        occupancy_at.dedup();
        Self { upsample_at: self.upsample_at.iter().map(scaled).collect(), occupancy_at, steps, ..self }
    }

    /// Checks what the types do not.
    ///
    /// # Errors
    ///
    /// Names the first field that makes no sense.
    pub fn check(&self) -> Result<(), ConfigError> {
        let error = |place: String, expected: &str, found: String| ConfigError::Value {
            place,
            expected: expected.into(),
            found,
        };
        let positive = |place: &str, value: f64| {
            let valid = value > 0.0 && value.is_finite();
            if valid { Ok(()) } else { Err(error(place.into(), "a positive number", value.to_string())) }
        };
        positive("steps", self.steps as f64)?;
        positive("batch_rays", self.batch_rays as f64)?;
        positive("factor_learning_rate", self.factor_learning_rate)?;
        positive("network_learning_rate", self.network_learning_rate)?;
        positive("learning_rate_decay", self.learning_rate_decay)?;
        positive("factor_deviation", self.factor_deviation)?;
        positive("half_extent", self.half_extent)?;
        positive("field.distance_scale", self.field.distance_scale)?;
        positive("field.step_cells", self.field.step_cells)?;
        let least = self.decoder.mode.min_features();
        if self.decoder.features < least {
            let expected = format!("at least {least} where the mode is {}", self.decoder.mode.name());
            return Err(error("decoder.features".into(), &expected, self.decoder.features.to_string()));
        }
        for (place, value) in [
            ("density_l1", self.density_l1),
            ("color_roulette", self.color_roulette),
            ("density_roulette", self.density_roulette),
        ] {
            if !(value >= 0.0 && value.is_finite()) {
                return Err(error(place.into(), "a number of at least 0", value.to_string()));
            }
        }
        if let Some([near, far]) = self.near_far
            && !(near >= 0.0 && near < far && far.is_finite())
        {
            return Err(error("near_far".into(), "0 <= near < far", format!("{near} and {far}")));
        }
        if !self.background.iter().all(|c| (0.0..=1.0).contains(c)) {
            return Err(error("background".into(), "numbers in [0, 1]", format!("{:?}", self.background)));
        }
        self.bootstrap.check()?;
        if self.scales.is_empty() {
            return Err(error("scales".into(), "at least one", "none".into()));
        }
        for (i, scale) in self.scales.iter().enumerate() {
            let place = |what: &str| format!("scales[{i}].{what}");
            for a in 0..3 {
                positive(&place("pitch"), scale.pitch[a])?;
                positive(&place("edge"), scale.edge[a])?;
                if scale.edge[a] < scale.pitch[a] {
                    let found = format!("edge {} and pitch {}", scale.edge[a], scale.pitch[a]);
                    return Err(error(place("edge"), "at least the pitch, or tensors leave gaps", found));
                }
            }
            positive(&place("density_rank"), f64::from(scale.density_rank))?;
            positive(&place("appearance_rank"), f64::from(scale.appearance_rank))?;
            if scale.resolutions.len() != self.upsample_at.len() + 1 {
                let found = format!("{} and {}", scale.resolutions.len(), self.upsample_at.len());
                return Err(error(place("resolutions"), "one more than upsample_at has", found));
            }
            if scale.resolutions.iter().flatten().any(|&d| d == 0) {
                return Err(error(place("resolutions"), "at least 1", "0".into()));
            }
        }
        Ok(())
    }
}

/// Puts what is `given` in place of what is there, table by table.
fn overlay(table: &mut toml::Table, given: toml::Table) {
    for (key, value) in given {
        match (table.get_mut(&key), value) {
            (Some(toml::Value::Table(inner)), toml::Value::Table(given)) => overlay(inner, given),
            (_, value) => drop(table.insert(key, value)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_preset_survives_its_own_toml() {
        for name in TrainConfig::PRESETS {
            let preset = TrainConfig::preset(name).unwrap();
            preset.check().unwrap();
            assert_eq!(TrainConfig::from_toml(&preset.to_toml(), None).unwrap(), preset);
        }
    }

    #[test]
    fn a_file_that_names_a_preset_gets_its_scales() {
        let config = TrainConfig::from_toml("preset = \"fast\"\nsteps = 100", None).unwrap();
        assert_eq!((config.scales.len(), config.scales[0].top_k, config.steps), (2, 2, 100));
        let mode = |text| TrainConfig::from_toml(text, None).unwrap().decoder.mode;
        assert_eq!(mode("preset = \"per-ray\"\n[decoder]\nfeatures = 9"), DecoderMode::PerRay);
        assert_eq!(mode("[decoder]\nfeatures = 9"), DecoderMode::PerSample);
        let text = "preset = \"per-ray\"\nseed = 7\n[decoder]\nmode = \"residual\"";
        assert_eq!(mode(text), DecoderMode::Residual);
        let per_ray = TrainConfig::preset("per-ray").unwrap();
        assert_eq!(TrainConfig::from_toml(text, Some("per-ray")).unwrap(), TrainConfig { seed: 7, ..per_ray });
    }

    #[test]
    fn unknown_fields_and_senseless_values_are_named() {
        let message = |text| TrainConfig::from_toml(text, None).unwrap_err().to_string();
        assert!(message("stepz = 3").contains("stepz"));
        assert!(message("steps = 0").contains("steps"));
        assert!(message("half_extent = 0.0").contains("half_extent"));
        assert!(message("preset = \"7\"").contains("12, 24"));
        assert!(message("background = [2.0, 0.0, 0.0]").contains("background"));
        assert!(message("[decoder]\nmode = \"residual\"\nfeatures = 2").contains("at least 3"));
        for mode in DecoderMode::ALL.map(DecoderMode::name) {
            assert!(message("[decoder]\nmode = \"each\"").contains(mode), "{mode}");
        }
    }

    #[test]
    fn cells_of_the_scan_preset_are_as_fine_as_those_of_48() {
        let (scan, usual) = (TrainConfig::preset("scannet").unwrap(), TrainConfig::preset("48").unwrap());
        assert_eq!((scan.steps, scan.upsample_at.len(), scan.scales.len()), (100_000, 5, 4));
        let finest = |config: &TrainConfig, upsampled: usize| {
            let scale = config.scales.last().unwrap();
            scale.edge[0] / f64::from(scale.resolutions[upsampled][0]) / scale.pitch[0]
        };
        for upsampled in 0..6 {
            let ratio = finest(&scan, upsampled) / finest(&usual, upsampled);
            assert!((0.9..1.1).contains(&ratio), "{upsampled}: {ratio}");
            let cell = |scale: &ScaleConfig| scale.edge[0] / f64::from(scale.resolutions[upsampled][0]);
            let ratio = cell(&scan.scales[0]) / cell(&scan.scales[3]);
            assert!((0.9..1.1).contains(&ratio), "{upsampled}: {ratio}");
        }
    }

    #[test]
    fn scaling_the_steps_scales_the_schedule() {
        let config = TrainConfig::preset("24").unwrap().with_steps(3000);
        assert_eq!(config.upsample_at, [200, 300, 400, 550, 700]);
        assert_eq!(config.occupancy_at, [300, 400, 800, 1600]);
        let short = TrainConfig::preset("scannet").unwrap().with_steps(1000);
        assert_eq!(short.occupancy_at, [300, 533]);
    }
}
