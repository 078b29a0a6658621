//! `strivec plan`: estimate size, memory and time of a training.

use std::path::PathBuf;
use std::time::Instant;

use serde::Serialize;

use super::observer::ConsoleObserver;
use super::prior::Inputs;
use super::scale_table::{self, ScaleRow};
use super::settings::{Fitting, Settings};
use super::table::plural;
use super::{Context, Error};
use crate::bench::lab;
use strivec_capture::dataset;
use strivec_format::digits::grouped;
use strivec_train as train;
use strivec_train::{PhotographMemory, Plan};

const EXAMPLES: &str = "\
Examples:
  strivec plan lego --preset 24
  strivec plan lego --downscale 4 --auto
  strivec plan scan --prior mesh.ply --auto --max-size 5MB --json
  strivec plan lego --auto --max-params 3.5M --print-config > mine.toml

Without --prior the coarse reconstruction runs, as in training. With `--set lean.max_loss=0`, parameter counts are exact, file sizes are estimated \
within a few percent, memory within a third, minutes within a factor of two, for scenes similar to the measured ones. Without it, \
training gives up what the pictures do not need: on the measured scenes, a tenth to a quarter of the parameters and bytes were left, \
after a third to six tenths of the minutes.";

/// The arguments.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct Args {
    /// Dataset folder
    dataset: PathBuf,
    #[command(flatten)]
    settings: Settings,
    #[command(flatten)]
    fitting: Fitting,
    /// Print the settings that training would use instead of the plan
    #[arg(long)]
    print_config: bool,
    #[command(flatten)]
    prior: Inputs,
}

/// The result, as `--json` prints it.
#[derive(Serialize)]
struct Report {
    scales: Vec<ScaleRow>,
    /// Weights and biases of the network.
    decoder_parameters: u64,
    /// All trained parameters.
    parameters: u64,
    /// Size of the file in 16-bit floating point.
    file_bytes: u64,
    /// Size that the scene is trained for in the end, if its file would be larger.
    max_file_bytes: Option<u64>,
    /// Peak memory of training.
    memory_bytes: u64,
    /// Time of the training steps.
    minutes: f64,
    /// True if training prunes components: the scene then has at most `parameters`, its file at most `file_bytes`, and
    /// training takes at most `minutes`.
    gives_up_parameters: bool,
    /// Time of the coarse reconstruction; absent if the prior is from files.
    prior_seconds: Option<f64>,
    machine: MachineFigures,
    /// Reasons of the settings, and advice from the photographs.
    reasons: Vec<String>,
}

/// The machine's speed, from which minutes are estimated.
#[derive(Serialize)]
struct MachineFigures {
    threads: usize,
    /// FLOP/s of a thread in matrix products.
    product_flops: f64,
    /// Numbers per second that a thread gathers from its cache.
    gathered: f64,
}

/// Estimates size, memory and time.
pub(super) fn run(args: &Args, session: &Context) -> Result<(), Error> {
    let mut config = args.settings.configuration()?;
    let options = args.settings.basics.photographs(&args.dataset, config.photographs.max_side, session)?;
    let named = dataset::load_cameras(&args.dataset, "train", None, &options)?;
    let cameras: Vec<_> = named.into_iter().map(|n| n.camera).collect();
    let interrupted = session.interrupts()?;
    let start = Instant::now();
    let prior = args.prior.prior();
    let mut observer = ConsoleObserver::new(&session.console, &interrupted);
    let (occupied, prior_seconds) = match prior.from_files(&mut config, &cameras, &mut observer)? {
        Some(occupied) => (occupied, None),
        None => {
            let mut dataset = dataset::load(&args.dataset, "train", &options)?;
            let occupied = prior.from_photographs(&mut config, &mut dataset, &mut observer)?;
            (occupied, Some(start.elapsed().as_secs_f64()))
        }
    };
    let (config, occupied, mut reasons) = args.fitting.fitting().fit(config, &cameras, occupied)?;
    if args.print_config {
        reasons.iter().for_each(|reason| session.console.say(reason));
        return session.console.print(&config.to_toml());
    }
    let photographs = if options.downscale == 1 { PhotographMemory::Bytes } else { PhotographMemory::Floats };
    let speed = lab::machine_speed();
    let plan = train::plan(&config, &cameras, photographs, &occupied, &speed)?;
    let scales = scale_table::planned(&plan);
    let Plan { decoder_parameters, parameters, file_bytes, memory_bytes, minutes, .. } = plan;
    // Settings fitted to the photographs alone have these reasons already.
    if !args.fitting.is_by_photographs_alone() {
        reasons.extend(plan.reasons);
    }
    let machine =
        MachineFigures { threads: speed.threads, product_flops: speed.product_flops, gathered: speed.gathered };
    let report = Report {
        scales,
        decoder_parameters,
        parameters,
        file_bytes,
        max_file_bytes: config.schedule.max_file_bytes.filter(|&most| most < file_bytes),
        memory_bytes,
        minutes,
        gives_up_parameters: config.lean.is_on(),
        prior_seconds,
        machine,
        reasons,
    };
    session.console.result(&report, Report::text)
}

impl Report {
    fn text(&self) -> String {
        let threads = plural(self.machine.threads, "thread");
        let duration = match self.minutes {
            minutes if minutes < 120.0 => format!("{minutes:.1} min"),
            minutes => format!("{:.1} hours", minutes / 60.0),
        };
        let (most, about) = if self.gives_up_parameters { ("at most ", "at most ") } else { ("", "about ") };
        let (mut file, mut more) =
            (format!("{about}{:.2} MB in 16-bit floating point", self.file_bytes as f64 / 1e6), "");
        if let Some(most) = self.max_file_bytes {
            (file, more) = (format!("at most {:.2} MB", most as f64 / 1e6), ", and a quarter more for the file's size");
        }
        let lines = [
            ("network", format!("{} parameters", grouped(self.decoder_parameters))),
            ("parameters", format!("{most}{}", grouped(self.parameters))),
            ("file", file),
            ("memory", format!("about {:.1} GB at the peak", self.memory_bytes as f64 / 1e9)),
            ("training", format!("{about}{duration} with {threads} of this machine{more}")),
        ];
        let figures: String = lines.iter().map(|(name, value)| format!("{name:<10}  {value}\n")).collect();
        let reasons: String = self.reasons.iter().map(|reason| format!("- {reason}\n")).collect();
        format!("{}\n{figures}\n{reasons}", scale_table::text(&self.scales))
    }
}
