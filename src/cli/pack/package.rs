//! `strivec-pack pack`.

use std::cell::Cell;
use std::path::{Path, PathBuf};

use serde::Serialize;

use super::convert::warn_of_growth;
use super::encoding::LayoutArgs;
use super::input::{self, Inputs, Outputs};
use super::showing::{default_views, thumbnail};
use crate::cli::dataset::DatasetOptions;
use crate::cli::progress::Progress;
use crate::cli::scene_file::scene_error;
use crate::cli::state_file::read_state;
use crate::cli::table::plural;
use crate::cli::{Error, Session, quantity};
use crate::container::{self, EncodeOptions, Limits, Metadata, Quality, SceneFile, TrainingCamera};
use crate::dataset::{self, Dataset, LoadOptions, View};
use crate::digits::grouped;
use crate::measure::make_probes;
use crate::model::Scene;
use crate::pack::{self, Candidate, Distortion, Goal, MAX_TRIED, Views, fit_prefix, probe_views, search};
use crate::psnr::psnr_of_mse;
use crate::render::Turntable;
use crate::train::FactorImportance;

/// Pictures that a scene is judged by, and their size, at the usual effort.
pub(in crate::cli) const JUDGED: (usize, u32) = (12, 320);
/// Cameras and, at the usual effort, batches of rays that importance is estimated from.
pub(in crate::cli) const PROBED: (usize, usize) = (64, 48);
/// Steps of fitting a prefix, at the usual effort.
const PREFIX_STEPS: usize = 150;
/// A first guess at what is beside the scene: probes, prefixes, a thumbnail.
const EXTRAS_BYTES: u64 = 40_000;

/// Arguments of `strivec-pack pack`.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Examples:
  strivec-pack pack lego.strivec -o small.strivec
  strivec-pack pack lego.strivec -o small.strivec --max-loss 0.05dB
  strivec-pack pack 'scenes/*.strivec' -o packed --target-size 2MB")]
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
    layout: LayoutArgs,
    /// Number of probe rays stored for `verify --render`; 0 stores none
    #[arg(long, value_name = "N", default_value_t = 64, value_parser = clap::value_parser!(u32).range(0..=65_536))]
    probes: u32,
    /// Fit no corrections for scenes of which only the coarser scales are loaded
    #[arg(long)]
    no_prefixes: bool,
    /// Write no thumbnail, first camera or turntable
    #[arg(long)]
    no_views: bool,
    /// Also write the cameras of the training photographs; they reveal where the photographer stood
    #[arg(long, requires = "data")]
    with_cameras: bool,
    /// License text of the scene
    #[arg(long, value_name = "TEXT")]
    license: Option<String>,
    /// Multiple of the usual number of rays for measuring and fitting, 0.001 to 100: 0.1 is quick, 4 is thorough
    #[arg(long, value_name = "F", default_value_t = 1.0, value_parser = effort)]
    effort: f64,
    /// Random seed
    #[arg(long, default_value_t = 0)]
    seed: u64,
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
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..), requires = "data")]
    downscale: u32,
    /// Use every Nth photograph only, beginning with the first
    #[arg(long, value_name = "N", default_value_t = 10, value_parser = clap::value_parser!(u32).range(1..), requires = "data")]
    every: u32,
    #[command(flatten)]
    dataset: DatasetOptions,
}

impl DataArgs {
    /// The photographs, and what they are called.
    fn load(&self) -> Result<Option<(Vec<View>, String)>, Error> {
        let Some(folder) = &self.data else { return Ok(None) };
        let options = LoadOptions { every: self.every as usize, ..self.dataset.load_options(self.downscale) };
        let Dataset { name, views, .. } = dataset::load(folder, &self.split, &options)?;
        let mut what = format!("{name}, {} of {}", plural(views.len(), "view"), self.split);
        if self.downscale > 1 {
            what += &format!(", {} times smaller", self.downscale);
        }
        Ok(Some((views, what)))
    }

