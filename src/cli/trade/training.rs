//! `strivec trade --train`: short trainings with the settings of the paper's ablation tables, next to its numbers.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;
use std::time::Instant;

use glam::{DQuat, DVec3};
use serde::{Deserialize, Serialize};

use crate::cli::render::colors;
use crate::cli::table::{Table, plural};
use crate::cli::training::{interrupts, train_through};
use crate::cli::{Error, Session, write_atomically};
use crate::dataset::{self, Dataset, LoadOptions};
use crate::geometry::Similarity;
use crate::measure::{self, ViewReport};
use crate::render::{CpuRenderer, Renderer};
use crate::train::{ScaleConfig, TrainConfig};

/// Dataset and base settings of the trainings.
pub(super) struct Training<'a> {
    pub(super) folder: &'a Path,
    pub(super) split: &'a str,
    /// All photographs.
    pub(super) options: &'a LoadOptions,
    /// Number of test views, evenly spaced.
    pub(super) views: usize,
    /// Base settings; every variant changes one of them.
    pub(super) config: TrainConfig,
    pub(super) out: &'a Path,
}

/// One training.
struct Variant {
    group: &'static str,
    name: String,
    config: TrainConfig,
    /// Rotation of the dataset about z, in degrees.
    degrees: f64,
    paper: Paper,
}

impl Variant {
    /// Its training, if it is among `rows`.
    fn row_of<'a>(&self, rows: &'a [Row]) -> Option<&'a Row> {
        rows.iter().find(|row| row.group == self.group && row.name == self.name)
    }

    /// Both are the same training, in different tables.
    fn is_trained_as(&self, other: &Self) -> bool {
        self.config == other.config && self.degrees == other.degrees
    }
}

/// Figures of the paper, for 30 000 steps on an RTX 3090: means over eight scenes for scales and components (tables
/// "Ablation under different scale settings" and "Ablation study on the number of tensor components"), lego for
/// rotations.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
struct Paper {
    psnr: Option<f64>,
    ssim: Option<f64>,
    parameters_millions: Option<f64>,
    minutes: Option<f64>,
}

impl Paper {
    const fn new(psnr: f64, ssim: f64, parameters_millions: f64) -> Self {
        Self { psnr: Some(psnr), ssim: Some(ssim), parameters_millions: Some(parameters_millions), minutes: None }
    }

    const fn with_minutes(self, minutes: f64) -> Self {
        Self { minutes: Some(minutes), ..self }
    }

    const fn of_rotation(psnr: f64) -> Self {
        Self { psnr: Some(psnr), ssim: None, parameters_millions: None, minutes: None }
    }
}

/// The result of one training.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct Row {
    group: String,
    name: String,
    psnr: f64,
    ssim: Option<f64>,
    parameters: u64,
    seconds: f64,
    paper: Paper,
}

/// All results, as `--json` prints them.
#[derive(Serialize)]
struct Report {
    dataset: String,
    downscale: u32,
    steps: u64,
    test_views: usize,
    seed: u64,
    rows: Vec<Row>,
}

