//! `strivec shrink` and `strivec grow`: a scene with fewer parameters, or with more.

mod cells;
mod picture;
mod report;

use std::path::PathBuf;
use std::sync::atomic::Ordering;
use std::time::Instant;

use cells::Cells;
use report::{Report, ScaleUse};

use super::console::Console;
use super::output::check_scene_name;
use super::progress::Progress;
use super::settings::{Basics, Precision, Preset};
use super::training::interrupts;
use super::{Error, Session, check_output, quantity, scene_file, write_atomically};
use crate::container::{self, EncodeOptions, Metadata};
use crate::dataset;
use crate::measure::color_png;
use crate::model::Scene;
use crate::psnr::RunningMse;
use crate::train::{ResizeStep, ShrinkGoal, TrainConfig, Tuning, grow, shrink};

const SHRINK_EXAMPLES: &str = "\
Examples:
  strivec shrink lego.strivec lego -o half.strivec --max-params 14M
  strivec shrink lego.strivec lego -o lean.strivec --max-loss 0.1
  strivec shrink small.strivec lego -o smaller.strivec --downscale 4 --config quarter.toml --max-loss 0.2

Parameters are those stored in the file; components that are all zero are not stored. Losses are measured on training rays. \
Probes, prefix corrections, quality figures and stored render settings are dropped because the pictures change; strivec-pack \
pack and strivec trade make them anew.";
const GROW_EXAMPLES: &str = "\
Examples:
  strivec grow small.strivec lego -o larger.strivec --max-params 6M

Start from a small scene, such as one of strivec train --max-params. Parameters are those stored in the file; fewer than N \
are used if more do not help. Training small and growing gives worse pictures than training large and shrinking. Probes, \
prefix corrections, quality figures and stored render settings are dropped because the pictures change.";
/// Steps of training after each round, as a share of the whole run's.
const SHARE_OF_STEPS: u64 = 30;

/// The arguments of `strivec shrink`.
#[derive(Debug, clap::Args)]
#[command(after_help = SHRINK_EXAMPLES)]
pub(super) struct ShrinkArgs {
    #[command(flatten)]
    goal: Goal,
    #[command(flatten)]
    common: Common,
}

/// The arguments of `strivec grow`.
#[derive(Debug, clap::Args)]
#[command(after_help = GROW_EXAMPLES)]
pub(super) struct GrowArgs {
    /// Grow to at most N parameters, as in 500k or 3.5M
    #[arg(long, value_name = "N", value_parser = quantity::count)]
    max_params: u64,
    #[command(flatten)]
    common: Common,
}

/// Options of both commands.
#[derive(Debug, clap::Args)]
struct Common {
    /// Scene file
    file: PathBuf,
    /// Dataset folder of the scene's training
    dataset: PathBuf,
    /// Scene file to write
    #[arg(long, short, value_name = "FILE")]
    output: PathBuf,
    /// Optimizer steps after each round, twice as many after the last [default: a thirtieth of the preset's]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    steps: Option<u64>,
    /// Preset of the scene's training [default: the file's, else best]
    #[arg(long, value_enum)]
    preset: Option<Preset>,
    #[command(flatten)]
    basics: Basics,
    /// Plot parameters per cell against error per cell, before and after, as PNG
    #[arg(long, value_name = "PNG")]
    picture: Option<PathBuf>,
    /// Encoding of the factors
    #[arg(long, value_enum, default_value_t)]
    encoding: Precision,
}

/// The goal of shrinking.
#[derive(Debug, clap::Args)]
#[group(required = true, multiple = false)]
struct Goal {
    /// Shrink to at most N parameters, as in 500k or 3.5M
    #[arg(long, value_name = "N", value_parser = quantity::count)]
    max_params: Option<u64>,
    /// Shrink as far as possible with a PSNR loss of at most DB on training rays
    #[arg(long, value_name = "DB", value_parser = loss)]
    max_loss: Option<f64>,
}

fn loss(text: &str) -> Result<f64, String> {
    text.parse().ok().filter(|db: &f64| db.is_finite() && *db > 0.0).ok_or_else(|| "not a positive number of dB".into())
}

/// Progress of a round.
struct Meter<'a> {
    progress: Progress<'a>,
    round: usize,
    error: RunningMse,
}

impl<'a> Meter<'a> {
    fn start(step: &ResizeStep, console: &'a Console) -> Self {
        let progress = Progress::start(console, &format!("round {}", step.round + 1), step.steps[1]);
        Self { progress, round: step.round, error: RunningMse::default() }
    }

    fn add(&mut self, step: &ResizeStep) {
        self.error.add(step.report.mean_squared_error);
        self.progress.set(step.steps[0], || format!("train {:.2} dB", self.error.psnr()));
    }