    fn training_cameras(&self, scene: &Scene) -> Result<Vec<TrainingCamera>, Error> {
        let Some(folder) = &self.data else { return Ok(Vec::new()) };
        let cameras = dataset::load_cameras(folder, "train", None, &self.dataset.load_options(self.downscale))?;
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

fn effort(text: &str) -> Result<f64, String> {
    match text.parse() {
        Ok(value) if (1e-3..=100.0).contains(&value) => Ok(value),
        _ => Err("not a number from 0.001 to 100".into()),
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
    /// Of the parameters as 32-bit floating point.
    percent_of_raw: f64,
    /// PSNR in dB of a reader's pictures to those of the scene as it was; absent where nothing is lost.
    psnr_to_before: Option<f64>,
    /// PSNR in dB against photographs, before and after.
    psnr_to_photographs: Option<[f64; 2]>,
    /// PSNR in dB of the pictures of 1, 2, … scales to those of all.
    psnr_of_prefixes: Vec<f64>,
}

impl Args {
    /// Width of the pictures that a scene is judged by.
    fn judged_width(&self) -> u32 {
        (f64::from(JUDGED.1) * self.effort.sqrt()).ceil() as u32
    }

    /// As many of `usual` as the effort asks for.
    fn as_many(&self, usual: usize) -> usize {
        (usual as f64 * self.effort).ceil() as usize
    }
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
            format!("{}: {sizes} ({:.1} % of raw), {loss}{photographs}\n", row.output.display(), row.percent_of_raw)
        };
        rows.iter().map(line).collect()
    }
}

/// Packs files.
pub(super) fn run(args: &Args, session: &Session) -> Result<(), Error> {
    let paths = args.inputs.paths()?;
    let outputs = Outputs::new(&paths, args.inputs.are_several(), &args.output, args.dry_run, session)?;
    let photographs = args.data.load()?;
    let mut rows = Vec::new();
    for path in &paths {
        let (document, bytes_before) = read_trained(path, args.inputs.limits.limits())?;
        let raw = 4 * document.scene.parameter_count();
        let (bytes, quality) = pack(document, args, photographs.as_ref(), session, path)?;
        let output = outputs.write(path, &bytes)?;
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
fn read_trained(path: &Path, limits: Limits) -> Result<(SceneFile, u64), Error> {
    if path.extension().is_some_and(|e| e == "state") {
        let (_, scene) = read_state(path)?;
        let bytes = std::fs::metadata(path).map_err(Error::io("read", path))?.len();
        let encoding = EncodeOptions::lossless(&scene);
        return Ok((SceneFile { scene, metadata: Metadata::default(), encoding }, bytes));
    }
    let (document, bytes) = input::read(path, limits)?;
    Ok((document, bytes.len() as u64))
}

/// The file, and what was measured of it.
fn pack(
    document: SceneFile,
    args: &Args,
    photographs: Option<&(Vec<View>, String)>,
    session: &Session,
    path: &Path,
) -> Result<(Vec<u8>, Quality), Error> {
    let lossless = args.goal.lossless.then(|| pack::lossless(&document)).transpose();
    let lossless = lossless.map_err(|e| Error::container(path, e))?;
    let SceneFile { scene, mut metadata, .. } = document;
    let mut cameras = Vec::new();
    if args.with_cameras {
        metadata.cameras = args.data.training_cameras(&scene)?;
    } else if let Ok(known) = args.data.training_cameras(&scene) {
        // A dataset may lack the training split.
        cameras = known;
    }
    // Cameras around the bounds stand for those of the photographs, unless these are within.
    if !metadata.cameras.is_empty() || Turntable::of(&scene, None, &cameras).is_none() {
        cameras.clone_from(&metadata.cameras);
    }
    let probed = |count| probe_views(&scene, metadata.views.as_ref(), &cameras, count, args.judged_width());
    let packing = Packing {
        views: probed(PROBED.0),
        own: Distortion::from_own_pictures(&scene, probed(JUDGED.0)),
        real: photographs.map(|(views, what)| {
            let distortion = Distortion::from_photographs(&scene, views);
            let before = distortion.mse(&scene);
            (distortion, before, what.as_str())
        }),
        scene,
        metadata,
        cameras,
        args,
        session,
        smallest: Cell::new(None),
    };
    if let Some(options) = lossless {
        let options = args.layout.apply(options)?;
        let scene = packing.scene.clone();
        let whole = Candidate { bytes: 0, error: 0.0, decoded: scene.clone(), scene, options };
        return packing.finish(&whole, path);
    }
    session.console.say("estimating importance");
    let importance = packing.views.importance(&packing.scene, args.as_many(PROBED.1), args.seed);
    let mut reserved = args.goal.target_size.map_or(0, |target| EXTRAS_BYTES.min(target / 4));
    loop {
        let candidate = packing.find(&importance, reserved)?;
        let candidate = candidate.ok_or_else(|| packing.too_small(path))?;
        let (bytes, quality) = packing.finish(&candidate, path)?;
        match args.goal.target_size.map(|target| bytes.len() as u64 - target.min(bytes.len() as u64)) {
            // What is beside the scene is known now.
            Some(excess) if excess > 0 => reserved += excess + EXTRAS_BYTES / 64,
            _ => return Ok((bytes, quality)),
        }
    }
}

/// What is known before anything is lost.
struct Packing<'a> {
    scene: Scene,
    metadata: Metadata,
    /// The photographs' cameras, as far as measurements use them; the file need not have them.
    cameras: Vec<TrainingCamera>,
    views: Views,
    /// The scene's own pictures.
    own: Distortion,
    /// Photographs, the scene's error to them, and what they are called.
    real: Option<(Distortion, f64, &'a str)>,
    args: &'a Args,
    session: &'a Session,
    /// The smallest file among the encodings tried, in bytes, and its mean squared error.
    smallest: Cell<Option<(u64, f64)>>,
}

impl Packing<'_> {
    /// The error of a target size that no encoding reaches.
    fn too_small(&self, path: &Path) -> Error {
        let target = grouped(self.args.goal.target_size.unwrap_or_default());
        let smallest = self.smallest.get().map_or_else(String::new, |(bytes, error)| {
            format!("; the smallest file has about {} bytes at {:.1} dB", grouped(bytes), psnr_of_mse(error))
        });
        Error::Runtime(format!("{}: --target-size of {target} bytes cannot be reached{smallest}", path.display()))
    }

    /// What the goal asks for, `reserved` bytes being wanted for what is beside the scene.
    fn find(&self, importance: &FactorImportance, reserved: u64) -> Result<Option<Candidate>, Error> {
        let args = &self.args.goal;
        // Photographs decide about dB of PSNR, the scene's own pictures about everything else.
        let (distortion, goal) = match (&self.real, args.max_loss) {
            (Some((distortion, before, _)), Some(loss)) => {
                (distortion, Goal::Error { before: *before, more: before * grown(loss) })
            }
            _ => (&self.own, goal(args, &self.metadata)),
        };
        let progress = Progress::start(&self.session.console, "encodings", MAX_TRIED as u64);
        let mut count = 0;
        let mut tried = |candidate: &Candidate| {
            count += 1;
            let size = candidate.bytes + reserved;
            if self.smallest.get().is_none_or(|(bytes, _)| size < bytes) {
                self.smallest.set(Some((size, candidate.error)));
            }
            let detail = format!("{} bytes, {:.1} dB", grouped(candidate.bytes), psnr_of_mse(candidate.error));
            progress.set(count, || detail.clone());
        };
        let found = search(&self.scene, importance, distortion, goal, reserved, &mut tried);
        found.map_err(|e| Error::Runtime(e.to_string()))
    }

    /// The file of `candidate` with everything that belongs to it.
    fn finish(&self, candidate: &Candidate, path: &Path) -> Result<(Vec<u8>, Quality), Error> {
        let Candidate { scene, decoded, options, .. } = candidate;
        let options = self.args.layout.apply(options.clone())?;
        let mut metadata = self.metadata.clone();
        let prefix_psnrs = self.fit_prefixes(decoded, &mut metadata);
        metadata.probes =
            (self.args.probes > 0).then(|| make_probes(decoded, self.args.probes as usize, self.args.seed));
        metadata.license = self.args.license.clone().or(metadata.license);
        if !self.args.no_views {
            let views = metadata.views.take().unwrap_or_else(|| default_views(decoded, &self.cameras));
            metadata.thumbnail = Some(thumbnail(decoded, &views)?);
            metadata.views = Some(views);
        }
        let mut quality = metadata.quality.take().unwrap_or_default();
        let error = self.own.mse(decoded);
        quality.encoded = (error > 0.0).then(|| psnr_of_mse(error));
        quality.prefixes = prefix_psnrs;
        if let Some((distortion, before, what)) = &self.real {
            quality.test_before = Some(psnr_of_mse(*before));
            quality.test = Some(psnr_of_mse(distortion.mse(decoded)));
            quality.dataset = (*what).to_owned();
        }
        metadata.quality = Some(quality.clone());
        let bytes = container::encode_scene_file(scene, &metadata, &options).map_err(|e| Error::container(path, e))?;
        Ok((bytes, quality))
    }

    /// Fits the corrections of prefixes of `decoded` into `metadata`; \[scale\] the PSNR of their pictures, nothing for
    /// the last.
    fn fit_prefixes(&self, decoded: &Scene, metadata: &mut Metadata) -> Vec<Option<f64>> {
        metadata.prefixes.clear();
        let scales = decoded.scales.len();
        if self.args.no_prefixes || scales == 1 {
            return Vec::new();
        }
        let distortion = Distortion::from_own_pictures(
            decoded,
            probe_views(decoded, metadata.views.as_ref(), &self.cameras, 4, self.args.judged_width()),
        );
        let progress = Progress::start(&self.session.console, "prefixes", scales as u64 - 1);
        let mut psnrs = Vec::new();
        for count in 1..scales {
            let prefix = fit_prefix(decoded, count, &self.views, self.args.as_many(PREFIX_STEPS), self.args.seed);
            let mut part = container::first_scales(decoded.clone(), &[], Some(count as u32));
            prefix.apply(&mut part);
            let psnr = psnr_of_mse(distortion.mse(&part));
            psnrs.push(Some(psnr));
            metadata.prefixes.push(Some(prefix));
            progress.set(count as u64, || format!("{psnr:.1} dB"));
        }
        metadata.prefixes.push(None);
        psnrs.push(None);
        psnrs
    }
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

/// By what share of itself a mean squared error grows that loses so many dB of PSNR.
fn grown(loss: f64) -> f64 {
    10f64.powf(loss / 10.0) - 1.0
}