/// Trains the variants that the log lacks, and reports.
pub(super) fn run(training: &Training<'_>, session: &Session) -> Result<(), Error> {
    let log = training.out.join("trainings.json");
    let key = serde_json::to_string(&(
        training.folder,
        training.split,
        training.options.downscale,
        training.views,
        training.config.to_toml(),
    ))
    .expect("plain data");
    let mut rows = read_log(&log, &key, session.force)?;
    let photographs = dataset::load(training.folder, "train", training.options)?;
    let all = dataset::load_cameras(training.folder, training.split, None, training.options)?.len();
    let options = LoadOptions { every: all.div_ceil(training.views).max(1), ..training.options.clone() };
    let held_out = dataset::load(training.folder, training.split, &options)?;
    let variants = variants(&training.config);
    let interrupted = interrupts()?;
    for (n, variant) in variants.iter().enumerate() {
        if variant.row_of(&rows).is_some() {
            continue;
        }
        let same = variants.iter().find_map(|v| variant.is_trained_as(v).then(|| v.row_of(&rows)).flatten());
        let trained = match same.cloned() {
            Some(row) => row,
            None => {
                session.console.say(&format!("{} of {}: {}, {}", n + 1, variants.len(), variant.group, variant.name));
                train(variant, [&photographs, &held_out], &interrupted, session)?
            }
        };
        let (group, name, paper) = (variant.group.to_owned(), variant.name.clone(), variant.paper);
        rows.push(Row { group, name, paper, ..trained });
        let text = serde_json::to_string_pretty(&(&key, &rows)).expect("plain data");
        write_atomically(&log, text.as_bytes(), true)?;
    }
    // The log may have another order.
    let place = |row: &Row| variants.iter().position(|v| v.group == row.group && v.name == row.name);
    rows.sort_by_key(place);
    let report = Report {
        dataset: photographs.name.clone(),
        downscale: training.options.downscale,
        steps: training.config.steps,
        test_views: held_out.views.len(),
        seed: training.config.seed,
        rows,
    };
    session.console.result(&report, Report::text)
}

/// The rows in the log `path`; fails if it belongs to other trainings than those of `key`, unless `force`.
fn read_log(path: &PathBuf, key: &str, force: bool) -> Result<Vec<Row>, Error> {
    let text = match fs::read_to_string(path) {
        Ok(text) if !force => text,
        Err(e) if e.kind() != std::io::ErrorKind::NotFound => return Err(Error::io("read", path)(e)),
        _ => return Ok(Vec::new()),
    };
    match serde_json::from_str::<(String, Vec<Row>)>(&text) {
        Ok((of, rows)) if of == key => Ok(rows),
        _ => {
            let message =
                "the log belongs to other trainings; choose another folder with --out, or overwrite it with --force";
            Err(Error::Usage(format!("{}: {message}", path.display())))
        }
    }
}

/// The rows of the paper's tables; each changes one setting of `config`.
fn variants(config: &TrainConfig) -> Vec<Variant> {
    let mut variants = Vec::new();
    let mut add = |group, name: String, config, degrees, paper| {
        variants.push(Variant { group, name, config, degrees, paper });
    };
    let with_scales = |numbers: &[usize]| TrainConfig {
        scales: numbers.iter().filter_map(|&n| config.scales.get(n)).cloned().collect(),
        ..config.clone()
    };
    // The paper's tables have three scales; rows with scales that `config` lacks are left out.
    const SCALES: [(&[usize], Paper); 5] = [
        (&[0], Paper::new(32.22, 0.957, 1.75).with_minutes(18.22)),
        (&[1], Paper::new(32.73, 0.961, 4.15).with_minutes(21.31)),
        (&[2], Paper::new(31.96, 0.952, 10.20).with_minutes(28.55)),
        (&[0, 1], Paper::new(33.11, 0.963, 6.20).with_minutes(30.12)),
        (&[0, 1, 2], Paper::new(33.55, 0.965, 13.52).with_minutes(35.70)),
    ];
    for (numbers, paper) in SCALES.into_iter().filter(|(n, _)| n.iter().all(|n| *n < config.scales.len())) {
        let edges: Vec<String> = numbers.iter().map(|&n| config.scales[n].edge[0].to_string()).collect();
        add("scales", edges.join(" + "), with_scales(numbers), 0.0, paper);
    }
    const COMPONENTS: [(u32, Paper); 4] = [
        (12, Paper::new(32.94, 0.961, 4.87)),
        (24, Paper::new(33.24, 0.963, 7.07)),
        (48, Paper::new(33.55, 0.965, 13.52)),
        (96, Paper::new(33.59, 0.965, 21.01)),
    ];
    let changed = |change: &dyn Fn(&ScaleConfig) -> ScaleConfig| TrainConfig {
        scales: config.scales.iter().map(change).collect(),
        ..config.clone()
    };
    for (appearance_rank, paper) in COMPONENTS {
        let config = changed(&|s| ScaleConfig { appearance_rank, ..s.clone() });
        add("components", appearance_rank.to_string(), config, 0.0, paper);
    }
    for top_k in [4, 2] {
        add("top-k", top_k.to_string(), changed(&|s| ScaleConfig { top_k, ..s.clone() }), 0.0, Paper::default());
    }
    for (degrees, psnr) in [(0.0, 36.52), (5.0, 35.37), (45.0, 34.97)] {
        add("rotation", format!("{degrees}°"), config.clone(), degrees, Paper::of_rotation(psnr));
    }
    variants
}

