//! `strivec shrink`: a scene with fewer parameters.

mod cells;
mod picture;
mod report;

use std::path::PathBuf;
use std::time::Instant;

use cells::Cells;
use report::{Report, ScaleUse};

use super::numbers::{POSITIVE, in_range};
use super::output::{check_outputs, check_scene_name, write_or_keep};
use super::settings::{Basics, Precision, presets};
use super::state_file::{StateFile, run_steps};
use super::{Context, Error, quantity, scene_file, write_atomically};
use strivec_capture::dataset;
use strivec_format::container;
use strivec_format::container::{EncodeOptions, Metadata};
use strivec_format::model::Scene;
use strivec_measure::color_png;
use strivec_train::{Preset, ShrinkGoal, Trainer, Tuning, compacted, shrink};

const EXAMPLES: &str = "\
Examples:
  strivec shrink lego.strivec lego -o 3M.strivec --max-params 3M
  strivec shrink lego.strivec lego -o lean.strivec --max-loss 0.1
  strivec shrink lego.strivec lego -o lean.strivec --resume
  strivec shrink small.strivec lego -o smaller.strivec --downscale 4 --config quarter.toml --max-loss 0.2

Parameters are those stored in the file; components that are all zero are not stored. Losses are measured on training rays. \
Probes, prefix corrections, quality figures and stored render settings are dropped because the pictures change; strivec-pack \
pack and strivec trade make them anew.";
/// Steps of shrinking: the preset's, divided by this.
const SHARE: u64 = 4;
/// Why a scene stays as it is.
const MEETS_GOAL: &str = "the scene meets the goal already";

/// The arguments.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct Args {
    #[command(flatten)]
    goal: ShrinkTarget,
    /// Optimizer steps [default: a quarter of the preset's]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    steps: Option<u64>,
    /// Write the checkpoint every N steps [default: only when interrupted]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    checkpoint_every: Option<u64>,
    /// Scene file
    file: PathBuf,
    /// Dataset folder of the scene's training
    dataset: PathBuf,
    /// Scene file to write
    #[arg(long, short, value_name = "FILE")]
    output: PathBuf,
    /// Preset of the scene's training [default: the file's, else best]
    #[arg(long, value_name = "NAME", value_parser = presets())]
    preset: Option<Preset>,
    #[command(flatten)]
    basics: Basics,
    /// Plot parameters per cell against error per cell, before and after, as PNG
    #[arg(long, value_name = "PNG")]
    picture: Option<PathBuf>,
    /// Encoding of the factors
    #[arg(long, value_enum, default_value_t)]
    encoding: Precision,
    /// Checkpoint of an unfinished run [default: OUTPUT.state]
    #[arg(long, value_name = "PATH")]
    checkpoint: Option<PathBuf>,
    /// Resume from the checkpoint with its settings and its goal; the result is byte-identical to an uninterrupted run
    #[arg(long, conflicts_with_all = ["preset", "config", "set", "seed", "steps", "max_params"])]
    resume: bool,
}

/// The goal of shrinking.
#[derive(Debug, clap::Args)]
#[group(multiple = false)]
struct ShrinkTarget {
    /// Shrink to at most N parameters, as in 500k or 3.5M
    #[arg(long, value_name = "N", value_parser = quantity::count)]
    max_params: Option<u64>,
    /// Shrink as far as possible with a PSNR loss of about DB at most on training rays
    #[arg(long, value_name = "DB", value_parser = in_range(POSITIVE, "a positive number of dB"), conflicts_with = "resume")]
    max_loss: Option<f64>,
}

/// Shrinks, and reports the result.
pub(super) fn run(args: &Args, session: &Context) -> Result<(), Error> {
    let goal = match (args.goal.max_params, args.goal.max_loss) {
        (Some(most), _) => Some(ShrinkGoal::Parameters(most)),
        (None, most) => most.map(ShrinkGoal::Loss),
    };
    if goal.is_none() && !args.resume {
        return Err(Error::Usage("give --max-params or --max-loss".into()));
    }
    check_scene_name(&args.output)?;
    let _reserved = check_outputs(std::iter::once(&args.output).chain(&args.picture), session.force)?;
    let state = StateFile::new(args.checkpoint.as_deref(), &args.output, args.resume, session)?;
    let (document, _) = scene_file::read(&args.file, &session.console)?;
    let interrupted = session.interrupts()?;
    let dataset = dataset::load(&args.dataset, "train", &args.basics.photographs(&args.dataset, None, session)?)?;
    let start = Instant::now();
    let before = &document.scene;
    let mut trainer = match goal {
        Some(goal) => shrink(before.clone(), &dataset.views, goal, &args.tuning(before)?)?,
        None => {
            let (checkpoint, scene) = state.read_training()?;
            Trainer::resume(checkpoint, scene, &dataset.views)?
        }
    };
    let psnr_before = trainer.psnr_of(before);
    let unchanged = goal.is_some_and(|goal| goal.is_met_by(before)).then_some(MEETS_GOAL);
    let (scene, psnr) = if unchanged.is_some() {
        (before.clone(), psnr_before)
    } else {
        run_steps(&mut trainer, &state, args.checkpoint_every, &interrupted, session)?;
        let scene = compacted(&trainer)?;
        let psnr = trainer.psnr_of(&scene);
        (scene, psnr)
    };
    let cells = Cells::new([before, &scene], &dataset.views, &args.basics.configuration(None, None)?)?;
    let bytes = args.write(&scene, &cells, &document.metadata, session)?;
    state.remove()?;
    let scales = before.scales.iter().zip(&scene.scales);
    let report = Report {
        file: &args.output,
        bytes,
        parameters: [before, &scene].map(Scene::nonzero_parameter_count),
        psnr: [psnr_before, psnr],
        scales: scales.map(|(before, after)| [ScaleUse::of(before), ScaleUse::of(after)]).collect(),
        cells: cells.kinds(),
        seconds: start.elapsed().as_secs_f64(),
        unchanged,
    };
    session.console.result(&report, Report::text)
}

impl Args {
    /// The training of `scene`.
    fn tuning(&self, scene: &Scene) -> Result<Tuning, Error> {
        let of_file = scene.provenance.preset.parse().ok();
        let preset = self.preset.or(of_file.filter(|_| self.basics.config.is_none()));
        let config = self.basics.configuration(preset, None)?;
        let steps = self.steps.unwrap_or(config.schedule.steps.div_ceil(SHARE));
        Ok(Tuning { steps, config })
    }

    /// Writes `scene`, with what stays true of the `metadata` of the scene before, and the picture of `cells`. Returns
    /// the bytes of the scene's file.
    fn write(&self, scene: &Scene, cells: &Cells, metadata: &Metadata, session: &Context) -> Result<u64, Error> {
        let metadata = Metadata {
            license: metadata.license.clone(),
            views: metadata.views.clone(),
            cameras: metadata.cameras.clone(),
            ..Metadata::default()
        };
        let options = EncodeOptions::uniform(self.encoding.factors());
        let bytes =
            container::encode_scene_file(scene, &metadata, &options).map_err(|e| Error::container(&self.output, e))?;
        write_or_keep(&self.output, &bytes, session.force)?;
        if let Some(path) = &self.picture {
            let (size, colors) = picture::draw(&cells.named()).map_err(Error::Runtime)?;
            write_atomically(path, &color_png(size, &colors)?, session.force)?;
        }
        Ok(bytes.len() as u64)
    }
}
