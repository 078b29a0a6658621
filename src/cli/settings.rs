//! Options shared by commands that train.

use std::path::{Path, PathBuf};

use clap::ValueEnum;
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};

use super::dataset::DatasetOptions;
use super::observer::ConsoleObserver;
use super::{Context, Error, quantity};
use strivec_capture::dataset::LoadOptions;
use strivec_format::container::Encoding;
use strivec_recipe as recipe;
use strivec_recipe::Photographs;
use strivec_train::{Budget, Preset, TrainConfig};

/// The settings of a training.
#[derive(Clone, Debug, clap::Args)]
pub(super) struct Settings {
    /// Model and schedule [default: the configuration's, else best]
    #[arg(long, value_name = "NAME", value_parser = presets())]
    preset: Option<Preset>,
    #[command(flatten)]
    pub(super) basics: Basics,
    /// Optimizer steps; the schedule scales with them [default: the preset's]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    steps: Option<u64>,
}

/// Settings that also apply to training an existing scene.
#[derive(Clone, Debug, clap::Args)]
pub(super) struct Basics {
    /// TOML settings, as printed by `train --print-config`
    #[arg(long, value_name = "TOML")]
    pub(super) config: Option<PathBuf>,
    /// Set one key of the settings, as in lean.max_loss=0.05; repeatable
    ///
    /// Overrides --preset, --config and the schedule of --steps. The key is that of `train --print-config`, with dots between
    /// tables and with indices of lists, as in scales.0.top_k=2. The value is TOML; a single word needs no quotes.
    #[arg(long, value_name = "KEY=VALUE")]
    pub(super) set: Vec<String>,
    /// Random seed [default: the configuration's, else 0]
    #[arg(long, value_name = "S")]
    seed: Option<u64>,
    /// Downscale photographs N times [default: to fit --max-memory]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..), help_heading = "Dataset")]
    downscale: Option<u32>,
    /// Use every Nth photograph only
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = every, help_heading = "Dataset")]
    every: usize,
    #[command(flatten)]
    pub(super) dataset: DatasetOptions,
}

/// Reads the name of a preset; help lists all names with their purposes.
pub(super) fn presets() -> impl TypedValueParser<Value = Preset> {
    let value = |preset: Preset| PossibleValue::new(preset.name()).help(preset.purpose());
    PossibleValuesParser::new(Preset::ALL.map(value)).try_map(|name| name.parse())
}

/// The settings of `preset`, overridden by those of the file `path`; either may be absent.
fn configuration(preset: Option<Preset>, path: Option<&Path>) -> Result<TrainConfig, Error> {
    match path {
        Some(path) => {
            let text = std::fs::read_to_string(path).map_err(Error::io("read", path))?;
            let preset = preset.map(Preset::name);
            TrainConfig::from_toml(&text, preset).map_err(|error| of_toml(path, &error.to_string()))
        }
        None => Ok(preset.unwrap_or_default().config()),
    }
}

/// `config` with the `assignments` of `--set`.
pub(super) fn with_assignments(config: TrainConfig, assignments: &[String]) -> Result<TrainConfig, Error> {
    config
        .with_assignments(assignments)
        .map_err(|error| Error::Usage(format!("--set: {}", error.to_string().trim_end().replace('\n', " "))))
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

    /// The settings: `preset`, overridden by the file, in so many `steps`, overridden by single settings.
    pub(super) fn configuration(&self, preset: Option<Preset>, steps: Option<u64>) -> Result<TrainConfig, Error> {
        let mut config = configuration(preset, self.config.as_deref())?;
        if let Some(steps) = steps {
            config = config.with_steps(steps);
        }
        let mut config = with_assignments(config, &self.set)?;
        config.seed = self.seed.unwrap_or(config.seed);
        Ok(config)
    }
}

impl Settings {
    /// The settings from all arguments.
    pub(super) fn configuration(&self) -> Result<TrainConfig, Error> {
        self.basics.configuration(self.preset, self.steps)
    }
}

/// Adjustments of the settings to the photographs and to a budget, once the prior is known.
#[derive(Clone, Debug, clap::Args)]
#[group(id = "fitting", multiple = true)]
pub(super) struct Fitting {
    /// Fit tensors and ranks to the scene's extent and the photographs' detail
    ///
    /// Resolutions are chosen as well, and space that no photograph shows is dropped.
    #[arg(long)]
    auto: bool,
    /// Keep at most N parameters, as in 500k or 3.5M [default: no limit]
    ///
    /// Training gives up components until no more are left. With `--set lean.max_loss=0`, begin with no more: reduce resolution, then components, then fine scales.
    #[arg(long, value_name = "N", value_parser = quantity::count)]
    max_params: Option<u64>,
    /// Train for a file of at most SIZE, as in 2MB or 700kB [default: no limit]
    ///
    /// Components are given up until the rest fits with 3 bits for each number. A quarter of the steps more is then trained
    /// with numbers rounded as in the file.
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
