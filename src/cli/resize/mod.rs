//! `strivec shrink` and `strivec grow`: a scene with fewer parameters, or with more.

mod cells;
mod picture;
mod report;

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

use cells::Cells;
use report::{Report, ScaleUse};

use super::console::Console;
use super::output::check_scene_name;
use super::progress::Progress;
use super::settings::{Basics, Precision, Preset};
use super::state_file::StateFile;
use super::table::plural;
use super::training::run_steps;
use super::{Error, Session, check_output, quantity, scene_file, write_atomically};
use crate::container::{self, EncodeOptions, Metadata, SceneFile};
use crate::dataset::{self, Dataset};
use crate::measure::color_png;
use crate::model::Scene;
use crate::psnr::RunningMse;
use crate::train::{GrowRound, GrowStep, Growing, ShrinkGoal, TrainConfig, Trainer, Tuning, compacted, shrink};

const SHRINK_EXAMPLES: &str = "\
Examples:
  strivec shrink lego.strivec lego -o 3M.strivec --max-params 3M
  strivec shrink lego.strivec lego -o lean.strivec --max-loss 0.1
  strivec shrink lego.strivec lego -o lean.strivec --resume
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
/// The share of the preset's steps that shrinking has, as a divisor, and that a round of growing has.
const SHRINK_SHARE: u64 = 4;
const GROW_SHARE: u64 = 30;

/// The arguments of `strivec shrink`.
#[derive(Debug, clap::Args)]
#[command(after_help = SHRINK_EXAMPLES)]
pub(super) struct ShrinkArgs {
    #[command(flatten)]
    goal: Goal,
    /// Optimizer steps [default: a quarter of the preset's]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    steps: Option<u64>,
    /// Write the checkpoint every N steps [default: only when interrupted]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    checkpoint_every: Option<u64>,
    #[command(flatten)]
    common: Common,
}

/// The arguments of `strivec grow`.
#[derive(Debug, clap::Args)]
#[command(after_help = GROW_EXAMPLES)]
pub(super) struct GrowArgs {
    /// Grow to at most N parameters, as in 500k or 3.5M
    #[arg(long, value_name = "N", value_parser = quantity::count)]
    max_params: Option<u64>,
    /// Optimizer steps of each round, twice as many after the last [default: a thirtieth of the preset's]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    steps: Option<u64>,
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
    /// Checkpoint of an unfinished run [default: OUTPUT.state]
    #[arg(long, value_name = "PATH")]
    checkpoint: Option<PathBuf>,
    /// Resume from the checkpoint with its settings and its goal; the result is byte-identical to an uninterrupted run
    #[arg(long, conflicts_with_all = ["preset", "config", "batch", "seed", "steps", "max_params"])]
    resume: bool,
}

/// The goal of shrinking.
#[derive(Debug, clap::Args)]
#[group(multiple = false)]
struct Goal {
    /// Shrink to at most N parameters, as in 500k or 3.5M
    #[arg(long, value_name = "N", value_parser = quantity::count)]
    max_params: Option<u64>,
    /// Shrink as far as possible with a PSNR loss of about DB at most on training rays
    #[arg(long, value_name = "DB", value_parser = loss, conflicts_with = "resume")]
    max_loss: Option<f64>,
}

fn loss(text: &str) -> Result<f64, String> {
    text.parse().ok().filter(|db: &f64| db.is_finite() && *db > 0.0).ok_or_else(|| "not a positive number of dB".into())
}

/// Progress of a round of growing.
struct RoundMeter<'a> {
    progress: Progress<'a>,
    round: usize,
    error: RunningMse,
}

impl<'a> RoundMeter<'a> {
    fn start(step: &GrowStep, console: &'a Console) -> Self {
        let progress = Progress::start(console, &format!("round {}", step.round + 1), step.steps[1]);
        Self { progress, round: step.round, error: RunningMse::default() }
    }

    fn add(&mut self, step: &GrowStep) {
        self.error.add(step.report.mean_squared_error);
        self.progress.set(step.steps[0], || format!("train {:.2} dB", self.error.psnr()));
    }

