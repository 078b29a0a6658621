//! `strivec shrink`: a scene with fewer parameters.

mod picture;

use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering;
use std::time::Instant;

use serde::Serialize;

use super::console::Console;
use super::progress::Progress;
use super::settings::{configuration, every};
use super::table::{Table, grouped};
use super::train::{Precision, Preset, interrupts};
use super::{Error, Session, check_output, quantity, scene_file, write_atomically};
use crate::container::{self, EncodeOptions, Extras};
use crate::dataset::{self, LoadOptions, View};
use crate::field::Field;
use crate::measure::{Cell, CellMap, FLAT, color_png, psnr_of_mse};
use crate::model::{Factors, Scale, Scene};
use crate::random::Random;
use crate::train::{Photographs, RayBatch, Shrink, ShrinkGoal, ShrinkRound, ShrinkStep, TrainConfig, shrink};

const EXAMPLES: &str = "\
Examples:
  strivec shrink lego.strivec lego -o half.strivec --max-params 14M
  strivec shrink lego.strivec lego -o lean.strivec --max-loss 0.1
  strivec shrink small.strivec lego -o smaller.strivec --downscale 4 --config quarter.toml --max-loss 0.2

Parameters are those that the file holds: components of tensors that are zeros throughout are not. Losses are measured on
rays of the photographs that the scene was trained from. What the file says of its pictures (probes, corrections of its
beginnings, quality, choices) is left out, as those change: see strivec-pack pack and strivec trade.";
/// Steps of training after each round, as a share of the whole run's.
const SHARE_OF_STEPS: u64 = 30;
/// Cells along the scene's longest edge, and rays that look at them, at most.
const CELLS_ALONG: usize = 64;
const CELL_RAYS: usize = 1 << 18;

/// The arguments.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct Args {
    /// The scene
    file: PathBuf,
    /// Folder of the dataset that it was trained from
    dataset: PathBuf,
    /// The file to write
    #[arg(long, short, value_name = "FILE")]
    output: PathBuf,
    #[command(flatten)]
    goal: Goal,
    /// Training after each round, in optimiser steps; the last has twice as many [default: a thirtieth of the preset's]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    steps: Option<u64>,
    /// What the scene was trained as [default: what the file says, else 48]
    #[arg(long, value_enum)]
    preset: Option<Preset>,
    /// The settings that the scene was trained with, as train --print-config writes them
    #[arg(long, value_name = "TOML")]
    config: Option<PathBuf>,
    /// Rays a step
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    batch: Option<u32>,
    /// Photographs made N times smaller
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..))]
    downscale: u32,
    /// Only every N-th photograph
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = every)]
    every: usize,
    /// Of every random choice
    #[arg(long, value_name = "S")]
    seed: Option<u64>,
    /// A PNG picture: parameters per cell against error per cell, before and after
    #[arg(long, value_name = "PNG")]
    picture: Option<PathBuf>,
    /// How the file stores factors
    #[arg(long, value_enum, default_value_t)]
    encoding: Precision,
}

/// How far the scene is shrunk.
#[derive(Debug, clap::Args)]
#[group(required = true, multiple = false)]
struct Goal {
    /// Leave at most N parameters, as in 500k or 3.5M
    #[arg(long, value_name = "N", value_parser = quantity::count)]
    max_params: Option<u64>,
    /// Leave as few parameters as lose at most this many dB on training rays
    #[arg(long, value_name = "DB", value_parser = loss)]
    max_loss: Option<f64>,
}

fn loss(text: &str) -> Result<f64, String> {
    text.parse().ok().filter(|db: &f64| db.is_finite() && *db > 0.0).ok_or_else(|| "expected a positive number".into())
}

/// The result, as `--json` prints it.
#[derive(Serialize)]
struct Report<'a> {
    file: &'a Path,
    bytes: u64,
    /// Before and after.
    parameters: [u64; 2],
    /// dB on training rays, before and after.
    psnr: [f64; 2],
    rounds: Vec<ShrinkRound>,
    scales: Vec<[ScaleUse; 2]>,
    /// Cells of space by what the photographs show there.
    cells: Vec<CellKind>,
    seconds: f64,
}

