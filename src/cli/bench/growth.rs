//! `strivec bench growth`: growth of time and memory with the main parameters.

use std::convert::Infallible;

use clap::ValueEnum;
use serde::{Deserialize, Serialize};

use super::process::{json_of, this_build};
use super::repeats::Repeats;
use super::report;
use crate::cli::settings::Preset;
use crate::cli::table::{Table, plural};
use crate::cli::viewpoints::Viewpoints;
use crate::cli::{Error, Session};
use crate::digits::grouped;
use crate::measure::bench::{Growth, MemoryMark, Runs, at_rest, ball, ball_views};
use crate::model::Scene;
use crate::render::{CpuRenderer, Renderer};
use crate::train::{TrainConfig, Trainer};

const EXAMPLES: &str = "\
Examples:
  strivec bench growth
  strivec bench growth --preset per-ray --runs 9 --json
  strivec bench growth --only components --factor 2

Each parameter is varied alone, on the ball: frames by pixels; steps of training by tensors (the same cells and march in \
each, so smaller tensors are finer), components, rays and march. The exponent is the slope of the logarithms: 1 if \
twice as much takes twice as long. Each point is measured in a separate process, so that its memory is its own.";
/// Number of the ball's upsamplings.
const UPSAMPLED: usize = 2;
/// Rays per step; few, so that steps are quick.
const BATCH: usize = 1024;
/// Pixels of a frame.
const PIXELS: f64 = 128.0 * 128.0;

/// The parameter that is varied.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Parameter {
    /// Pixels of a frame
    Pixels,
    /// Tensors, by their edges and distances
    Tensors,
    /// Components of density and appearance
    Components,
    /// Rays of a step
    Rays,
    /// The march's step
    March,
}

impl Parameter {
    /// The name in reports.
    fn name(self) -> &'static str {
        match self {
            Self::Pixels => "pixels",
            Self::Tensors => "tensors",
            Self::Components => "components of all scales",
            Self::Rays => "rays per step",
            Self::March => "length of a march step",
        }
    }

    /// The name of the timed work.
    fn cost(self) -> &'static str {
        match self {
            Self::Pixels => "frame",
            _ => "training step",
        }
    }

    /// The multiples of the parameter; for tensors those of their edges.
    fn factors(self) -> [f64; 4] {
        match self {
            Self::Pixels => [0.25, 0.5, 1.0, 2.0],
            Self::Tensors => [1.0, 0.85, 0.7, 0.55],
            Self::Components => [0.5, 1.0, 2.0, 3.0],
            Self::Rays => [0.5, 1.0, 2.0, 4.0],
            Self::March => [4.0, 2.0, 1.0, 0.5],
        }
    }
}

/// The arguments.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct Args {
    /// Preset of the ball
    #[arg(long, value_enum, default_value = "12")]
    preset: Preset,
    /// Vary this parameter only [default: each in turn]
    #[arg(long, value_enum)]
    only: Option<Parameter>,
    /// Measure this multiple of the parameter only, 0.25 to 8
    #[arg(long, value_name = "F", requires = "only", conflicts_with = "threads_list", value_parser = factor)]
    factor: Option<f64>,
    #[command(flatten)]
    repeats: Repeats,
}

/// A multiple of a parameter. Larger ones need too much memory; smaller ones are too quick to measure.
fn factor(text: &str) -> Result<f64, String> {
    match text.parse() {
        Ok(value) if (0.25..=8.0).contains(&value) => Ok(value),
        _ => Err(format!("{text:?} is not a number from 0.25 to 8")),
    }
}

/// The result, as `--json` prints it.
#[derive(Serialize)]
pub(super) struct Report {
    sweeps: Vec<Sweep>,
}

/// One parameter, varied alone.
#[derive(Serialize)]
struct Sweep {
    threads: usize,
    parameter: &'static str,
    /// The timed work.
    cost: &'static str,
    points: Vec<Point>,
    /// Growth of the median time; `None` for fewer than two points.
    time: Option<Growth>,
    /// Growth of the peak memory; `None` if the system does not report it.
    memory: Option<Growth>,
}

#[derive(Serialize, Deserialize)]
struct Point {
    parameter: f64,
    seconds: f64,
    bytes: Option<u64>,
}

impl Args {
    /// A short measurement.
    pub(super) fn quick() -> Self {
        Self { preset: Preset::P12, only: None, factor: None, repeats: Repeats::quick(3) }
    }
}

/// Varies each parameter.
pub(super) fn measure(args: &Args, session: &Session) -> Result<Report, Error> {
    if let (Some(parameter), Some(factor)) = (args.only, args.factor) {
        let point = point(args, parameter, factor)?;
        return Ok(Report { sweeps: vec![Sweep::new(rayon::current_num_threads(), parameter, vec![point])] });
    }
    let parameters = args.only.map_or_else(|| Parameter::value_variants().to_vec(), |parameter| vec![parameter]);
    let mut sweeps = Vec::new();
    for threads in args.repeats.threads() {
        for &parameter in &parameters {
            session.console.say(&format!(
                "bench: {} by {}, {}",
                parameter.cost(),
                parameter.name(),
                plural(threads, "thread")
            ));
            let points = parameter.factors().map(|factor| point_of_its_own(args, parameter, factor, threads));
            let points = points.into_iter().collect::<Result<_, _>>()?;
            sweeps.push(Sweep::new(threads, parameter, points));
        }
    }
    Ok(Report { sweeps })
}

