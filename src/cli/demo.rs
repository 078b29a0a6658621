//! `strivec demo`: make a synthetic dataset, train on it, evaluate the result.

use std::path::PathBuf;
use std::time::Instant;

use serde::Serialize;

use super::observer::ConsoleObserver;
use super::output::{check_outputs, make_folder};
use super::render::colors;
use super::table::plural;
use super::{Context, Error, write_atomically};
use strivec_capture::dataset;
use strivec_capture::dataset::LoadOptions;
use strivec_field::render::{CpuRenderer, Renderer};
use strivec_format::container;
use strivec_format::container::{EncodeOptions, Encoding};
use strivec_format::escape::escaped_path;
use strivec_measure as measure;
use strivec_measure::{ERROR_FULL, Sheet, ViewReport, color_png, error_map, side_by_side, stacked};
use strivec_recipe as recipe;
use strivec_recipe::Recipe;
use strivec_synth::SynthOptions;
use strivec_train::TrainConfig;

const EXAMPLES: &str = "\
Examples:
  strivec demo
  strivec demo --out /tmp/demo --seed 7";

/// Settings of the training.
const SETTINGS: &str = include_str!("demo.toml");
const TRAINING_VIEWS: u32 = 60;
const HELD_OUT_VIEWS: u32 = 8;
const SIZE: u32 = 128;
/// Held-out views on the picture sheet.
const ON_SHEET: usize = 3;

/// The arguments.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct Args {
    /// Folder for the dataset, demo.strivec and the picture sheet; created if absent
    #[arg(long, value_name = "DIR", default_value = "demo")]
    pub(super) out: PathBuf,
    /// Random seed
    #[arg(long, value_name = "S", default_value_t = 0)]
    pub(super) seed: u64,
}

/// The result, as `--json` prints it.
#[derive(Serialize)]
struct Demo {
    file: PathBuf,
    sheet: PathBuf,
    bytes: u64,
    parameters: u64,
    seconds_dataset: f64,
    seconds_training: f64,
    #[serde(flatten)]
    report: measure::Report,
}

/// Makes the dataset, trains and evaluates.
pub(super) fn run(args: &Args, session: &Context) -> Result<(), Error> {
    make_folder(&args.out)?;
    let [folder, file, sheet] = ["dataset", "demo.strivec", "sheet.png"].map(|name| args.out.join(name));
    let _reserved = check_outputs(&[file.clone(), sheet.clone()], session.force)?;

    let start = Instant::now();
    session.console.say("making a dataset");
    let options = SynthOptions {
        views: TRAINING_VIEWS,
        test_views: HELD_OUT_VIEWS,
        size: [SIZE, SIZE],
        seed: args.seed,
        force: session.force,
        ..SynthOptions::default()
    };
    strivec_synth::synthesize(&folder, &options)?;
    let seconds_dataset = start.elapsed().as_secs_f64();

    let mut config = TrainConfig::from_toml(SETTINGS, None).map_err(|e| Error::Runtime(e.to_string()))?;
    config.seed = args.seed;
    let load = |split| dataset::load(&folder, split, &LoadOptions::default());
    let (mut training, held_out) = (load("train")?, load("test")?);
    let start = Instant::now();
    let interrupted = session.interrupts()?;
    let mut observer = ConsoleObserver::new(&session.console, &interrupted);
    let start_of_training = Recipe::new(config).prepare(&mut training, &mut observer)?;
    let mut trainer = start_of_training.trainer(&training, &mut observer)?;
    recipe::run_steps(&mut trainer, None, &mut observer)?;
    let scene = trainer.scene();
    let seconds_training = start.elapsed().as_secs_f64();
    let bytes = container::encode(&scene, &EncodeOptions::uniform(Encoding::F16));
    let bytes = bytes.map_err(|e| Error::container(&file, e))?;
    write_atomically(&file, &bytes, session.force)?;

    let renderer = CpuRenderer::unlimited(&scene);
    let (mut reports, mut rows) = (Vec::new(), Vec::new());
    for view in &held_out.views {
        let picture = renderer.render(&view.camera.mapped(&scene.frame.model_from_dataset));
        let (size, rendered) = ([picture.width, picture.height], colors(&picture));
        let photograph = view.pixels.colors(scene.frame.background);
        reports.push(ViewReport::new(&view.name, size, &rendered, &photograph, None)?);
        if rows.len() < ON_SHEET {
            let difference = error_map(&rendered, &photograph, ERROR_FULL)?;
            let pictures = [photograph, rendered, difference].map(|colors| Sheet { size, colors });
            rows.push(side_by_side(&pictures));
        }
    }
    let joined = stacked(&rows);
    write_atomically(&sheet, &color_png(joined.size, &joined.colors)?, session.force)?;
    let report = measure::Report::new(reports).ok_or_else(|| Error::Runtime("no held-out views".into()))?;
    let demo = Demo {
        file,
        sheet,
        bytes: bytes.len() as u64,
        parameters: scene.nonzero_parameter_count(),
        seconds_dataset,
        seconds_training,
        report,
    };
    session.console.result(&demo, |d| {
        format!(
            "{}: {:.2} MB, {:.2} dB on {}\n{}: photograph, rendering, difference\n\
             dataset {:.0} s, training {:.0} s",
            escaped_path(&d.file),
            d.bytes as f64 / 1e6,
            d.report.psnr,
            plural(d.report.views.len(), "held-out view"),
            escaped_path(&d.sheet),
            d.seconds_dataset,
            d.seconds_training,
        )
    })
}