/// What a scale holds.
#[derive(Clone, Copy, Serialize)]
struct ScaleUse {
    tensors: u64,
    /// Of which nothing is left.
    tensors_of_rank_0: u64,
    resolution: [u32; 3],
    /// The most that a tensor has.
    density_rank: u32,
    appearance_rank: u32,
    /// The mean over tensors.
    mean_density_rank: f64,
    mean_appearance_rank: f64,
    parameters: u64,
}

impl ScaleUse {
    fn of(scale: &Scale) -> Self {
        let rows = Factors::rows(scale.cloud.resolution);
        let ranks = |values: &[f32], rank: u32| -> Vec<usize> {
            let held = Factors::held(values, rows, rank as usize);
            held.chunks_exact(rank as usize).map(|of_tensor| of_tensor.iter().filter(|h| **h).count()).collect()
        };
        let density = ranks(&scale.factors.density, scale.factors.density_rank);
        let appearance = ranks(&scale.factors.appearance, scale.factors.appearance_rank);
        let mean = |ranks: &[usize]| ranks.iter().sum::<usize>() as f64 / ranks.len().max(1) as f64;
        let most = |ranks: &[usize]| ranks.iter().copied().max().unwrap_or(0) as u32;
        Self {
            tensors: scale.cloud.len() as u64,
            tensors_of_rank_0: density.iter().zip(&appearance).filter(|(d, a)| **d + **a == 0).count() as u64,
            resolution: scale.cloud.resolution,
            density_rank: most(&density),
            appearance_rank: most(&appearance),
            mean_density_rank: mean(&density),
            mean_appearance_rank: mean(&appearance),
            parameters: scale.held_parameter_count(),
        }
    }

    fn row(&self, name: String) -> [String; 7] {
        let [x, y, z] = self.resolution;
        [
            name,
            grouped(self.tensors),
            grouped(self.tensors_of_rank_0),
            if x == y && y == z { x.to_string() } else { format!("{x}x{y}x{z}") },
            format!("{:.1} of {}", self.mean_density_rank, self.density_rank),
            format!("{:.1} of {}", self.mean_appearance_rank, self.appearance_rank),
            grouped(self.parameters),
        ]
    }
}

/// Progress of a round.
struct Meter<'a> {
    progress: Progress<'a>,
    round: usize,
    /// Exponentially smoothed squared error.
    error: f64,
}

impl<'a> Meter<'a> {
    fn start(step: &ShrinkStep, console: &'a Console) -> Self {
        let progress = Progress::start(console, &format!("round {}", step.round + 1), step.steps[1]);
        Self { progress, round: step.round, error: step.report.mean_squared_error }
    }

    fn add(&mut self, step: &ShrinkStep) {
        const KEPT: f64 = 0.98;
        self.error = KEPT * self.error + (1.0 - KEPT) * step.report.mean_squared_error;
        self.progress.set(step.steps[0], || format!("train {:.2} dB", psnr_of_mse(self.error)));
    }

    fn finish(self) {
        self.progress.finish(&format!("round {}: train {:.2} dB", self.round + 1, psnr_of_mse(self.error)));
    }
}

/// Where parameters and errors are, before and after.
struct Cells([CellMap; 2]);

/// Cells that are alike.
#[derive(Clone, Copy, Serialize)]
struct CellKind {
    name: &'static str,
    cells: usize,
    /// Of all that is seen.
    share_of_weight: f64,
    /// Factor entries, before and after.
    parameters: [f64; 2],
    /// Of the mean squared error, before and after.
    share_of_error: [f64; 2],
}

