//! `strivec-pack pack`.

use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

use serde::Serialize;

use super::convert::warn_of_growth;
use super::extras::Extras;
use super::input::{self, Inputs, LimitArgs, Outputs};
use crate::dataset::DatasetOptions;
use crate::observer::ConsoleObserver;
use crate::progress::Progress;
use crate::scene_file::scene_error;
use crate::state_file::{StateFile, read_state, run_steps};
use crate::table::plural;
use crate::{Context, Error, quantity};
use strivec_capture::dataset;
use strivec_capture::dataset::{Dataset, LoadOptions, Photograph};
use strivec_format::container::{EncodeOptions, Metadata, Quality, SceneFile, TrainingCamera};
use strivec_format::digits::grouped;
use strivec_format::escape::escaped_path;
use strivec_format::model::Scene;
use strivec_format::psnr::psnr_of_mse;
use strivec_recipe::{PackOptions, Packing};
use strivec_train::pack;
use strivec_train::pack::{Candidate, Goal, MAX_TRIED, search};
use strivec_train::{FactorImportance, Preset, TrainConfig, Trainer};

/// Arguments of `strivec-pack pack`.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Examples:
  strivec-pack pack lego.strivec -o small.strivec
  strivec-pack pack lego.strivec -o small.strivec --max-loss 0.05dB
  strivec-pack pack 'scenes/*.strivec' -o packed --target-size 2MB
  strivec-pack pack lego.strivec -o small.strivec --target-size 2MB --tune lego")]
pub(super) struct Args {
    #[command(flatten)]
    inputs: Inputs,
    /// File to write, folder for several inputs or a pattern, or - for standard output
    #[arg(long, short)]
    output: PathBuf,
    #[command(flatten)]
    goal: GoalArgs,
    #[command(flatten)]
    data: DataArgs,
    #[command(flatten)]
    tuning: TuningArgs,
    #[command(flatten)]
    extras: Extras,
    /// Also write the cameras of the training photographs; they reveal where the photographer stood
    #[arg(long, requires = "data")]
    with_cameras: bool,
    /// Dry run: print what would be written
    #[arg(long)]
    dry_run: bool,
}

/// Photographs to judge by.
#[derive(Debug, clap::Args)]
struct DataArgs {
    /// Dataset folder: measure --max-loss against its photographs and store their PSNR in the file
    #[arg(long, value_name = "DATASET")]
    data: Option<PathBuf>,
    /// Split of the dataset: train, val, test or all; for Blender's layout S of transforms_S.json. The choice of the encoding
    /// depends on it, so test views are best kept aside
    #[arg(long, value_name = "S", default_value = "train", requires = "data")]
    split: String,
    /// Downscale photographs N times
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..))]
    downscale: u32,
    /// Use every Nth photograph only, beginning with the first
    #[arg(long, value_name = "N", default_value_t = 10, value_parser = clap::value_parser!(u32).range(1..), requires = "data")]
    every: u32,
    #[command(flatten)]
    dataset: DatasetOptions,
}

impl DataArgs {
    /// The photographs, and what they are called.
    fn load(&self) -> Result<Option<(Vec<Photograph>, String)>, Error> {
        let Some(folder) = &self.data else { return Ok(None) };
        let options = LoadOptions { every: self.every as usize, ..self.dataset.load_options(self.downscale) };
        let Dataset { name, views, .. } = dataset::load(folder, &self.split, &options)?;
        let mut what = format!("{name}, {} of {}", plural(views.len(), "view"), self.split);
        if self.downscale > 1 {
            what += &format!(", {} times smaller", self.downscale);
        }
        Ok(Some((views, what)))
    }
}

/// Training of the scene for its file.
#[derive(Debug, clap::Args)]
struct TuningArgs {
    /// Train the scene for --target-size, on the photographs of this dataset's training split: better pictures for the same
    /// bytes, in about a quarter of the time of the training before
    #[arg(long, value_name = "DATASET", requires = "target_size")]
    tune: Option<PathBuf>,
    /// Optimizer steps of --tune [default: a quarter of the preset's]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..), requires = "tune")]
    tune_steps: Option<u64>,
    /// Resume an interrupted --tune from OUTPUT.state; the result is byte-identical to an uninterrupted run
    #[arg(long, requires = "tune", conflicts_with = "tune_steps")]
    resume: bool,
}

