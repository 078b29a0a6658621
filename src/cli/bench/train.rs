//! `strivec bench train`: training steps by stage.

use std::path::{Path, PathBuf};

use serde::Serialize;

use super::repeats::Repeats;
use super::report;
use crate::bench::lab::{Measured, MemoryMark, at_rest, ball, ball_views, training_steps};
use crate::dataset::DatasetOptions;
use crate::observer::ConsoleObserver;
use crate::settings::{presets, with_assignments};
use crate::state_file::read_state;
use crate::table::plural;
use crate::{Context, Error, scene_file};
use strivec_capture::dataset;
use strivec_capture::dataset::{Dataset, Photograph};
use strivec_format::model::Scene;
use strivec_recipe::Recipe;
use strivec_train::{Preset, TrainConfig, Trainer};

const EXAMPLES: &str = "\
Examples:
  strivec bench train
  strivec bench train --preset 48 --upsampled 0,3,5 --threads-list 1,2
  strivec bench train lego --scene lego.strivec
  strivec bench train lego --resume lego.strivec.state --set sampling.batch_rays=8192
  strivec bench train lego --preset 24 --downscale 4 --at 0,500,2500

With --scene, --resume or the ball, the measured steps change only the optimizer's moments, so that all are alike. With --at \
the scene is trained, and the measured steps are part of the training.";
/// Number and edge of the ball's photographs: enough rays that a batch repeats none.
const BALL_VIEWS: u32 = 12;
const BALL_SIZE: u32 = 200;

/// The arguments.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct Args {
    /// Dataset folder [default: a ball made in memory]
    #[arg(requires = "start")]
    dataset: Option<PathBuf>,
    #[command(flatten)]
    start: RunStart,
    /// Resolution of the ball's tensors: after N upsamplings [default: 0 and all]
    #[arg(long, value_name = "N,N,…", value_delimiter = ',', conflicts_with = "dataset")]
    upsampled: Vec<usize>,
    /// Downscale photographs N times
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..),
        requires = "dataset")]
    downscale: u32,
    #[command(flatten)]
    photographs: DatasetOptions,
    /// Preset of the ball, of --at and of --scene [default: the scene's, else 24]
    #[arg(long, value_name = "NAME", value_parser = presets(), conflicts_with = "resume")]
    preset: Option<Preset>,
    /// Set one key of the TOML settings of the preset or of the state, as in sampling.batch_rays=8192; repeatable
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
    #[command(flatten)]
    repeats: Repeats,
}

/// The start of a measurement on a dataset.
#[derive(Clone, Debug, Default, clap::Args)]
#[group(id = "start", multiple = false)]
struct RunStart {
    /// Train this scene
    #[arg(long, value_name = "FILE", requires = "dataset")]
    scene: Option<PathBuf>,
    /// Resume from a checkpoint of `strivec train`
    #[arg(long, value_name = "STATE", requires = "dataset")]
    resume: Option<PathBuf>,
    /// Reconstruct the prior, train, and measure after these steps
    #[arg(long, value_name = "STEP,STEP,…", value_delimiter = ',', requires = "dataset")]
    at: Option<Vec<u64>>,
}

/// The result, as `--json` prints it.
#[derive(Serialize)]
pub(super) struct Report {
    subject: String,
    batch_rays: usize,
    points: Vec<RunPoint>,
    /// Pools of threads on which the points were measured, one after the other.
    #[serde(skip)]
    pools: usize,
}

/// A point of a run.
#[derive(Serialize)]
struct RunPoint {
    /// The name of the point.
    name: String,
    /// \[scale\] cells of a tensor along each axis.
    resolutions: Vec<[u32; 3]>,
    tensors: usize,
    /// Parameters of components that are not zero, which a step works on.
    parameters: u64,
    #[serde(flatten)]
    measured: Measured,
}

impl Args {
    /// A short measurement on the ball.
    pub(super) fn quick() -> Self {
        Self {
            dataset: None,
            start: RunStart::default(),
            upsampled: Vec::new(),
            downscale: 1,
            photographs: DatasetOptions::default(),
            preset: None,
            set: Vec::new(),
            repeats: Repeats::quick(3),
        }
    }
}

