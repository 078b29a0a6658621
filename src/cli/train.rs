//! `strivec train`: train a scene from photographs.

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

use serde::Serialize;

use super::background::background_of;
use super::output::check_scene_name;
use super::pack::{Extras, Packing};
use super::prior::Inputs;
use super::render::colors;
use super::scale_table::{self, ScaleRow};
use super::settings::{Fitting, Precision, Settings};
use super::state_file::{StateFile, beside};
use super::table::plural;
use super::training::{Meter, cameras, find_distances, import, is_opaque, place, reconstruct, step};
use super::view_selection::evenly_spaced;
use super::watch::Watch;
use super::{Error, Session, check_output, refined_poses, write_atomically};
use crate::container::{self, EncodeOptions, Encoding, Metadata, TrainingCamera};
use crate::dataset::{self, Dataset, LoadOptions, View};
use crate::digits::grouped;
use crate::escape::escaped_path;
use crate::geometry::Camera;
use crate::measure::ViewReport;
use crate::model::{Frame, Scene};
use crate::psnr::psnr_of_mse;
use crate::render::{CpuRenderer, Renderer, Turntable};
use crate::train::{DeadComponents, TrainConfig, Trainer};

const EXAMPLES: &str = "\
Examples:
  strivec train lego -o lego.strivec --preset 24
  strivec train lego -o small.strivec --preset fast --steps 3000 --downscale 4 --log curve.csv
  strivec train lego -o lego.strivec --bootstrap --prune
  strivec train --preset 48 --print-config > mine.toml
  strivec train lego -o lego.strivec --config mine.toml --checkpoint lego.state --checkpoint-every 1000
  strivec train lego -o lego.strivec --checkpoint lego.state --resume
  strivec train lego -o small.strivec --auto --max-size 10MB
  strivec train scan -o scan.strivec --prior mesh.ply --close 0.1

Ctrl-C writes the checkpoint and stops with exit code 4; a second Ctrl-C stops at once.";

/// The arguments.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct Args {
    /// Dataset folder
    #[arg(required_unless_present = "print_config")]
    pub(super) dataset: Option<PathBuf>,
    /// Scene file to write
    #[arg(long, short, value_name = "FILE", required_unless_present = "print_config")]
    pub(super) output: Option<PathBuf>,
    #[command(flatten)]
    pub(super) settings: Settings,
    #[command(flatten)]
    pub(super) fitting: Fitting,
    #[command(flatten)]
    pub(super) prior: Inputs,
    /// Print the resulting settings as TOML and exit
    #[arg(long, conflicts_with = "fitting")]
    pub(super) print_config: bool,
    /// Keep dead components, those that no training ray uses [default: cleared after the last step]
    #[arg(long)]
    pub(super) keep_dead: bool,
    /// Checkpoint of an unfinished run [default: OUTPUT.state]
    #[arg(long, value_name = "PATH")]
    pub(super) checkpoint: Option<PathBuf>,
    /// Write the checkpoint every N steps [default: only when interrupted]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    pub(super) checkpoint_every: Option<u64>,
    /// Resume from the checkpoint with its settings; the result is byte-identical to an uninterrupted run
    #[arg(long, conflicts_with_all = ["preset", "config", "steps", "batch", "seed", "background", "sky", "near", "fitting",
        "files", "bootstrap", "prune"])]
    pub(super) resume: bool,
    /// CSV table of steps, seconds and PSNR; grows during the run
    #[arg(long, value_name = "CSV")]
    pub(super) log: Option<PathBuf>,
    /// Encoding of the factors
    #[arg(long, value_enum, default_value_t)]
    pub(super) encoding: Precision,
    /// Write a view beside its photograph to this PNG file while the scene is trained: the first test view if there are any
    #[arg(long, value_name = "PNG")]
    pub(super) watch: Option<PathBuf>,
    /// Measure PSNR on up to 20 test views every N steps [default: never]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    pub(super) eval_every: Option<u64>,
}

/// Trains a scene and writes it.
pub(super) fn run(args: &Args, session: &Session) -> Result<(), Error> {
    let config = args.settings.configuration()?;
    if args.print_config {
        return session.console.print(&config.to_toml());
    }
    session.console.result(&trained(args, config, session)?, Trained::text)
}