impl Cells {
    fn new(scenes: [&Scene; 2], views: &[View], config: &TrainConfig) -> Self {
        let [before, _] = scenes;
        let field = Field::<f32>::new(before);
        let mut photographs = Photographs::new(views, &before.frame, config);
        photographs.keep_rays_that_meet(&field);
        let count = photographs.kept_count().min(CELL_RAYS);
        let batch = RayBatch::draw(&photographs, &field, &Random::new(config.seed, "cells"), 0, count);
        Self(scenes.map(|scene| CellMap::new(scene, &before.bounds, &batch, CELLS_ALONG)))
    }

    fn named(&self) -> [(&'static str, &CellMap); 2] {
        [("before", &self.0[0]), ("after", &self.0[1])]
    }

    /// What is seen is judged by the scene as it was.
    fn kinds(&self) -> Vec<CellKind> {
        let [before, after] = &self.0;
        let sum = |map: &CellMap, numbers: &[usize], value: fn(&Cell) -> f64| {
            numbers.iter().map(|&n| value(&map.cells[n])).fold(0.0, |sum, v| sum + v)
        };
        let all: Vec<usize> = (0..before.cells.len()).collect();
        // Where nothing is seen at all, shares are 0.
        let weight = sum(before, &all, |c| c.weight).max(f64::MIN_POSITIVE);
        let errors = self.0.each_ref().map(|map| sum(map, &all, |c| c.error).max(f64::MIN_POSITIVE));
        let kind = |name, is_one: &dyn Fn(Option<f64>) -> bool| {
            let numbers: Vec<usize> =
                (0..before.cells.len()).filter(|&n| is_one(before.cells[n].deviation())).collect();
            CellKind {
                name,
                cells: numbers.len(),
                share_of_weight: sum(before, &numbers, |c| c.weight) / weight,
                parameters: [before, after].map(|map| sum(map, &numbers, |c| c.parameters)),
                share_of_error: [0, 1].map(|n| sum(&self.0[n], &numbers, |c| c.error) / errors[n]),
            }
        };
        let mut kinds = vec![
            kind("nothing is seen", &|deviation| deviation.is_none()),
            kind("one colour", &|deviation| deviation.is_some_and(|d| d <= FLAT)),
            kind("several colours", &|deviation| deviation.is_some_and(|d| d > FLAT)),
        ];
        for (n, map) in self.0.iter().enumerate() {
            kinds[0].parameters[n] += map.unseen_parameters;
        }
        kinds
    }
}

/// Shrinks.
pub(super) fn run(args: &Args, session: &Session) -> Result<(), Error> {
    check_output(&args.output, session.force)?;
    if let Some(path) = &args.picture {
        check_output(path, session.force)?;
    }
    let (document, _) = scene_file::read_document(&args.file)?;
    let how = args.how(&document.scene)?;
    let interrupted = interrupts()?;
    let options = LoadOptions { downscale: args.downscale, every: args.every, ..LoadOptions::default() };
    let dataset = dataset::load(&args.dataset, "train", &options)?;
    let start = Instant::now();
    let before: Vec<ScaleUse> = document.scene.scales.iter().map(ScaleUse::of).collect();
    let extras = Extras {
        licence: document.extras.licence,
        views: document.extras.views,
        cameras: document.extras.cameras,
        ..Extras::default()
    };
    let mut meter: Option<Meter> = None;
    let mut stepped = |step: &ShrinkStep| {
        if interrupted.load(Ordering::SeqCst) {
            return Err(Error::Runtime("interrupted; nothing was written".into()));
        }
        let begun = meter.get_or_insert_with(|| Meter::start(step, &session.console));
        begun.add(step);
        if step.steps[0] == step.steps[1]
            && let Some(ended) = meter.take()
        {
            ended.finish();
        }
        Ok(())
    };
    let shrunk = shrink(document.scene.clone(), &dataset.views, &how, &mut stepped)?;
    let cells = Cells::new([&document.scene, &shrunk.scene], &dataset.views, &how.config);
    let options = EncodeOptions::uniform(args.encoding.factors());
    let bytes =
        container::encode_document(&shrunk.scene, &extras, &options).map_err(|e| Error::container(&args.output, e))?;
    write_atomically(&args.output, &bytes, session.force)?;
    if let Some(path) = &args.picture {
        let (size, colors) = picture::draw(&cells.named()).map_err(Error::Runtime)?;
        write_atomically(path, &color_png(size, &colors)?, session.force)?;
    }
    let after = shrunk.scene.scales.iter().map(ScaleUse::of);
    let report = Report {
        file: &args.output,
        bytes: bytes.len() as u64,
        parameters: shrunk.parameters,
        psnr: shrunk.psnr,
        rounds: shrunk.rounds,
        scales: before.into_iter().zip(after).map(|(before, after)| [before, after]).collect(),
        cells: cells.kinds(),
        seconds: start.elapsed().as_secs_f64(),
    };
    session.console.result(&report, Report::text)
}

impl Args {
    /// How far, and how `scene` is trained meanwhile.
    fn how(&self, scene: &Scene) -> Result<Shrink, Error> {
        let of_file = Some(scene.provenance.preset.as_str()).filter(|name| TrainConfig::PRESETS.contains(name));
        let preset = self.preset.map(Preset::name);
        let mut config = configuration(preset.or(of_file.filter(|_| self.config.is_none())), self.config.as_deref())?;
        config.batch_rays = self.batch.map_or(config.batch_rays, |b| b as usize);
        config.seed = self.seed.unwrap_or(config.seed);
        let goal = match (self.goal.max_params, self.goal.max_loss) {
            (Some(most), _) => ShrinkGoal::Parameters(most),
            (None, Some(most)) => ShrinkGoal::Loss(most),
            (None, None) => unreachable!("clap asks for one"),
        };
        let steps = self.steps.unwrap_or(config.steps.div_ceil(SHARE_OF_STEPS));
        Ok(Shrink { goal, steps, config })
    }
}

impl Report<'_> {
    fn text(&self) -> String {
        let mut rounds = Table::new(["round", "parameters", "resolutions", "dB at once", "dB trained", ""]);
        for (n, round) in self.rounds.iter().enumerate() {
            let resolutions: Vec<String> = round.resolutions.iter().map(|r| r[0].to_string()).collect();
            rounds.row([
                (n + 1).to_string(),
                grouped(round.parameters),
                resolutions.join(", "),
                format!("{:.3}", round.psnr_cleared),
                format!("{:.3}", round.psnr),
                if round.is_taken { "" } else { "too much" }.to_owned(),
            ]);
        }
        let mut scales = Table::new(["scale", "tensors", "of rank 0", "cells", "density", "appearance", "parameters"]);
        for (n, [before, after]) in self.scales.iter().enumerate() {
            scales.row(before.row(format!("{n} before")));
            scales.row(after.row(format!("{n} after")));
        }
        let mut cells = Table::new(["cells where", "cells", "seen", "parameters", "then", "error", "then"]);
        let percent = |share: f64| format!("{:.1} %", 100.0 * share);
        for kind in &self.cells {
            cells.row([
                kind.name.to_owned(),
                grouped(kind.cells as u64),
                percent(kind.share_of_weight),
                grouped(kind.parameters[0].round() as u64),
                grouped(kind.parameters[1].round() as u64),
                percent(kind.share_of_error[0]),
                percent(kind.share_of_error[1]),
            ]);
        }
        let ([before, after], [psnr_before, psnr_after]) = (self.parameters, self.psnr);
        format!(
            "{}{}{}{}: {:.2} MB, {} of {} parameters, {psnr_after:.3} dB on training rays, {psnr_before:.3} dB before, {:.1} min\n",
            rounds.text(),
            scales.text(),
            cells.text(),
            self.file.display(),
            self.bytes as f64 / 1e6,
            grouped(after),
            grouped(before),
            self.seconds / 60.0
        )
    }
}