impl Args {
    /// The cameras of the training photographs in the space of `scene`'s model, if a dataset is named.
    fn training_cameras(&self, scene: &Scene) -> Result<Vec<TrainingCamera>, Error> {
        let Some(folder) = self.data.data.as_ref().or(self.tuning.tune.as_ref()) else { return Ok(Vec::new()) };
        let DataArgs { dataset, downscale, .. } = &self.data;
        let cameras = dataset::load_cameras(folder, "train", None, &dataset.load_options(*downscale))?;
        let map = scene.frame.model_from_dataset;
        Ok(cameras.iter().map(|named| TrainingCamera::from(&named.camera.mapped(&map))).collect())
    }
}

/// What a file should be.
#[derive(Debug, clap::Args)]
#[group(multiple = false)]
struct GoalArgs {
    /// Lossless: keep the file's encoding
    #[arg(long)]
    lossless: bool,
    /// Target PSNR to the scene's own pictures [default: balanced]
    #[arg(long, value_enum)]
    quality: Option<QualityLevel>,
    /// Largest loss of PSNR, in dB, as in 0.05dB
    #[arg(long, value_name = "DB", value_parser = decibels)]
    max_loss: Option<f64>,
    /// Largest file size, as in 2MB or 700kB
    #[arg(long, value_name = "SIZE", value_parser = quantity::size)]
    target_size: Option<u64>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
enum QualityLevel {
    /// 60 dB to the scene's own pictures
    High,
    /// 52 dB
    Balanced,
    /// 45 dB, hardly visible
    Small,
}

impl QualityLevel {
    /// The mean squared error that pictures may have to the scene's own.
    fn error(self) -> f64 {
        let psnr: f64 = match self {
            Self::High => 60.0,
            Self::Balanced => 52.0,
            Self::Small => 45.0,
        };
        10f64.powf(-psnr / 10.0)
    }
}

fn decibels(text: &str) -> Result<f64, String> {
    let number = text.strip_suffix("dB").unwrap_or(text).trim();
    match number.parse() {
        Ok(value) if value > 0.0 && f64::is_finite(value) => Ok(value),
        _ => Err("not a positive number of dB, as in 0.05dB".into()),
    }
}

/// A file that was written.
#[derive(Debug, Serialize, schemars::JsonSchema)]
#[schemars(rename = "PackedFile")]
pub(super) struct Row {
    input: PathBuf,
    output: PathBuf,
    bytes_before: u64,
    bytes: u64,
    /// Bytes of the file in percent of the parameters as 32-bit floating point.
    percent_of_raw: f64,
    /// PSNR in dB of a reader's pictures to those of the scene as it was; absent where nothing is lost.
    psnr_to_before: Option<f64>,
    /// PSNR in dB against photographs, before and after.
    psnr_to_photographs: Option<[f64; 2]>,
    /// PSNR in dB of the pictures of 1, 2, … scales to those of all.
    psnr_of_prefixes: Vec<f64>,
}

impl Row {
    fn text(rows: &[Self]) -> String {
        let line = |row: &Self| {
            let loss = match row.psnr_to_before {
                Some(psnr) => format!("{psnr:.1} dB to the scene's own pictures"),
                None => "nothing lost".to_owned(),
            };
            let sizes = format!("{} -> {} bytes", grouped(row.bytes_before), grouped(row.bytes));
            let photographs = row.psnr_to_photographs.map_or_else(String::new, |[before, after]| {
                format!(", {before:.3} -> {after:.3} dB against photographs")
            });
            format!(
                "{}: {sizes} ({:.1} % of raw), {loss}{photographs}\n",
                escaped_path(&row.output),
                row.percent_of_raw
            )
        };
        rows.iter().map(line).collect()
    }
}

/// Packs files.
pub(super) fn run(args: &Args, session: &Context) -> Result<(), Error> {
    let paths = args.inputs.paths()?;
    let outputs = Outputs::new(&paths, args.inputs.are_several(), &args.output, args.dry_run, session)?;
    if args.tuning.tune.is_some() && (args.dry_run || outputs.takes_standard_output()) {
        return Err(Error::Usage(
            "--tune keeps its state beside the output: give a file or a folder, and no --dry-run".into(),
        ));
    }
    let options = args.extras.options()?;
    let interrupted = args.tuning.tune.as_ref().map(|_| session.interrupts()).transpose()?;
    let photographs = args.data.load()?;
    let mut rows = Vec::new();
    for path in &paths {
        let (document, bytes_before) = read_trained(path, args.inputs.limits, session)?;
        let raw = 4 * document.scene.parameter_count();
        let lossless = args.goal.lossless.then(|| pack::lossless(&document)).transpose();
        let mut lossless = lossless.map_err(|e| Error::container(path, e))?;
        if let Some(options) = &mut lossless {
            // Corrections are fitted anew.
            options.network_steps.prefixes.clear();
        }
        let packing = measured(document, args, photographs.as_ref(), &options).map_err(Error::of_scene(path))?;
        let mut state = None;
        let (bytes, quality) = match (lossless, &interrupted) {
            (Some(options), _) => {
                let (scene, decoded) = (packing.scene.clone(), packing.scene.clone());
                let candidate = Candidate::unmeasured(scene, decoded, options, bytes_before);
                let mut observer = ConsoleObserver::unstoppable(&session.console);
                packing.finish(&candidate, &mut observer).map_err(Error::recipe(path))?
            }
            (None, Some(interrupted)) => {
                let state = state.insert(StateFile::new(None, &outputs.path_of(path), args.tuning.resume, session)?);
                tuned(&packing, args, state, interrupted, session, path)?
            }
            (None, None) => pack(&packing, args, session, path)?,
        };
        let output = outputs.write(path, &bytes)?;
        state.map_or(Ok(()), |state| state.remove())?;
        warn_of_growth(path, bytes_before as usize, bytes.len(), session);
        rows.push(Row {
            input: path.clone(),
            output,
            bytes_before,
            bytes: bytes.len() as u64,
            percent_of_raw: 100.0 * bytes.len() as f64 / raw as f64,
            psnr_to_before: quality.encoded,
            psnr_to_photographs: quality.test_before.zip(quality.test).map(|(before, after)| [before, after]),
            psnr_of_prefixes: quality.prefixes.into_iter().flatten().collect(),
        });
    }
    if outputs.takes_standard_output() { Ok(()) } else { session.console.result(&rows, |rows| Row::text(rows)) }
}

/// What a scene file or a training state holds, and its bytes.
fn read_trained(path: &Path, limits: LimitArgs, session: &Context) -> Result<(SceneFile, u64), Error> {
    if path.extension().is_some_and(|e| e == "state") {
        let (_, scene) = read_state(path)?;
        let bytes = std::fs::metadata(path).map_err(Error::io("read", path))?.len();
        let encoding = EncodeOptions::lossless(&scene);
        return Ok((SceneFile { scene, metadata: Metadata::default(), encoding }, bytes));
    }
    let (document, bytes) = input::read(path, limits, &session.console)?;
    Ok((document, bytes.len() as u64))
}

/// The scene of `document`, measured.
fn measured<'a>(
    document: SceneFile,
    args: &'a Args,
    photographs: Option<&'a (Vec<Photograph>, String)>,
    options: &'a PackOptions,
) -> Result<Packing<'a>, Error> {
    let SceneFile { scene, mut metadata, .. } = document;
    let mut cameras = Vec::new();
    if args.with_cameras {
        metadata.cameras = args.training_cameras(&scene)?;
    } else if let Ok(known) = args.training_cameras(&scene) {
        // A dataset may lack the training split.
        cameras = known;
    }
    Ok(Packing::new(scene, metadata, cameras, photographs, options)?)
}