/// Trains a scene by `config` and writes it, as `args` say.
pub(super) fn trained<'a>(args: &'a Args, mut config: TrainConfig, session: &Session) -> Result<Trained<'a>, Error> {
    let (Some(folder), Some(output)) = (&args.dataset, &args.output) else {
        return Err(Error::Usage("give a dataset and --output".into()));
    };
    let files = Files::new(args, output, session)?;
    let interrupted = session.interrupts()?;
    let saved = if args.resume { Some(files.state.read_training()?) } else { None };
    let max_side = saved.as_ref().map_or(&config, |(checkpoint, _)| &checkpoint.config).max_photograph_side;
    let options = args.settings.basics.photographs(folder, max_side, session)?;
    let mut dataset = dataset::load(folder, "train", &options)?;
    session.console.say(&contents(&dataset));
    let held_out = match args.eval_every {
        Some(_) => held_out(folder, &options)?,
        None => Vec::new(),
    };
    let watch = args.watch.as_ref().map(|path| watch(path, folder, &options, &dataset, &config)).transpose()?;

    let start = Instant::now();
    let mut trainer = match saved {
        Some((progress, scene)) => {
            find_distances(&progress.config, &mut dataset, session)?;
            Trainer::resume(progress, scene, &dataset.views).map_err(Error::from)?
        }
        None => {
            let cameras = cameras(&dataset);
            let occupied = match import(&mut config, &args.prior, &cameras, &interrupted, session)? {
                Some(occupied) => {
                    find_distances(&config, &mut dataset, session)?;
                    occupied
                }
                None => reconstruct(&mut config, &mut dataset, args.prior.bootstrap, &interrupted, session)?,
            };
            let (config, occupied) = args.fitting.fit(config, &cameras, occupied, session)?;
            place(config, &dataset, &occupied, session)?
        }
    };
    trainer.add_seconds(start.elapsed().as_secs_f64());
    let mut run = Run { args, session, files: &files, held_out: &held_out, watch, curve: Vec::new() };
    run.train(&mut trainer, &interrupted)?;

    let mut scene = trainer.unrounded_scene();
    let cameras = model_cameras(&dataset, &scene.frame);
    let extras = Extras::usual(trainer.config().seed);
    let packing = |scene| Packing::new(scene, Metadata::default(), cameras.clone(), None, &extras, &session.console);
    let max_bytes = trainer.config().max_file_bytes;
    let is_free = trainer.config().background == TrainConfig::default().background;
    let with_background = |mut scene: Scene| {
        if is_free && scene.rules.sky.is_none() && is_opaque(&dataset) {
            // Where no tensor is, training had a color for which no wall passes.
            scene.frame.background = background_of(&scene, &dataset.views);
        }
        scene
    };
    let mut dead_components = None;
    let mut finished = None;
    if trainer.rounding().is_none() {
        dead_components = (!args.keep_dead).then(|| trainer.prune_dead_components(&mut scene)).transpose()?;
        let seen = with_background(scene.clone());
        let bytes = encode_with_views(&seen, &cameras, args.encoding.factors(), output)?;
        match max_bytes.filter(|&most| bytes.len() as u64 > most) {
            None => finished = Some((seen, bytes)),
            Some(most) => {
                let steps = trainer.config().steps_for_size();
                packing(scene).begin_for_size(&mut trainer, most, steps, output)?;
            }
        }
    }
    let (scene, bytes) = match finished {
        Some(finished) => finished,
        None => {
            run.train(&mut trainer, &interrupted)?;
            let scene = with_background(trainer.unrounded_scene());
            let (scene, bytes, _) = packing(scene).finish_for_size(&trainer, max_bytes.unwrap_or(u64::MAX), output)?;
            (scene, bytes)
        }
    };
    write_atomically(output, &bytes, session.force)?;
    if let Some(refined) = trainer.refined_cameras() {
        refined_poses::write(&files.poses, &dataset.views, &refined, session)?;
    }
    files.state.remove()?;
    Ok(Trained {
        file: output,
        bytes: bytes.len() as u64,
        parameters: scene.nonzero_parameter_count(),
        given_up: scene.parameter_count() - scene.nonzero_parameter_count(),
        steps: trainer.steps_in_all(),
        seconds: trainer.checkpoint().seconds,
        scales: scale_table::rows(&scene),
        dead_components,
        curve: run.curve,
    })
}

/// Up to [`HELD_OUT`] test views in `folder`, evenly spread.
fn held_out(folder: &Path, options: &LoadOptions) -> Result<Vec<View>, Error> {
    let options = evenly_spaced(folder, "test", HELD_OUT, options)?;
    Ok(dataset::load(folder, "test", &options)?.views)
}

