//! Training by the library's recipe, within this process.

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::Sender;
use std::time::{Duration, Instant};

use pyo3::prelude::*;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use strivec::container::Encoding;
use strivec::dataset::LoadOptions;
use strivec::escape::escaped;
use strivec::prior::BuildOptions;
use strivec::recipe::{Cache, CheckpointFile, Fitting, Observer, Photographs, Prior, Progress, Recipe, Trained};
use strivec::train::{Budget, DeadComponents, TrainConfig};

use crate::errors::Failure;
use crate::following::{Event, followed};

/// The time between two reports of a phase.
const REPORT_EVERY: Duration = Duration::from_millis(200);

/// Request of `strivec.train`, as JSON.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Request {
    settings: TrainConfig,
    /// Replaces the settings' steps; the whole schedule scales with them.
    steps: Option<u64>,
    /// Replaces single settings of that schedule.
    overrides: Value,
    prior: Vec<PathBuf>,
    bootstrap: bool,
    prior_options: PriorOptions,
    auto: bool,
    max_params: Option<u64>,
    max_size: Option<u64>,
    downscale: Option<u32>,
    every: usize,
    skip_missing: bool,
    max_memory: Option<u64>,
    checkpoint: Option<PathBuf>,
    checkpoint_every: Option<u64>,
    resume: bool,
    keep_dead: bool,
    /// True for 32 bits.
    full_precision: bool,
    force: bool,
}

/// How cells are made of the prior's files. Lengths are in dataset units.
#[derive(Deserialize)]
#[serde(deny_unknown_fields, default)]
struct PriorOptions {
    voxel: Option<f64>,
    thickness: f64,
    min_points: u32,
    close: f64,
    dilate: f64,
}

impl Default for PriorOptions {
    fn default() -> Self {
        let BuildOptions { voxel, thickness, min_points, close, dilate, .. } = BuildOptions::default();
        Self { voxel, thickness, min_points, close, dilate }
    }
}

/// The result, as JSON.
#[derive(Serialize)]
struct Report {
    file: PathBuf,
    bytes: u64,
    parameters: u64,
    given_up: u64,
    steps: u64,
    seconds: f64,
    dead_components: Option<DeadComponents>,
}

/// Passes on what a training reports, and stops it when the flag is set.
struct Reporter {
    events: Sender<Event>,
    interrupted: Arc<AtomicBool>,
    cache: Option<Cache>,
    /// The current phase, and the time of its last report.
    last: Option<(String, Instant)>,
}

impl Observer for Reporter {
    fn message(&mut self, text: &dyn std::fmt::Display) {
        // Nobody receives after a second Ctrl-C.
        let _ = self.events.send(Event::Message(escaped(&text.to_string())));
    }

    fn progress(&mut self, progress: Progress<'_>) {
        let Progress { phase, done, total, detail } = progress;
        if self.last.as_ref().is_some_and(|(last, at)| last == phase && at.elapsed() < REPORT_EVERY) {
            return;
        }
        self.last = Some((phase.to_owned(), Instant::now()));
        let event = Event::Progress { task: phase.to_owned(), done, total, detail: escaped(detail) };
        let _ = self.events.send(event);
    }

    fn finished(&mut self, summary: &str) {
        if !summary.is_empty() {
            self.message(&summary);
        }
    }

    fn cache(&self) -> Option<&Cache> {
        self.cache.as_ref()
    }

    fn stop(&self) -> bool {
        self.interrupted.load(Ordering::SeqCst)
    }
}

/// Trains on the photographs in `dataset` and writes `output`, as [`followed`] says; `request` is the JSON of the settings and
/// options. Returns the JSON of the result.
#[pyfunction]
pub(crate) fn train(
    py: Python<'_>,
    dataset: PathBuf,
    output: PathBuf,
    request: &str,
    listener: Option<Bound<'_, PyAny>>,
) -> PyResult<String> {
    let request: Request = serde_json::from_str(request).map_err(|e| Failure::usage(format!("settings: {e}")))?;
    let force = request.force;
    let options = LoadOptions {
        every: request.every,
        skip_missing: request.skip_missing,
        max_memory: request.max_memory.unwrap_or(LoadOptions::MAX_MEMORY),
        ..LoadOptions::default()
    };
    let photographs = Photographs { options, downscale: request.downscale };
    let recipe = request.recipe(&output)?;
    let results = followed(py, listener, move |events, interrupted| {
        let mut reporter = Reporter { events, interrupted, cache: Cache::of_user(), last: None };
        let _reserved = Trained::check_output(&output, force)?;
        if let Some(checkpoint) = recipe.checkpoint.as_ref().filter(|_| !recipe.resume) {
            checkpoint.check_new(force)?;
        }
        let trained = recipe.train_folder(&dataset, &photographs, &mut reporter)?;
        trained.write(&output, force, &mut reporter)?;
        let Trained { scene, bytes, steps, seconds, dead_components, .. } = trained;
        let parameters = scene.nonzero_parameter_count();
        let report = Report {
            file: output,
            bytes: bytes.len() as u64,
            parameters,
            given_up: scene.parameter_count() - parameters,
            steps,
            seconds,
            dead_components,
        };
        Ok(vec![serde_json::to_string(&report).map_err(|e| Failure::runtime(e.to_string()))?])
    })?;
    Ok(results.concat())
}

/// Replaces the values of `settings` that `overrides` has, table by table.
fn merge(settings: &mut Value, overrides: Value) {
    match (settings, overrides) {
        (Value::Object(settings), Value::Object(overrides)) => {
            overrides.into_iter().for_each(|(key, value)| merge(settings.entry(key).or_insert(Value::Null), value));
        }
        (settings, value) => *settings = value,
    }
}

impl Request {
    /// The recipe for the scene file `output`.
    fn recipe(self, output: &std::path::Path) -> Result<Recipe, Failure> {
        let mut config = self.settings;
        if let Some(steps) = self.steps {
            config = config.with_steps(steps);
        }
        let mut config = serde_json::to_value(config).map_err(|e| Failure::runtime(e.to_string()))?;
        merge(&mut config, self.overrides);
        let config: TrainConfig =
            serde_json::from_value(config).map_err(|e| Failure::usage(format!("settings: {e}")))?;
        config.check().map_err(|e| Failure::usage(e.to_string()))?;
        let PriorOptions { voxel, thickness, min_points, close, dilate } = self.prior_options;
        let options = BuildOptions { voxel, thickness, min_points, close, dilate, ..BuildOptions::default() };
        let prior = match (self.bootstrap, self.prior.is_empty()) {
            (true, true) => Prior::Bootstrap,
            (true, false) => return Err(Failure::usage("give either prior or bootstrap")),
            (false, true) => Prior::Photographs,
            (false, false) => Prior::Files { files: self.prior, options: Box::new(options) },
        };
        let checkpoint = self.checkpoint.map_or_else(|| CheckpointFile::beside(output), CheckpointFile::new);
        Ok(Recipe {
            prior,
            fitting: Fitting {
                to_photographs: self.auto,
                budget: Budget { parameters: self.max_params, file_bytes: self.max_size },
            },
            keep_dead: self.keep_dead,
            encoding: if self.full_precision { Encoding::F32 } else { Encoding::F16 },
            checkpoint: Some(CheckpointFile { every: self.checkpoint_every, ..checkpoint }),
            resume: self.resume,
            ..Recipe::new(config)
        })
    }
}
