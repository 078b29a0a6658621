//! Options shared by commands that train.

use std::path::{Path, PathBuf};

use clap::ValueEnum;

use super::dataset::DatasetOptions;
use super::named_value::one_of;
use super::numbers::boxed;
use super::observer::ConsoleObserver;
use super::{Context, Error, quantity};
use strivec_capture::dataset::LoadOptions;
use strivec_format::container::Encoding;
use strivec_format::geometry::Aabb;
use strivec_format::model::Sky;
use strivec_train::recipe;
use strivec_train::recipe::Photographs;
use strivec_train::{Budget, Exposure, LeanConfig, TrainConfig};

/// Width of the shell of unbounded scenes (paper: the authors' runs).
const DEFAULT_SHELL: f64 = 0.4;

/// The settings of a training.
#[derive(Clone, Debug, clap::Args)]
pub(super) struct Settings {
    /// Model and schedule [default: the configuration's, else best]
    #[arg(long, value_enum)]
    pub(super) preset: Option<Preset>,
    #[command(flatten)]
    pub(super) basics: Basics,
    /// Optimizer steps; the whole schedule scales with them [default: the preset's]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    pub(super) steps: Option<u64>,
    /// Background color for transparent pixels [default: white]
    #[arg(long, value_enum)]
    pub(super) background: Option<Background>,
    /// Degree of a learned sky, the color behind the scene by direction, 1 to 4; 0 for the background color [default:
    /// the configuration's, else 2 in an unbounded scene part of which is too far away to tell where, else 0]
    #[arg(long, value_name = "DEGREE", value_parser = clap::value_parser!(u32).range(..=i64::from(Sky::MAX_DEGREE)))]
    pub(super) sky: Option<u32>,
    /// Distance at which rays begin, in dataset units [default: the dataset's]
    #[arg(long, value_name = "LENGTH", requires = "far")]
    pub(super) near: Option<f64>,
    /// Distance at which rays end, in dataset units [default: the dataset's]
    #[arg(long, value_name = "LENGTH", requires = "near")]
    pub(super) far: Option<f64>,
    /// The scene has no edge: what is around the inner box is contracted into a shell
    #[arg(long)]
    unbounded: bool,
    /// The two corners of the inner box of an unbounded scene, in dataset units [default: from the cameras]
    #[arg(long, value_name = "X,Y,Z,X,Y,Z", value_parser = boxed, allow_hyphen_values = true)]
    inner_box: Option<Aabb>,
    /// Fit the exposure and the white balance of each photograph [default: the configuration's, else auto: if it explains
    /// much of the error]
    #[arg(long, value_parser = one_of(Exposure::ALL, Exposure::name))]
    exposure: Option<Exposure>,
    /// Refine the cameras' poses, and write them beside the scene as FILE.poses.json
    #[arg(long)]
    refine_poses: bool,
    /// With the poses, refine the focal lengths: one factor for all photographs
    #[arg(long)]
    refine_focal_length: bool,
    /// Remove tensors whose boxes turn out to be empty during training: smaller files, the same pictures
    #[arg(long)]
    prune: bool,
    /// Keep all components of all tensors [default: training gives up those that the pictures hardly depend on]
    #[arg(long)]
    full: bool,
}

/// Settings that also apply to training an existing scene.
#[derive(Clone, Debug, clap::Args)]
pub(super) struct Basics {
    /// TOML settings, as printed by `train --print-config`; command-line flags override them
    #[arg(long, value_name = "TOML")]
    pub(super) config: Option<PathBuf>,
    /// Rays per step [default: the preset's]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    batch: Option<u32>,
    /// Downscale photographs N times [default: 1, or as often as --max-memory requires]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    downscale: Option<u32>,
    /// Use every Nth photograph only
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = every)]
    every: usize,
    #[command(flatten)]
    pub(super) dataset: DatasetOptions,
    /// Random seed [default: the configuration's, else 0]
    #[arg(long, value_name = "S")]
    seed: Option<u64>,
}

/// The settings of `preset`, overridden by those of the file `path`; either may be absent.
pub(super) fn configuration(preset: Option<&str>, path: Option<&Path>) -> Result<TrainConfig, Error> {
    match path {
        Some(path) => {
            let text = std::fs::read_to_string(path).map_err(Error::io("read", path))?;
            TrainConfig::from_toml(&text, preset).map_err(|error| of_toml(path, &error.to_string()))
        }
        None => {
            TrainConfig::preset(preset.unwrap_or(TrainConfig::DEFAULT_PRESET)).map_err(|e| Error::Usage(e.to_string()))
        }
    }
}

/// The error of the file `path`; the message about TOML has further lines that show the place.
fn of_toml(path: &Path, message: &str) -> Error {
    let mut lines = message.trim_end().lines().map(str::to_owned);
    let error = Error::malformed(path)(lines.next().unwrap_or_default());
    match lines.collect::<Vec<_>>() {
        lines if lines.is_empty() => error,
        lines => Error::WithLines { error: Box::new(error), lines },
    }
}

fn every(text: &str) -> Result<usize, String> {
    text.parse().ok().filter(|n| *n > 0).ok_or_else(|| "not a whole number of at least 1".into())
}

impl Basics {
    /// Selection of the photographs to train on in `folder`, and their size: if none is given, at most `max_side` pixels or,
    /// without this either, the largest that fits into the memory for them.
    pub(super) fn photographs(
        &self,
        folder: &Path,
        max_side: Option<u32>,
        session: &Context,
    ) -> Result<LoadOptions, Error> {
        let options = LoadOptions { every: self.every, ..self.dataset.load_options(1) };
        let photographs = Photographs { options, downscale: self.downscale };
        Ok(photographs.load_options(folder, max_side, &mut ConsoleObserver::unstoppable(&session.console))?)
    }