/// Shows the first test view in `folder`; without any, the first that is trained on.
fn watch(
    path: &Path,
    folder: &Path,
    options: &LoadOptions,
    dataset: &Dataset,
    config: &TrainConfig,
) -> Result<Watch, Error> {
    let first = LoadOptions { every: 1, views: Some(0..1), ..options.clone() };
    let test = dataset::load(folder, "test", &first).map_or_else(|_| Vec::new(), |test| test.views);
    let view = test.first().or(dataset.views.first());
    let view = view.ok_or_else(|| Error::Runtime("there is no photograph to watch".into()))?;
    Watch::new(path.to_path_buf(), view, config.background)
}

/// The cameras of `dataset` in the space of the model of `frame`.
fn model_cameras(dataset: &Dataset, frame: &Frame) -> Vec<TrainingCamera> {
    let map = frame.model_from_dataset;
    cameras(dataset).iter().map(|camera| TrainingCamera::from(&camera.mapped(&map))).collect()
}

/// The bytes of `scene`'s file: with viewpoints by the photographs' `cameras`, unless these are all around the scene.
fn encode_with_views(
    scene: &Scene,
    cameras: &[TrainingCamera],
    factors: Encoding,
    path: &Path,
) -> Result<Vec<u8>, Error> {
    let turn = Turntable::of(scene, None, cameras);
    let views = turn.map(|turn| turn.views(Turntable::POSES, Turntable::SECONDS));
    let metadata = Metadata { views, ..Metadata::default() };
    let bytes = container::encode_scene_file(scene, &metadata, &EncodeOptions::uniform(factors));
    bytes.map_err(|e| Error::Runtime(format!("{}: {e}", path.display())))
}

/// One line on the photographs that are trained on.
fn contents(dataset: &Dataset) -> String {
    let Dataset { name, views, lost, left_out, .. } = dataset;
    let largest = |extent: fn(&Camera) -> u32| views.iter().map(|view| extent(&view.camera)).max().unwrap_or(0);
    let [width, height] = [largest(|camera| camera.width), largest(|camera| camera.height)];
    let photographs = plural(views.len(), "photograph");
    let mut text = format!("{name}: {photographs} to train on, {width}x{height} pixels at most");
    let distorted = views.iter().filter(|view| !view.camera.lens.is_pinhole()).count();
    let masked = views.iter().filter(|view| view.mask.is_some()).count();
    for (count, what) in
        [(distorted, "with a lens"), (masked, "with a mask"), (*lost, "without a pose"), (left_out.len(), "missing")]
    {
        if count > 0 {
            text += &format!(", {count} {what}");
        }
    }
    text
}

/// The result, as `--json` prints it.
#[derive(Serialize)]
pub(super) struct Trained<'a> {
    file: &'a Path,
    pub(super) bytes: u64,
    /// Those in the file.
    pub(super) parameters: u64,
    /// Those of components that training gave up, dead ones included.
    given_up: u64,
    steps: u64,
    /// Time of prior and training, without loading, evaluating and writing.
    pub(super) seconds: f64,
    scales: Vec<ScaleRow>,
    /// Cleared after the last step; absent with `--keep-dead`.
    dead_components: Option<DeadComponents>,
    curve: Vec<CurvePoint>,
}

impl Trained<'_> {
    fn text(&self) -> String {
        let table = scale_table::text(&self.scales);
        let dead = self.dead_components.as_ref().map_or_else(String::new, dead_text);
        let (left, all) = (grouped(self.parameters), grouped(self.parameters + self.given_up));
        let (size, minutes) = (self.bytes as f64 / 1e6, self.seconds / 60.0);
        let steps = plural(self.steps as usize, "step");
        format!(
            "{table}{dead}{left} of {all} parameters are left\n{}: {size:.2} MB, {steps} in {minutes:.1} min",
            escaped_path(self.file)
        )
    }
}

/// A line on the cleared components of a scene.
fn dead_text(dead: &DeadComponents) -> String {
    let DeadComponents { tensors_dropped, components_dropped, parameters_saved, psnr_before, psnr_after } = *dead;
    if components_dropped == 0 {
        return "cleared: no dead components\n".into();
    }
    format!(
        "cleared: {}, {}, {} parameters; {psnr_after:.3} dB on training rays ({psnr_before:.3} dB before)\n",
        plural(components_dropped as usize, "dead component"),
        plural(tensors_dropped as usize, "empty tensor"),
        grouped(parameters_saved),
    )
}

/// A row of the log.
#[derive(Clone, Copy, Serialize)]
struct CurvePoint {
    step: u64,
    seconds: f64,
    /// PSNR over the steps since the previous row.
    train_psnr: f64,
    test_psnr: Option<f64>,
}

