//! `strivec train`: train a scene from photographs.

use std::path::{Path, PathBuf};

use serde::Serialize;

use super::observer::ConsoleObserver;
use super::output::check_scene_name;
use super::prior::Inputs;
use super::scale_table::{self, ScaleRow};
use super::settings::{Fitting, Precision, Settings};
use super::table::plural;
use super::training_curve::{CurveObserver, CurvePoint};
use super::view_selection::evenly_spaced;
use super::watch::Watch;
use super::{Context, Error, check_output};
use strivec_capture::dataset;
use strivec_capture::dataset::{Dataset, LoadOptions, Photograph};
use strivec_format::digits::grouped;
use strivec_format::escape::escaped_path;
use strivec_recipe as recipe;
use strivec_recipe::{CheckpointFile, Recipe, Reservation, Trained};
use strivec_train::{DeadComponents, TrainConfig};

/// Maximum held-out views that an evaluation during the run renders.
const HELD_OUT: usize = 20;

const EXAMPLES: &str = "\
Examples:
  strivec train lego -o lego.strivec --preset fast --steps 3000 --downscale 4
  strivec train --preset 48 --print-config > mine.toml
  strivec train scan -o scan.strivec --config mine.toml --prior mesh.ply --max-size 10MB

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
    /// Keep the components that no training ray uses [default: cleared after the last step]
    #[arg(long, hide_short_help = true)]
    pub(super) keep_dead: bool,
    /// Checkpoint of an unfinished run [default: OUTPUT.state]
    #[arg(long, value_name = "PATH", help_heading = "Run")]
    pub(super) checkpoint: Option<PathBuf>,
    /// Write the checkpoint every N steps [default: only when interrupted]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..), help_heading = "Run")]
    pub(super) checkpoint_every: Option<u64>,
    /// Resume from the checkpoint, with its settings
    ///
    /// The result is byte-identical to that of an uninterrupted run.
    #[arg(long, conflicts_with_all = ["preset", "config", "set", "steps", "seed", "fitting", "files", "bootstrap"],
        help_heading = "Run")]
    pub(super) resume: bool,
    /// CSV table of steps, seconds and PSNR; grows during the run
    #[arg(long, value_name = "CSV", help_heading = "Run")]
    pub(super) log: Option<PathBuf>,
    /// Encoding of the factors
    #[arg(long, value_enum, default_value_t)]
    pub(super) encoding: Precision,
    /// Picture of a view beside its photograph; changes during the run
    ///
    /// The view is the first test view, or without any the first training view.
    #[arg(long, value_name = "PNG", help_heading = "Run")]
    pub(super) watch: Option<PathBuf>,
    /// Measure PSNR on up to 20 test views every N steps [default: never]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..), help_heading = "Run")]
    pub(super) eval_every: Option<u64>,
}

/// Trains a scene and writes it.
pub(super) fn run(args: &Args, session: &Context) -> Result<(), Error> {
    let config = args.settings.configuration()?;
    if args.print_config {
        return session.console.print(&config.to_toml());
    }
    session.console.result(&trained(args, config, session)?, Report::text)
}

/// Trains a scene by `config` and writes it, as `args` say.
pub(super) fn trained<'a>(args: &'a Args, config: TrainConfig, session: &Context) -> Result<Report<'a>, Error> {
    let (Some(folder), Some(output)) = (&args.dataset, &args.output) else {
        return Err(Error::Usage("give a dataset and --output".into()));
    };
    let _reserved = args.check_outputs(output, session)?;
    let recipe = args.recipe(config, output);
    let interrupted = session.interrupts()?;
    let training = recipe.begin()?;
    let options = args.settings.basics.photographs(folder, training.max_photograph_side(), session)?;
    let mut console = ConsoleObserver::new(&session.console, &interrupted);
    let mut dataset = recipe::load(folder, &options, &mut console)?;
    let held_out = match args.eval_every {
        Some(_) => held_out(folder, &options)?,
        None => Vec::new(),
    };
    let watch = args.watch.as_ref().map(|path| watch(path, folder, &options, &dataset, &recipe.config)).transpose()?;
    let mut observer = CurveObserver::new(console, args, &held_out, watch);
    let trained = training.run(&mut dataset, &mut observer).map_err(Error::recipe(output))?;
    trained.write(output, session.force, &mut observer)?;
    Ok(Report::new(output, trained, observer.into_curve()))
}

impl Args {
    /// Checks that all output files can be written, before any work, and reserves them.
    fn check_outputs(&self, output: &Path, session: &Context) -> Result<Vec<Reservation>, Error> {
        check_scene_name(output)?;
        let mut reserved = Vec::from(Trained::check_output(output, session.force)?);
        if !self.resume {
            self.checkpoint_file(output).check_new(session.force)?;
            for path in [&self.log, &self.watch].into_iter().flatten() {
                reserved.push(check_output(path, session.force)?);
            }
        }
        Ok(reserved)
    }

    fn checkpoint_file(&self, output: &Path) -> CheckpointFile {
        let file = self.checkpoint.as_ref().map_or_else(|| CheckpointFile::beside(output), CheckpointFile::new);
        CheckpointFile { every: self.checkpoint_every, ..file }
    }

    /// The recipe of these arguments and of `config`.
    fn recipe(&self, config: TrainConfig, output: &Path) -> Recipe {
        Recipe {
            prior: self.prior.prior(),
            fitting: self.fitting.fitting(),
            keep_dead: self.keep_dead,
            encoding: self.encoding.factors(),
            checkpoint: Some(self.checkpoint_file(output)),
            resume: self.resume,
            ..Recipe::new(config)
        }
    }
}

/// Up to [`HELD_OUT`] test views in `folder`, evenly spread.
fn held_out(folder: &Path, options: &LoadOptions) -> Result<Vec<Photograph>, Error> {
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
    Watch::new(path.to_path_buf(), view, config.photographs.background)
}

/// The result, as `--json` prints it.
#[derive(Serialize)]
pub(super) struct Report<'a> {
    file: &'a Path,
    pub(super) bytes: u64,
    /// Parameters in the file.
    pub(super) parameters: u64,
    /// Parameters of components that training gave up, dead ones included.
    given_up: u64,
    steps: u64,
    /// Time of prior and training, without loading, evaluating and writing.
    pub(super) seconds: f64,
    scales: Vec<ScaleRow>,
    /// Cleared after the last step; absent with `--keep-dead`.
    dead_components: Option<DeadComponents>,
    curve: Vec<CurvePoint>,
}

impl<'a> Report<'a> {
    fn new(file: &'a Path, trained: Trained, curve: Vec<CurvePoint>) -> Self {
        let Trained { scene, bytes, steps, seconds, dead_components, .. } = trained;
        Self {
            file,
            bytes: bytes.len() as u64,
            parameters: scene.nonzero_parameter_count(),
            given_up: scene.parameter_count() - scene.nonzero_parameter_count(),
            steps,
            seconds,
            scales: scale_table::rows(&scene),
            dead_components,
            curve,
        }
    }

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