/// The file without training, and what was measured of it.
fn pack(packing: &Packing<'_>, args: &Args, session: &Context, path: &Path) -> Result<(Vec<u8>, Quality), Error> {
    let mut observer = ConsoleObserver::unstoppable(&session.console);
    let importance = packing.importance(&packing.scene, &mut observer);
    let beside = |target| packing.bytes_beside(&importance, target, &mut observer);
    let mut reserved = args.goal.target_size.map_or(Ok(0), beside).map_err(Error::recipe(path))?;
    loop {
        let candidate = find(packing, &args.goal, &importance, reserved, session, path)?;
        let (bytes, quality) = packing.finish(&candidate, &mut observer).map_err(Error::recipe(path))?;
        match args.goal.target_size.map(|target| bytes.len() as u64 - target.min(bytes.len() as u64)) {
            Some(excess) if excess > 0 => reserved += excess,
            _ => return Ok((bytes, quality)),
        }
    }
}

/// The requirements of the goal, with `reserved` bytes for what is beside the scene.
fn find(
    packing: &Packing<'_>,
    args: &GoalArgs,
    importance: &FactorImportance,
    reserved: u64,
    session: &Context,
    path: &Path,
) -> Result<Candidate, Error> {
    // Photographs decide about dB of PSNR, the scene's own pictures about everything else.
    let (distortion, goal) = match (&packing.real, args.max_loss) {
        (Some((distortion, before, _)), Some(loss)) => {
            (distortion, Goal::Error { before: *before, more: before * grown(loss) })
        }
        _ => (&packing.own, goal(args, &packing.metadata)),
    };
    let progress = Progress::start(&session.console, "encodings", MAX_TRIED as u64);
    let (mut count, mut smallest) = (0, None);
    let mut tried = |candidate: &Candidate| {
        count += 1;
        let size = candidate.bytes + reserved;
        if smallest.is_none_or(|(bytes, _)| size < bytes) {
            smallest = Some((size, candidate.error));
        }
        let detail = format!("{} bytes, {:.1} dB", grouped(candidate.bytes), psnr_of_mse(candidate.error));
        progress.set(count, || detail.clone());
    };
    let found = search(&packing.scene, importance, distortion, goal, reserved, &mut tried);
    found.map_err(|e| Error::Runtime(e.to_string()))?.ok_or_else(|| {
        let target = grouped(args.target_size.unwrap_or_default());
        let smallest = smallest.map_or_else(String::new, |(bytes, error)| {
            format!("; the smallest file has about {} bytes at {:.1} dB", grouped(bytes), psnr_of_mse(error))
        });
        Error::Runtime(format!("{}: --target-size of {target} bytes cannot be reached{smallest}", path.display()))
    })
}