/// [`point`] in a separate process.
fn point_of_its_own(args: &Args, parameter: Parameter, factor: f64, threads: usize) -> Result<Point, Error> {
    let only = parameter.to_possible_value().map_or_else(String::new, |value| value.get_name().to_owned());
    let Runs { warm_up, measured } = args.repeats.runs();
    let arguments: Vec<String> = [
        ["bench", "growth"].map(String::from),
        ["--preset".into(), args.preset.name().into()],
        ["--only".into(), only],
        ["--factor".into(), factor.to_string()],
        ["--warm-up".into(), warm_up.to_string()],
        ["--runs".into(), measured.to_string()],
        ["--threads".into(), threads.to_string()],
        ["--quiet", "--json"].map(String::from),
    ]
    .concat();
    let this = this_build()?;
    let output = json_of(&this, &arguments)?;
    let point = output.pointer("/sweeps/0/points/0").cloned().unwrap_or_default();
    serde_json::from_value(point).map_err(Error::malformed(&this))
}

/// Time and memory at `factor` times the default of `parameter`.
fn point(args: &Args, parameter: Parameter, factor: f64) -> Result<Point, Error> {
    let memory = MemoryMark::set();
    let config = TrainConfig::preset(args.preset.name()).map_err(|e| Error::Runtime(e.to_string()))?;
    let mut config = at_rest(&TrainConfig { batch_rays: BATCH, ..config });
    match parameter {
        Parameter::Tensors => {
            for scale in &mut config.scales {
                scale.pitch = scale.pitch.map(|v| factor * v);
                scale.edge = scale.edge.map(|v| factor * v);
            }
        }
        Parameter::Components => {
            for scale in &mut config.scales {
                for rank in [&mut scale.density_rank, &mut scale.appearance_rank] {
                    *rank = (factor * f64::from(*rank)).round() as u32;
                }
            }
        }
        Parameter::Rays => config.batch_rays = (factor * BATCH as f64).round() as usize,
        Parameter::Pixels | Parameter::March => (),
    }
    let mut scene = ball(&config, UPSAMPLED)?;
    scene.rules.step *= match parameter {
        Parameter::March => factor,
        // The step is proportional to the cell; this keeps the march the same.
        Parameter::Tensors => 1.0 / factor,
        _ => 1.0,
    };
    // The peak excludes making the ball.
    let memory = memory.again();
    let runs = args.repeats.runs();
    let (parameter, seconds) = match parameter {
        Parameter::Pixels => {
            let edge = (factor * PIXELS).sqrt().round() as u32;
            (f64::from(edge).powi(2), seconds_of_frame(&scene, edge, runs))
        }
        Parameter::Tensors => {
            let tensors: usize = scene.scales.iter().map(|s| s.cloud.len()).sum();
            (tensors as f64, seconds_of_step(config, scene, runs)?)
        }
        Parameter::Components => {
            let components: u32 = config.scales.iter().map(|s| s.density_rank + s.appearance_rank).sum();
            (f64::from(components), seconds_of_step(config, scene, runs)?)
        }
        Parameter::Rays => (config.batch_rays as f64, seconds_of_step(config, scene, runs)?),
        Parameter::March => (scene.rules.step, seconds_of_step(config, scene, runs)?),
    };
    Ok(Point { parameter, seconds, bytes: memory.peak() })
}

fn seconds_of_frame(scene: &Scene, edge: u32, runs: Runs) -> f64 {
    let camera = Viewpoints::first_of_orbit(scene, [edge; 2]);
    let renderer = CpuRenderer::<f32>::new(scene);
    let timed: Result<_, Infallible> = runs.time(|| Ok(renderer.render(&camera)));
    let Ok((seconds, _)) = timed;
    seconds.median
}

fn seconds_of_step(config: TrainConfig, scene: Scene, runs: Runs) -> Result<f64, Error> {
    let views = ball_views(8, 128);
    let mut trainer = Trainer::new(config, scene, &views)?;
    Ok(runs.time(|| trainer.step())?.0.median)
}

impl Sweep {
    fn new(threads: usize, parameter: Parameter, points: Vec<Point>) -> Self {
        let times: Vec<_> = points.iter().map(|p| (p.parameter, p.seconds)).collect();
        let bytes: Option<Vec<_>> = points.iter().map(|p| Some((p.parameter, p.bytes? as f64))).collect();
        let (time, memory) = (Growth::fit(&times), bytes.as_deref().and_then(Growth::fit));
        Self { threads, parameter: parameter.name(), cost: parameter.cost(), points, time, memory }
    }
}

impl Report {
    /// The report as text.
    pub(super) fn text(&self) -> String {
        let mut table =
            Table::new(["growth of", "with", "threads", "from", "to", "time, exponent", "memory, exponent"]);
        let exponent = |growth: Option<Growth>| match growth {
            Some(Growth { exponent, standard_error: Some(error) }) => format!("{exponent:.2} ± {error:.2}"),
            Some(Growth { exponent, standard_error: None }) => format!("{exponent:.2}"),
            None => "-".to_owned(),
        };
        let end = |point: Option<&Point>| {
            point.map_or_else(String::new, |p| {
                let parameter = p.parameter;
                let parameter =
                    if parameter < 1.0 { format!("{parameter:.4}") } else { grouped(parameter.round() as u64) };
                format!("{parameter}: {} ms", report::ms(p.seconds))
            })
        };
        for sweep in &self.sweeps {
            table.row([
                sweep.cost.to_owned(),
                sweep.parameter.to_owned(),
                sweep.threads.to_string(),
                end(sweep.points.first()),
                end(sweep.points.last()),
                exponent(sweep.time),
                exponent(sweep.memory),
            ]);
        }
        table.text()
    }
}