fn train(
    variant: &Variant,
    [photographs, held_out]: [&Dataset; 2],
    interrupted: &AtomicBool,
    session: &Session,
) -> Result<Row, Error> {
    let turn = Similarity {
        scale: 1.0,
        rotation: DQuat::from_axis_angle(DVec3::Z, variant.degrees.to_radians()),
        translation: DVec3::ZERO,
    };
    let turned = |dataset: &Dataset| {
        let mut dataset = dataset.clone();
        if variant.degrees != 0.0 {
            dataset.views.iter_mut().for_each(|view| view.camera = view.camera.mapped(&turn));
            // They are not turned.
            (dataset.points, dataset.bounds) = (None, None);
        }
        dataset
    };
    let start = Instant::now();
    let scene = train_through(variant.config.clone(), &mut turned(photographs), interrupted, session)?;
    let seconds = start.elapsed().as_secs_f64();
    let renderer = CpuRenderer::new(&scene);
    let mut reports = Vec::new();
    for view in &turned(held_out).views {
        let picture = renderer.render(&view.camera.mapped(&scene.frame.model_from_dataset));
        let photograph = view.pixels.colors(scene.frame.background);
        let (size, mask) = ([picture.width, picture.height], view.mask.as_deref());
        reports.push(ViewReport::new(&view.name, size, &colors(&picture), &photograph, mask)?);
    }
    let report = measure::Report::new(reports).ok_or_else(|| Error::Runtime("no held-out views".into()))?;
    session.console.say(&format!("{:.2} dB in {:.1} minutes", report.psnr, seconds / 60.0));
    Ok(Row {
        group: variant.group.to_owned(),
        name: variant.name.clone(),
        psnr: report.psnr,
        ssim: report.ssim,
        parameters: scene.parameter_count(),
        seconds,
        paper: variant.paper,
    })
}

impl Report {
    fn text(&self) -> String {
        let mut table =
            Table::new(["", "", "PSNR", "SSIM", "parameters, M", "minutes", "paper: PSNR", "SSIM", "M", "minutes"]);
        let number =
            |value: Option<f64>, digits: usize| value.map_or_else(|| "-".to_owned(), |v| format!("{v:.digits$}"));
        for row in &self.rows {
            table.row([
                row.group.clone(),
                row.name.clone(),
                format!("{:.2}", row.psnr),
                number(row.ssim, 4),
                format!("{:.2}", row.parameters as f64 / 1e6),
                format!("{:.1}", row.seconds / 60.0),
                number(row.paper.psnr, 2),
                number(row.paper.ssim, 3),
                number(row.paper.parameters_millions, 2),
                number(row.paper.minutes, 1),
            ]);
        }
        let Self { dataset, downscale, steps, test_views, seed, .. } = self;
        let (steps, views) = (plural(*steps as usize, "step"), plural(*test_views, "test view"));
        let made = format!("{dataset}, 1/{downscale} size, {steps}, seed {seed}, {views}; ");
        let paper = "the paper's columns: 30 000 steps on an RTX 3090; means over eight scenes for scales and components, lego for rotations\n";
        made + paper + &table.text()
    }
}