/// A run with its checkpoints and its log.
struct Run<'a> {
    args: &'a Args,
    session: &'a Session,
    files: &'a Files,
    held_out: &'a [View],
    watch: Option<Watch>,
    curve: Vec<CurvePoint>,
}

/// Maximum rows of the log, besides those of evaluations.
const ROWS: u64 = 500;
/// Maximum held-out views that an evaluation during the run renders.
const HELD_OUT: usize = 20;

impl Run<'_> {
    fn train(&mut self, trainer: &mut Trainer<'_>, interrupted: &AtomicBool) -> Result<(), Error> {
        let steps = trainer.config().steps;
        let row_every = (steps / ROWS).max(1);
        self.write_log()?;
        let mut meter = Meter::start(&self.session.console, trainer);
        let (mut error_sum, mut error_count) = (0.0, 0.0);
        let mut since = Instant::now();
        while trainer.steps_done() < steps {
            let report = step(trainer)?;
            meter.add(&report, trainer);
            error_sum += report.mean_squared_error;
            error_count += 1.0;
            let step = report.step;
            let stop = interrupted.load(Ordering::SeqCst) && step < steps;
            let due = |every: Option<u64>| every.is_some_and(|n| step.is_multiple_of(n));
            let evaluates = self.args.eval_every.is_some() && (due(self.args.eval_every) || step == steps);
            let has_row = evaluates || due(Some(row_every)) || step == steps;
            let shows = self.watch.as_ref().is_some_and(|watch| step == steps || watch.is_due());
            if stop || due(self.args.checkpoint_every) || has_row || shows {
                trainer.add_seconds(since.elapsed().as_secs_f64());
                since = Instant::now();
                if has_row {
                    let test_psnr = evaluates.then(|| self.evaluate(&trainer.scene()));
                    let train_psnr = psnr_of_mse(error_sum / error_count);
                    let seconds = trainer.checkpoint().seconds;
                    let step = trainer.steps_in_all();
                    self.curve.push(CurvePoint { step, seconds, train_psnr, test_psnr });
                    (error_sum, error_count) = (0.0, 0.0);
                    self.write_log()?;
                }
                if let Some(watch) = self.watch.as_mut().filter(|_| shows) {
                    meter.suspend(|| watch.show(trainer))?;
                }
                if stop || due(self.args.checkpoint_every) {
                    self.files.state.write_training(trainer)?;
                }
                meter.skip(since.elapsed());
                since = Instant::now();
            }
            if stop {
                return Err(self.files.state.interrupted(&format!("step {step}")));
            }
        }
        meter.finish();
        Ok(())
    }

    /// The mean PSNR over the held-out views.
    fn evaluate(&self, scene: &Scene) -> f64 {
        let renderer = CpuRenderer::new(scene);
        let background = scene.frame.background;
        let psnrs: Vec<f64> = (self.held_out.iter())
            .map(|view| {
                let picture = renderer.render(&view.camera.mapped(&scene.frame.model_from_dataset));
                let size = [picture.width, picture.height];
                let (photograph, mask) = (view.pixels.colors(background), view.mask.as_deref());
                ViewReport::new(&view.name, size, &colors(&picture), &photograph, mask).map_or(f64::NAN, |r| r.psnr)
            })
            .collect();
        psnrs.iter().sum::<f64>() / psnrs.len() as f64
    }

    fn write_log(&self) -> Result<(), Error> {
        let Some(path) = &self.args.log else { return Ok(()) };
        let mut text = String::from("step,seconds,train_psnr,test_psnr\n");
        for row in &self.curve {
            let test = row.test_psnr.map_or_else(String::new, |p| format!("{p:.3}"));
            text += &format!("{},{:.1},{:.3},{test}\n", row.step, row.seconds, row.train_psnr);
        }
        // The start of the run checked that the file may be written.
        write_atomically(path, text.as_bytes(), true)
    }
}

/// The files of a run that change before its end.
struct Files {
    /// The checkpoint.
    state: StateFile,
    /// The refined poses.
    poses: PathBuf,
}

impl Files {
    /// Checks that all output files can be written, before any work.
    fn new(args: &Args, output: &Path, session: &Session) -> Result<Self, Error> {
        check_scene_name(output)?;
        check_output(output, session.force)?;
        let poses = beside(output, ".poses.json");
        check_output(&poses, session.force)?;
        let state = StateFile::new(args.checkpoint.as_deref(), output, args.resume, session)?;
        for path in [&args.log, &args.watch].into_iter().flatten().filter(|_| !args.resume) {
            check_output(path, session.force)?;
        }
        Ok(Self { state, poses })
    }
}
