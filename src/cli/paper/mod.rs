//! `strivec paper`: the paper's tables, trained and measured here.

mod figures;
mod report;
mod tables;
mod training;

use std::path::{Path, PathBuf};

use report::Report;
use tables::{Name, Row};
use training::{Scene, Trainings};

use super::dataset::DatasetOptions;
use super::evaluation::MeasureOptions;
use super::output::make_folder;
use super::settings::configuration;
use super::{Error, Session};
use crate::dataset::Layout;
use crate::train::{LeanConfig, TrainConfig};

const EXAMPLES: &str = "\
Examples:
  strivec paper main --data nerf_synthetic
  strivec paper rotation --data nerf_synthetic/lego --downscale 4 --steps 3000 --only 48,tensorf-vm
  strivec paper components --data lego chair --lpips alex,vgg --lpips-weights lpips.safetensors
  strivec paper scannet --data scans/scene0101_04

Every row is a preset; it is trained on every scene by its own schedule, which takes hours at full size, or in --steps, and \
measured on the split. The same command goes on where a stopped one was, and tables share the trainings that they have in \
common: OUT/TRAINING has settings.toml, the scenes, and what is measured of each. --views and the measures may change without \
training again.";

/// The arguments.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct Args {
    /// The table
    #[arg(value_enum, value_name = "TABLE")]
    table: Name,
    /// Datasets, and folders of datasets
    #[arg(long, value_name = "DATASET", num_args = 1.., required = true)]
    data: Vec<PathBuf>,
    /// Folder for all trainings
    #[arg(long, value_name = "DIR", default_value = "paper")]
    out: PathBuf,
    /// Train the rows of these presets only, comma-separated
    #[arg(long, value_name = "PRESETS", value_delimiter = ',')]
    only: Vec<String>,
    /// Optimizer steps of each training; the whole schedule scales with them [default: the preset's]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    steps: Option<u64>,
    /// TOML settings that all rows share, as `train --print-config` prints them, but for scales and decoder, which are the presets'
    #[arg(long, value_name = "TOML")]
    config: Option<PathBuf>,
    /// Keep all components of all tensors, as the paper does [default: training gives up those that the pictures hardly depend on]
    #[arg(long)]
    full: bool,
    /// Random seed
    #[arg(long, value_name = "S", default_value_t = 0)]
    seed: u64,
    /// Downscale photographs N times
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..))]
    downscale: u32,
    /// Split to measure on
    #[arg(long, value_name = "S", default_value = "test")]
    split: String,
    /// Number of views to measure, evenly spaced [default: all]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..))]
    views: Option<u16>,
    #[command(flatten)]
    measures: MeasureOptions,
    #[command(flatten)]
    dataset: DatasetOptions,
}

/// Trains and measures what is not recorded yet, and reports.
pub(super) fn run(args: &Args, session: &Session) -> Result<(), Error> {
    let scenes = scenes(&args.data)?;
    let rows = rows(args)?;
    let measures = args.measures.load()?;
    make_folder(&args.out)?;
    let trainings = Trainings {
        out: &args.out,
        downscale: args.downscale,
        dataset: &args.dataset,
        split: &args.split,
        views: args.views.map(usize::from),
        measures: &measures,
        session,
    };
    let mut outcomes = Vec::new();
    for (number, row) in rows.iter().enumerate() {
        let mut of_row = Vec::new();
        for scene in &scenes {
            session.console.say(&format!("{} of {}: {}, {}", number + 1, rows.len(), row.name, scene.name));
            of_row.push(trainings.outcome(&row.training, scene)?);
        }
        outcomes.push(of_row);
    }
    let report = Report::new(args.table, args.downscale, &rows, &scenes, &outcomes);
    session.console.result(&report, Report::text)
}

/// The rows that are asked for, with the settings of all.
fn rows(args: &Args) -> Result<Vec<Row>, Error> {
    let configured = |name| {
        let config = configuration(Some(name), args.config.as_deref())?;
        let lean = if args.full { LeanConfig::off() } else { config.lean.clone() };
        Ok((name, TrainConfig { seed: args.seed, lean, ..config }))
    };
    let mut rows = args.table.rows(&TrainConfig::PRESETS.into_iter().map(configured).collect::<Result<_, Error>>()?);
    let preset = |row: &Row| row.training.config.preset.clone();
    if let Some(unknown) = args.only.iter().find(|name| !rows.iter().any(|row| preset(row) == **name)) {
        let mut known: Vec<String> = rows.iter().map(preset).collect();
        known.dedup();
        return Err(Error::Usage(format!("--only {unknown}: the table has rows of the presets {}", known.join(", "))));
    }
    rows.retain(|row| args.only.is_empty() || args.only.contains(&preset(row)));
    for row in &mut rows {
        let config = &mut row.training.config;
        *config = args.steps.map_or_else(|| config.clone(), |steps| config.clone().with_steps(steps));
        config.check().map_err(|e| Error::Usage(e.to_string()))?;
    }
    Ok(rows)
}

/// The datasets among `folders` and directly in them, by name.
fn scenes(folders: &[PathBuf]) -> Result<Vec<Scene>, Error> {
    let mut scenes: Vec<Scene> = Vec::new();
    for folder in folders {
        let found = match Layout::of(folder) {
            Ok(_) => vec![folder.clone()],
            Err(no_layout) => {
                let inside = datasets_in(folder)?;
                if inside.is_empty() {
                    return Err(no_layout.into());
                }
                inside
            }
        };
        for folder in found {
            let folder = folder.canonicalize().map_err(Error::io("read", &folder))?;
            let name = folder.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned());
            if let Some(other) = scenes.iter().find(|scene| scene.name == name) {
                let [a, b] = [&other.folder, &folder].map(|folder| folder.display());
                return Err(Error::Usage(format!("{a} and {b} have one name; results are kept by name")));
            }
            scenes.push(Scene { name, folder });
        }
    }
    Ok(scenes)
}

/// The datasets directly in `folder`, by name.
fn datasets_in(folder: &Path) -> Result<Vec<PathBuf>, Error> {
    let mut found = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(Error::io("read", folder))? {
        let path = entry.map_err(Error::io("read", folder))?.path();
        if path.is_dir() && Layout::of(&path).is_ok() {
            found.push(path);
        }
    }
    found.sort();
    Ok(found)
}