    /// The settings: `preset`, overridden by the file, overridden by single arguments.
    pub(super) fn configuration(&self, preset: Option<&str>) -> Result<TrainConfig, Error> {
        let mut config = configuration(preset, self.config.as_deref())?;
        config.batch_rays = self.batch.map_or(config.batch_rays, |b| b as usize);
        config.seed = self.seed.unwrap_or(config.seed);
        Ok(config)
    }
}

impl Settings {
    /// The settings from all arguments.
    pub(super) fn configuration(&self) -> Result<TrainConfig, Error> {
        let mut config = self.basics.configuration(self.preset.map(Preset::name))?;
        config.prune |= self.prune;
        if self.full {
            config.lean = LeanConfig::off();
        }
        config.refine_focal_length |= self.refine_focal_length;
        config.refine_poses |= self.refine_poses || config.refine_focal_length;
        config.exposure = self.exposure.unwrap_or(config.exposure);
        config.background = self.background.map_or(config.background, Background::color);
        config.sky_degree = self.sky.or(config.sky_degree);
        if self.unbounded || self.inner_box.is_some() {
            config.shell.get_or_insert(DEFAULT_SHELL);
        }
        config.inner_box = self.inner_box.map(|inner| [inner.min, inner.max]).or(config.inner_box);
        if let (Some(near), Some(far)) = (self.near, self.far) {
            config.near_far = Some([near, far]);
        }
        if let Some(steps) = self.steps {
            config = config.with_steps(steps);
        }
        config.check().map_err(|e| Error::Usage(e.to_string()))?;
        Ok(config)
    }
}

/// Adjustments of the settings to the photographs and to a budget, once the prior is known.
#[derive(Clone, Debug, clap::Args)]
#[group(id = "fitting", multiple = true)]
pub(super) struct Fitting {
    /// Derive tensors, resolutions and ranks from the scene's extent and the photographs' detail, and drop space that no photograph shows
    #[arg(long)]
    auto: bool,
    /// Give up components until at most N parameters remain, as in 500k or 3.5M; with --full, begin with no more:
    /// reduce resolution, then components, then fine scales [default: no limit]
    #[arg(long, value_name = "N", value_parser = quantity::count)]
    max_params: Option<u64>,
    /// Train for a packaged file of at most SIZE, as in 2MB or 700kB: give up components until the rest fits with 3 bits for
    /// each number, then train a quarter of the steps more with numbers rounded as in the file [default: no limit]
    #[arg(long, value_name = "SIZE", value_parser = quantity::size)]
    max_size: Option<u64>,
}

impl Fitting {
    /// Settings are fitted to the photographs, without a budget.
    pub(super) fn is_by_photographs_alone(&self) -> bool {
        self.auto && self.max_params.is_none() && self.max_size.is_none()
    }

    /// The library's options.
    pub(super) fn fitting(&self) -> recipe::Fitting {
        let budget = Budget { parameters: self.max_params, file_bytes: self.max_size };
        recipe::Fitting { to_photographs: self.auto, budget }
    }
}

/// Presets of model and schedule.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(super) enum Preset {
    /// 12 appearance components
    #[value(name = "12")]
    P12,
    /// 24 appearance components
    #[value(name = "24")]
    P24,
    /// 48 appearance components, the paper's main model
    #[value(name = "48")]
    P48,
    /// 96 appearance components
    #[value(name = "96")]
    P96,
    /// Two scales, two neighbors per scale, for quick tries
    Fast,
    /// 48 appearance components, the network evaluated once per ray instead of once per sample
    PerRay,
    /// per-ray plus a color per sample and more view-dependent detail: the best pictures, nearly as fast
    Best,
    /// A first look within about a minute, from photographs of at most 256 pixels a side; about three with --steps 8000
    Preview,
    /// Four scales, 100 000 steps, for rooms
    Scannet,
    /// Two scales in contracted space, 120 000 steps, for captures without an edge
    #[value(name = "360")]
    P360,
}

impl Preset {
    /// The name on the command line and in configurations.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::P12 => "12",
            Self::P24 => "24",
            Self::P48 => "48",
            Self::P96 => "96",
            Self::Fast => "fast",
            Self::PerRay => "per-ray",
            Self::Best => "best",
            Self::Preview => "preview",
            Self::Scannet => "scannet",
            Self::P360 => "360",
        }
    }
}

/// Encoding of the factors.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub(super) enum Precision {
    /// 32-bit floating point: exactly as trained
    F32,
    /// 16-bit floating point: half the size
    #[default]
    F16,
}

impl Precision {
    /// As the container names it.
    pub(super) fn factors(self) -> Encoding {
        match self {
            Self::F32 => Encoding::F32,
            Self::F16 => Encoding::F16,
        }
    }
}

/// Background colors of photographs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(super) enum Background {
    White,
    Black,
}

impl Background {
    /// The color in sRGB.
    pub(super) fn color(self) -> [f32; 3] {
        match self {
            Self::White => [1.0; 3],
            Self::Black => [0.0; 3],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_command_line_has_all_presets_and_no_others() {
        let names: Vec<_> = Preset::value_variants().iter().map(|p| p.name()).collect();
        assert_eq!(names, TrainConfig::PRESETS);
        for preset in Preset::value_variants() {
            assert_eq!(Preset::from_str(preset.name(), false), Ok(*preset));
        }
    }
}