/// Measures all points on all numbers of threads.
pub(super) fn measure(args: &Args, session: &Context) -> Result<Report, Error> {
    let scene = args.start.scene.as_deref().map(|path| scene_file::read(path, &session.console)).transpose()?;
    let scene = scene.map(|(scene_file, _)| scene_file.scene);
    let of_scene = scene.as_ref().and_then(|scene| scene.provenance.preset.parse().ok());
    let preset = args.preset.or(of_scene).unwrap_or(Preset::Paper24);
    let mut config = preset.config();
    let state = args.start.resume.as_deref().map(read_state).transpose()?;
    if let Some((progress, _)) = &state {
        config = progress.config.clone();
    }
    let config = with_assignments(config, &args.set)?;
    let last = config.schedule.upsample_at.len();
    let upsampled = if args.upsampled.is_empty() { vec![0, last] } else { args.upsampled.clone() };
    if let Some(found) = upsampled.iter().find(|&&n| n > last) {
        return Err(Error::Usage(format!("--upsampled {found}: preset {} allows 0 to {last}", preset.name())));
    }
    let load = |folder: &Path| dataset::load(folder, "train", &args.photographs.load_options(args.downscale));
    let mut dataset = args.dataset.as_deref().map(load).transpose()?;
    let subject = Subject { args, config, session };
    let measured = args.repeats.in_each_pool(|| {
        Ok(match (&mut dataset, &state, &scene) {
            (Some(dataset), Some((progress, scene)), _) => {
                let memory = MemoryMark::set();
                let mut progress = progress.clone();
                progress.config = at_rest(&subject.config);
                let name = format!("step {}", progress.step);
                let trainer = Trainer::resume(progress, scene.clone(), &dataset.views)?;
                vec![subject.point(name, trainer, memory)?]
            }
            (Some(dataset), None, Some(scene)) => {
                let name = format!("the scene of step {}", scene.provenance.steps);
                vec![subject.at_rest(name, scene.clone(), &dataset.views)?]
            }
            (Some(dataset), None, None) => subject.on_the_way(dataset)?,
            (None, ..) => {
                let views = ball_views(BALL_VIEWS, BALL_SIZE);
                let point = |&n: &usize| {
                    let scene = ball(&subject.config, n)?;
                    subject.at_rest(format!("after {}", plural(n, "upsampling")), scene, &views)
                };
                upsampled.iter().map(point).collect::<Result<Vec<_>, Error>>()?
            }
        })
    })?;
    let name = dataset.map_or_else(|| format!("a ball, preset {}", preset.name()), |dataset| dataset.name);
    let pools = measured.len();
    let points = measured.into_iter().flatten().collect();
    Ok(Report { subject: name, batch_rays: subject.config.sampling.batch_rays, points, pools })
}

/// The subject of the measurement.
struct Subject<'a> {
    args: &'a Args,
    config: TrainConfig,
    session: &'a Context,
}

impl Subject<'_> {
    /// Measures steps that leave `scene` unchanged.
    fn at_rest(&self, name: String, scene: Scene, views: &[Photograph]) -> Result<RunPoint, Error> {
        let memory = MemoryMark::set();
        let trainer = Trainer::new(at_rest(&self.config), scene, views)?;
        self.point(name, trainer, memory)
    }

    fn point(&self, name: String, mut trainer: Trainer<'_>, memory: MemoryMark) -> Result<RunPoint, Error> {
        self.session.console.say(&format!("bench: training, {name}"));
        let measured = training_steps(&mut trainer, self.args.repeats.runs(), memory)?;
        Ok(RunPoint::new(name, &trainer.scene(), measured))
    }

    /// Trains on `dataset` and measures after the steps of `--at`.
    fn on_the_way(&self, dataset: &mut Dataset) -> Result<Vec<RunPoint>, Error> {
        let memory = MemoryMark::set();
        let mut observer = ConsoleObserver::unstoppable(&self.session.console);
        let start = Recipe::new(self.config.clone()).prepare(dataset, &mut observer)?;
        let mut trainer = start.trainer(dataset, &mut observer)?;
        let mut stops = self.args.start.at.clone().unwrap_or_default();
        stops.sort_unstable();
        let mut points = Vec::new();
        for stop in stops {
            while trainer.steps_done() < stop {
                trainer.step()?;
            }
            let name = format!("step {}", trainer.steps_done());
            self.session.console.say(&format!("bench: training, {name}"));
            let measured = training_steps(&mut trainer, self.args.repeats.runs(), memory)?;
            points.push(RunPoint::new(name, &trainer.scene(), measured));
        }
        Ok(points)
    }
}

impl RunPoint {
    fn new(name: String, scene: &Scene, measured: Measured) -> Self {
        Self {
            name,
            resolutions: scene.scales.iter().map(|s| s.cloud.resolution).collect(),
            tensors: scene.scales.iter().map(|s| s.cloud.len()).sum(),
            parameters: scene.nonzero_parameter_count(),
            measured,
        }
    }
}

impl Report {
    /// The report as text.
    pub(super) fn text(&self) -> String {
        let mut text = String::new();
        for point in &self.points {
            text += &format!(
                "training {}, {}: {} tensors, {:.1} M parameters, {} rays per step, {}\n{}, {}\n{}\n",
                self.subject,
                point.name,
                point.tensors,
                1e-6 * point.parameters as f64,
                self.batch_rays,
                plural(point.measured.threads, "thread"),
                report::seconds(&point.measured.seconds),
                report::memory(point.measured.peak_bytes),
                report::stages(&point.measured),
            );
        }
        // The same points come once for each number of threads.
        let each = self.points.len() / self.pools.max(1);
        for first in 0..each {
            let same: Vec<_> = self.points[first..].iter().step_by(each).map(|point| &point.measured).collect();
            text += &report::scaling(&same);
        }
        text
    }
}