/// The file with training on photographs, and what was measured of it. `state` holds the training while it is interrupted.
fn tuned(
    packing: &Packing<'_>,
    args: &Args,
    state: &StateFile,
    interrupted: &AtomicBool,
    session: &Context,
    path: &Path,
) -> Result<(Vec<u8>, Quality), Error> {
    let (Some(folder), Some(target)) = (&args.tuning.tune, args.goal.target_size) else {
        return Err(Error::Usage("--tune needs --target-size".into()));
    };
    let Dataset { views, .. } = dataset::load(folder, "train", &args.data.dataset.load_options(args.data.downscale))?;
    let mut observer = ConsoleObserver::unstoppable(&session.console);
    let mut trainer = if args.tuning.resume {
        let (checkpoint, scene) = state.read_training()?;
        Trainer::resume(checkpoint, scene, &views)?
    } else {
        let preset: Preset = packing.scene.provenance.preset.parse().unwrap_or_default();
        let config = TrainConfig { seed: args.extras.seed, ..preset.config() };
        let steps = args.tuning.tune_steps.unwrap_or_else(|| config.steps_for_size());
        let mut trainer = Trainer::new(config, packing.scene.clone(), &views)?;
        let begun = packing.begin_for_size(&mut trainer, target, steps, &mut observer);
        begun.map_err(Error::recipe(path))?;
        trainer
    };
    run_steps(&mut trainer, state, None, interrupted, session)?;
    let finished = packing.finish_for_size(&trainer, target, &mut observer);
    let (_, bytes, quality) = finished.map_err(Error::recipe(path))?;
    Ok((bytes, quality))
}

fn goal(args: &GoalArgs, metadata: &Metadata) -> Goal {
    if let Some(bytes) = args.target_size {
        return Goal::Bytes(bytes);
    }
    if let Some(loss) = args.max_loss {
        return Goal::Error { before: 0.0, more: scene_error(metadata) * grown(loss) };
    }
    Goal::Error { before: 0.0, more: args.quality.unwrap_or(QualityLevel::Balanced).error() }
}

/// The growth of a mean squared error, as a share of itself, that loses `loss` dB of PSNR.
fn grown(loss: f64) -> f64 {
    10f64.powf(loss / 10.0) - 1.0
}