    fn finish(self) {
        self.progress.finish(&format!("round {}: train {:.2} dB", self.round + 1, self.error.psnr()));
    }
}

/// The change of the number of parameters.
enum Change {
    Shrink(ShrinkGoal),
    /// Up to this number of parameters.
    Grow(u64),
}

impl Change {
    /// A scene of `parameters` needs no round.
    fn is_met_by(&self, parameters: u64) -> bool {
        match *self {
            Self::Shrink(ShrinkGoal::Parameters(most)) => parameters <= most,
            Self::Shrink(ShrinkGoal::Loss(_)) => false,
            Self::Grow(most) => parameters >= most,
        }
    }
}

/// Shrinks.
pub(super) fn run_shrink(args: &ShrinkArgs, session: &Session) -> Result<(), Error> {
    let goal = match (args.goal.max_params, args.goal.max_loss) {
        (Some(most), _) => ShrinkGoal::Parameters(most),
        (None, Some(most)) => ShrinkGoal::Loss(most),
        (None, None) => unreachable!("clap requires one"),
    };
    run(&Change::Shrink(goal), &args.common, session)
}

/// Grows.
pub(super) fn run_grow(args: &GrowArgs, session: &Session) -> Result<(), Error> {
    run(&Change::Grow(args.max_params), &args.common, session)
}

fn run(change: &Change, args: &Common, session: &Session) -> Result<(), Error> {
    check_scene_name(&args.output)?;
    check_output(&args.output, session.force)?;
    if let Some(path) = &args.picture {
        check_output(path, session.force)?;
    }
    let (document, _) = scene_file::read_scene_file(&args.file)?;
    let tuning = args.tuning(&document.scene)?;
    let interrupted = interrupts()?;
    let dataset = dataset::load(&args.dataset, "train", &args.basics.photographs(&args.dataset, session)?)?;
    let start = Instant::now();
    let before: Vec<ScaleUse> = document.scene.scales.iter().map(ScaleUse::of).collect();
    let metadata = Metadata {
        license: document.metadata.license,
        views: document.metadata.views,
        cameras: document.metadata.cameras,
        ..Metadata::default()
    };
    let mut meter: Option<Meter> = None;
    let mut stepped = |step: &ResizeStep| {
        if interrupted.load(Ordering::SeqCst) {
            return Err(Error::Runtime("interrupted; nothing was written".into()));
        }
        // A round may end before its last step: the meter starts anew at step 1.
        let begun = match &mut meter {
            Some(begun) if step.steps[0] > 1 => begun,
            _ => meter.insert(Meter::start(step, &session.console)),
        };
        begun.add(step);
        if step.steps[0] == step.steps[1]
            && let Some(ended) = meter.take()
        {
            ended.finish();
        }
        Ok(())
    };
    let (scene, views) = (document.scene.clone(), &dataset.views);
    let resized = match *change {
        Change::Shrink(goal) => shrink(scene, views, goal, &tuning, &mut stepped)?,
        Change::Grow(most) => grow(scene, views, most, &tuning, &mut stepped)?,
    };
    let cells = Cells::new([&document.scene, &resized.scene], &dataset.views, &tuning.config)?;
    let options = EncodeOptions::uniform(args.encoding.factors());
    let bytes = container::encode_scene_file(&resized.scene, &metadata, &options)
        .map_err(|e| Error::container(&args.output, e))?;
    write_atomically(&args.output, &bytes, session.force)?;
    if let Some(path) = &args.picture {
        let (size, colors) = picture::draw(&cells.named()).map_err(Error::Runtime)?;
        write_atomically(path, &color_png(size, &colors)?, session.force)?;
    }
    let after = resized.scene.scales.iter().map(ScaleUse::of);
    let report = Report {
        file: &args.output,
        bytes: bytes.len() as u64,
        parameters: resized.parameters,
        psnr: resized.psnr,
        rounds: resized.rounds,
        scales: before.into_iter().zip(after).map(|(before, after)| [before, after]).collect(),
        cells: cells.kinds(),
        seconds: start.elapsed().as_secs_f64(),
        met_goal_before: change.is_met_by(resized.parameters[0]),
    };
    session.console.result(&report, Report::text)
}

impl Common {
    /// The training of `scene` between rounds.
    fn tuning(&self, scene: &Scene) -> Result<Tuning, Error> {
        let of_file = Some(scene.provenance.preset.as_str()).filter(|name| TrainConfig::PRESETS.contains(name));
        let preset = self.preset.map(Preset::name).or(of_file.filter(|_| self.basics.config.is_none()));
        let config = self.basics.configuration(preset)?;
        let steps = self.steps.unwrap_or(config.steps.div_ceil(SHARE_OF_STEPS));
        Ok(Tuning { steps, config })
    }
}
