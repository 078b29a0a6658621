//! `strivec bench growth`: what twice as much costs.

use serde::Serialize;

use super::{Repeats, report};
use crate::cli::table::{Table, grouped};
use crate::cli::viewpoints::Viewpoints;
use crate::cli::{Error, Session};
use crate::dataset::View;
use crate::measure::bench::{Growth, Measured, MemoryMark, Peak, at_rest, ball, ball_views, frames, training_steps};
use crate::model::Scene;
use crate::train::{TrainConfig, Trainer};

const EXAMPLES: &str = "\
Examples:
  strivec bench growth
  strivec bench growth --runs 9 --json

Each parameter is varied alone, on the ball: frames by pixels; steps of training by tensors (the same cells and march in \
each, so smaller tensors are finer), components, rays and march. The exponent is the slope of the logarithms: 1 where \
twice as much takes twice as long.";
/// The ball's model, small so that everything is quick, after so many upsamplings.
const PRESET: &str = "12";
const UPSAMPLED: usize = 2;
const BATCH: usize = 1024;
/// Edges of the frames in pixels.
const EDGES: [u32; 4] = [64, 96, 128, 192];
/// What lengths of tensors are multiplied by.
const LENGTHS: [f64; 4] = [1.0, 0.85, 0.7, 0.55];
/// What ranks are multiplied by.
const RANKS: [f64; 4] = [0.5, 1.0, 2.0, 3.0];
/// What the batch is multiplied by.
const BATCHES: [f64; 4] = [0.5, 1.0, 2.0, 4.0];
/// What the march's step is multiplied by.
const STEPS: [f64; 4] = [4.0, 2.0, 1.0, 0.5];

/// The arguments.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct Args {
    #[command(flatten)]
    repeats: Repeats,
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
    /// What is timed.
    cost: &'static str,
    points: Vec<Point>,
    /// Of the median time.
    time: Option<Growth>,
    /// Of the memory at the peak; absent where the system does not tell.
    memory: Option<Growth>,
}

#[derive(Serialize)]
struct Point {
    parameter: f64,
    seconds: f64,
    bytes: Option<u64>,
}

impl Args {
    /// Few runs.
    pub(super) fn quick() -> Self {
        Self { repeats: Repeats::quick(3) }
    }
}

/// Varies each parameter.
pub(super) fn measure(args: &Args, session: &Session) -> Result<Report, Error> {
    let sweeps = args.repeats.on_each_pool(session, |peak| Sweeps { args, session, peak }.all())?;
    Ok(Report { sweeps: sweeps.into_iter().flatten().collect() })
}

struct Sweeps<'a> {
    args: &'a Args,
    session: &'a Session,
    peak: &'a Peak,
}

impl Sweeps<'_> {
    fn all(&self) -> Result<Vec<Sweep>, Error> {
        let config = TrainConfig::preset(PRESET).map_err(|e| Error::Runtime(e.to_string()))?;
        let config = TrainConfig { batch_rays: BATCH, ..config };
        let scene = ball(&config, UPSAMPLED)?;
        let march = scene.rules.step;
        let views = ball_views(8, 128);
        let step = |config: &TrainConfig, march, memory| self.training_step(config, march, &views, memory);

        let pixels = self.sweep("pixels", "frame", EDGES, |edge, memory| {
            Ok((f64::from(edge).powi(2), self.frame(&scene, edge, memory)))
        })?;
        let tensors = self.sweep("tensors", "training step", LENGTHS, |factor, memory| {
            let mut config = config.clone();
            for scale in &mut config.scales {
                scale.pitch = scale.pitch.map(|v| factor * v);
                scale.edge = scale.edge.map(|v| factor * v);
            }
            let (scene, measured) = step(&config, march, memory)?;
            Ok((scene.scales.iter().map(|s| s.cloud.len()).sum::<usize>() as f64, measured))
        })?;
        let ranks = self.sweep("components of all scales", "training step", RANKS, |factor, memory| {
            let mut config = config.clone();
            for scale in &mut config.scales {
                for rank in [&mut scale.density_rank, &mut scale.appearance_rank] {
                    *rank = (factor * f64::from(*rank)).round() as u32;
                }
            }
            let components: u32 = config.scales.iter().map(|s| s.density_rank + s.appearance_rank).sum();
            Ok((f64::from(components), step(&config, march, memory)?.1))
        })?;
        let batches = self.sweep("rays a step", "training step", BATCHES, |factor, memory| {
            let batch_rays = (factor * BATCH as f64) as usize;
            Ok((batch_rays as f64, step(&TrainConfig { batch_rays, ..config.clone() }, march, memory)?.1))
        })?;
        let steps = self.sweep("length of a march step", "training step", STEPS, |factor, memory| {
            Ok((factor * march, step(&config, factor * march, memory)?.1))
        })?;
        Ok(vec![pixels, tensors, ranks, batches, steps])
    }

    /// Steps that leave the ball of `config`, marched in steps of `march`, as it is.
    fn training_step(
        &self,
        config: &TrainConfig,
        march: f64,
        views: &[View],
        memory: MemoryMark,
    ) -> Result<(Scene, Measured), Error> {
        let mut scene = ball(config, UPSAMPLED)?;
        scene.rules.step = march;
        let memory = memory.again();
        let mut trainer = Trainer::new(at_rest(config), scene.clone(), views)?;
        let measured = training_steps(&mut trainer, self.args.repeats.runs(), self.peak, memory)?;
        Ok((scene, measured))
    }

    fn frame(&self, scene: &Scene, edge: u32, memory: MemoryMark) -> Measured {
        let memory = memory.again();
        let camera = Viewpoints::first_of_orbit(&scene.frame, &scene.bounds, [edge; 2]);
        frames(scene, &camera, self.args.repeats.runs(), self.peak, memory)
    }

    /// What `measure` makes of each of `values`: the parameter and what it cost.
    fn sweep<V: Copy>(
        &self,
        parameter: &'static str,
        cost: &'static str,
        values: [V; 4],
        measure: impl Fn(V, MemoryMark) -> Result<(f64, Measured), Error>,
    ) -> Result<Sweep, Error> {
        self.session.console.say(&format!("bench: {cost} by {parameter}"));
        let memory = MemoryMark::set();
        let point = |&value: &V| {
            let (parameter, measured) = measure(value, memory)?;
            Ok(Point { parameter, seconds: measured.seconds.median, bytes: measured.peak_bytes })
        };
        let points: Vec<Point> = values.iter().map(point).collect::<Result<_, Error>>()?;
        let times: Vec<_> = points.iter().map(|p| (p.parameter, p.seconds)).collect();
        let bytes: Option<Vec<_>> = points.iter().map(|p| Some((p.parameter, p.bytes? as f64))).collect();
        let memory = bytes.as_deref().and_then(Growth::fit);
        Ok(Sweep { threads: self.peak.threads, parameter, cost, points, time: Growth::fit(&times), memory })
    }
}

impl Report {
    /// For people.
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