    fn finish(self) {
        self.progress.finish(&format!("round {}: train {:.2} dB", self.round + 1, self.error.psnr()));
    }
}

/// A scene with another number of parameters.
struct Resized {
    scene: Scene,
    /// dB on training rays, before and after.
    psnr: [f64; 2],
    /// Rounds of growing; empty for shrinking.
    rounds: Vec<GrowRound>,
    /// Why the scene is the one before, if it is.
    unchanged: Option<&'static str>,
}

/// Why a scene does not change whose size is what is asked for.
const MEETS_GOAL: &str = "the scene meets the goal already";

/// Shrinks.
pub(super) fn run_shrink(args: &ShrinkArgs, session: &Session) -> Result<(), Error> {
    let goal = match (args.goal.max_params, args.goal.max_loss) {
        (Some(most), _) => Some(ShrinkGoal::Parameters(most)),
        (None, most) => most.map(ShrinkGoal::Loss),
    };
    if goal.is_none() && !args.common.resume {
        return Err(Error::Usage("give --max-params or --max-loss".into()));
    }
    args.common.run(session, |inputs| {
        let (scene, views) = (&inputs.document.scene, &inputs.dataset.views);
        let mut trainer = match goal {
            Some(goal) => shrink(scene.clone(), views, goal, &args.common.tuning(scene, args.steps, SHRINK_SHARE)?)?,
            None => {
                let (checkpoint, scene) = inputs.state.read_training()?;
                Trainer::resume(checkpoint, scene, views)?
            }
        };
        let before = trainer.psnr_of(scene);
        if goal.is_some_and(|goal| goal.is_met_by(scene)) {
            return Ok(Resized {
                scene: scene.clone(),
                psnr: [before; 2],
                rounds: Vec::new(),
                unchanged: Some(MEETS_GOAL),
            });
        }
        run_steps(&mut trainer, &inputs.state, args.checkpoint_every, &inputs.interrupted, session)?;
        let scene = compacted(&trainer)?;
        Ok(Resized { psnr: [before, trainer.psnr_of(&scene)], scene, rounds: Vec::new(), unchanged: None })
    })
}

/// Grows.
pub(super) fn run_grow(args: &GrowArgs, session: &Session) -> Result<(), Error> {
    if args.max_params.is_none() && !args.common.resume {
        return Err(Error::Usage("give --max-params".into()));
    }
    args.common.run(session, |inputs| {
        let (original, views) = (&inputs.document.scene, &inputs.dataset.views);
        let begin = |most, tuning| Growing::begin(original.clone(), views, most, tuning);
        let mut growing = match args.max_params {
            Some(most) => begin(most, args.common.tuning(original, args.steps, GROW_SHARE)?)?,
            None => {
                let (state, scene) = inputs.state.read_growing()?;
                let tuning = Tuning { steps: state.steps, config: state.config.clone() };
                begin(state.max_parameters, tuning)?.resume(state, scene).map_err(|e| inputs.state.refused(&e))?
            }
        };
        let mut meter: Option<RoundMeter> = None;
        let mut stepped = |step: &GrowStep| {
            if inputs.interrupted.load(Ordering::SeqCst) {
                return Err(Error::Runtime("interrupted".into()));
            }
            // A round may end before its last step: the meter starts anew at step 1.
            let begun = match &mut meter {
                Some(begun) if step.steps[0] > 1 => begun,
                _ => meter.insert(RoundMeter::start(step, &session.console)),
            };
            begun.add(step);
            if step.steps[0] == step.steps[1]
                && let Some(ended) = meter.take()
            {
                ended.finish();
            }
            Ok(())
        };
        let after = |rounds: usize| plural(rounds, "round");
        loop {
            // From the first on: every interruption leaves a state.
            inputs.state.write(growing.scene(), |scene| growing.state().to_bytes(scene))?;
            let rounds = growing.rounds().len();
            let has_grown = growing.round(&mut stepped);
            if inputs.interrupted.load(Ordering::SeqCst) {
                // The scene is that of the last whole round.
                return Err(inputs.state.interrupted(&after(rounds)));
            }
            if !has_grown? {
                break;
            }
        }
        let rounds = growing.rounds().to_vec();
        let finished = growing.finish(&mut stepped);
        if inputs.interrupted.load(Ordering::SeqCst) {
            return Err(inputs.state.interrupted(&after(rounds.len())));
        }
        let scene = finished?;
        let unchanged = match growing.state() {
            state if original.nonzero_parameter_count() >= state.max_parameters => Some(MEETS_GOAL),
            _ => rounds.is_empty().then_some("nothing larger is better"),
        };
        Ok(Resized { psnr: [original, &scene].map(|scene| growing.psnr_of(scene)), scene, rounds, unchanged })
    })
}

/// The files that a command reads, and the flag of Ctrl-C.
struct Inputs {
    document: SceneFile,
    dataset: Dataset,
    state: StateFile,
    interrupted: Arc<AtomicBool>,
}

impl Common {
    /// Resizes the scene by `resized`, and writes and reports the result.
    fn run(&self, session: &Session, resized: impl FnOnce(&Inputs) -> Result<Resized, Error>) -> Result<(), Error> {
        check_scene_name(&self.output)?;
        check_output(&self.output, session.force)?;
        if let Some(path) = &self.picture {
            check_output(path, session.force)?;
        }
        let state = StateFile::new(self.checkpoint.as_deref(), &self.output, self.resume, session)?;
        let (document, _) = scene_file::read(&self.file, &session.console)?;
        let interrupted = session.interrupts()?;
        let dataset = dataset::load(&self.dataset, "train", &self.basics.photographs(&self.dataset, None, session)?)?;
        let start = Instant::now();
        let inputs = Inputs { document, dataset, state, interrupted };
        let Resized { scene, psnr, rounds, unchanged } = resized(&inputs)?;
        let Inputs { document, dataset, state, .. } = inputs;
        let parameters = [&document.scene, &scene].map(Scene::nonzero_parameter_count);
        let cells = Cells::new([&document.scene, &scene], &dataset.views, &self.basics.configuration(None)?)?;
        let metadata = Metadata {
            license: document.metadata.license,
            views: document.metadata.views,
            cameras: document.metadata.cameras,
            ..Metadata::default()
        };
        let options = EncodeOptions::uniform(self.encoding.factors());
        let bytes =
            container::encode_scene_file(&scene, &metadata, &options).map_err(|e| Error::container(&self.output, e))?;
        write_atomically(&self.output, &bytes, session.force)?;
        if let Some(path) = &self.picture {
            let (size, colors) = picture::draw(&cells.named()).map_err(Error::Runtime)?;
            write_atomically(path, &color_png(size, &colors)?, session.force)?;
        }
        state.remove()?;
        let scales = document.scene.scales.iter().zip(&scene.scales);
        let report = Report {
            file: &self.output,
            bytes: bytes.len() as u64,
            parameters,
            psnr,
            rounds,
            scales: scales.map(|(before, after)| [ScaleUse::of(before), ScaleUse::of(after)]).collect(),
            cells: cells.kinds(),
            seconds: start.elapsed().as_secs_f64(),
            unchanged,
        };
        session.console.result(&report, Report::text)
    }

    /// The training of `scene`: `steps`, or the preset's divided by `share`.
    fn tuning(&self, scene: &Scene, steps: Option<u64>, share: u64) -> Result<Tuning, Error> {
        let of_file = Some(scene.provenance.preset.as_str()).filter(|name| TrainConfig::PRESETS.contains(name));
        let preset = self.preset.map(Preset::name).or(of_file.filter(|_| self.basics.config.is_none()));
        let config = self.basics.configuration(preset)?;
        let steps = steps.unwrap_or(config.steps.div_ceil(share));
        Ok(Tuning { steps, config })
    }
}
