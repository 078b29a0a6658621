//! `strivec compare`: compare several scenes with each other over the same photographs.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde::Serialize;

use super::approximations::Approximations;
use super::backend::BackendOptions;
use super::evaluation::{
    Evaluated, Evaluator, MeasureOptions, Metric, OutputOptions, Page, PageTable, Photographs, SceneToEvaluate,
    ShownView, TableCell,
};
use super::table::{Table, plural};
use super::{Context, Error};
use strivec_capture::dataset::{Dataset, Photograph};
use strivec_format::digits::{grouped, numbers};
use strivec_measure::{PairedDifference, ViewReport};

const EXAMPLES: &str = "\
Examples:
  strivec compare lego.strivec small.strivec lego --split test
  strivec compare a.strivec b.strivec c.strivec lego --ssim 3dgs --csv views.csv --report compared.html

Files are named A, B, C in their order. B − A is the mean over the views of B's number less A's, and its standard error.";
/// The most files that letters name.
const MAX_FILES: usize = 26;

/// The arguments.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct Args {
    /// Scene files; the others are compared with the first
    #[arg(value_name = "FILE", required = true, num_args = 2..=MAX_FILES)]
    files: Vec<PathBuf>,
    #[command(flatten)]
    photographs: Photographs,
    #[command(flatten)]
    backend: BackendOptions,
    #[command(flatten)]
    measures: MeasureOptions,
    #[command(flatten)]
    outputs: OutputOptions,
    #[command(flatten)]
    approximations: Approximations,
}

/// The result, as `--json` prints it.
#[derive(Serialize)]
struct PictureComparison<'a> {
    dataset: &'a str,
    split: &'a str,
    downscale: u32,
    files: Vec<Evaluated>,
    /// For each file but the first the differences of its numbers to those of the first.
    differences: Vec<FileDifferences>,
}

/// Differences of a file's numbers to those of the first file.
#[derive(Serialize)]
struct FileDifferences {
    file: PathBuf,
    /// Differences by metric; metrics that a view lacks are left out.
    #[serde(flatten)]
    by_metric: BTreeMap<&'static str, PairedDifference>,
}

impl FileDifferences {
    fn new(file: &Evaluated, first: &Evaluated) -> Self {
        let views = || file.report.views.iter().zip(&first.report.views);
        let of = |metric: Metric| {
            let differences: Option<Vec<f64>> = views().map(|(view, base)| metric.difference(view, base)).collect();
            Some((metric.name, PairedDifference::new(&differences?)?))
        };
        let by_metric = Metric::of(&first.report).into_iter().filter_map(of).collect();
        Self { file: file.file.clone(), by_metric }
    }

    /// As in `-0.88 ± 0.02`; empty without a difference.
    fn text(&self, metric: Metric) -> String {
        let Some(PairedDifference { mean, standard_error }) = self.by_metric.get(metric.name) else {
            return String::new();
        };
        let error =
            standard_error.map_or_else(String::new, |error| format!(" ± {}", metric.difference_text(error, false)));
        metric.difference_text(*mean, true) + &error
    }
}

/// Evaluates the files one after another and compares them view by view.
pub(super) fn run(args: &Args, session: &Context) -> Result<(), Error> {
    args.backend.check()?;
    let _reserved = args.outputs.check(session)?;
    let scenes: Vec<_> =
        args.files.iter().map(|file| SceneToEvaluate::read(file, session)).collect::<Result<_, _>>()?;
    let Dataset { name, views, unreadable, .. } = args.photographs.load()?;
    unreadable.iter().for_each(|error| session.console.say(&format!("left out: {error}")));
    check_backgrounds(&scenes, &views)?;

    let evaluator = Evaluator {
        session,
        backend: &args.backend,
        approximations: &args.approximations,
        ssim: &args.measures.ssim,
        parity: false,
    };
    let mut pictures = args.outputs.pictures(views.len());
    let mut files = Vec::new();
    for (n, scene) in scenes.into_iter().enumerate() {
        session.console.say(&format!("{}: {}", letter(n), scene.path().display()));
        files.push(evaluator.evaluate(scene, &views, |view| pictures.add(view, &letter(n).to_string()))?);
    }
    let differences = files[1..].iter().map(|file| FileDifferences::new(file, &files[0])).collect();
    let Photographs { split, downscale, .. } = &args.photographs;
    let comparison = PictureComparison { dataset: &name, split, downscale: *downscale, files, differences };
    let reports: Vec<(&Path, _)> = comparison.files.iter().map(|file| (file.file.as_path(), &file.report)).collect();
    args.outputs.write(&reports, || page(&comparison, pictures.into_views()), session)?;
    session.console.result(&comparison, text)
}

/// Errors if the photographs, which are partly transparent, would be composited on several backgrounds.
fn check_backgrounds(scenes: &[SceneToEvaluate], views: &[Photograph]) -> Result<(), Error> {
    let first = &scenes[0];
    let background = first.background();
    let depends =
        |other: [f32; 3]| views.iter().any(|view| view.pixels.colors(background) != view.pixels.colors(other));
    match scenes.iter().find(|scene| scene.background() != background && depends(scene.background())) {
        None => Ok(()),
        Some(scene) => Err(Error::Usage(format!(
            "{}: its background is {}, that of {} is {}: the transparent photographs would not be the same; compare scenes of \
             one background",
            scene.path().display(),
            numbers(scene.background()),
            first.path().display(),
            numbers(background)
        ))),
    }
}

/// The name of file `n` in headings: A, B, C.
fn letter(n: usize) -> char {
    char::from(b'A' + n as u8)
}

fn text(comparison: &PictureComparison<'_>) -> String {
    let mut files = Table::new(["", "file", "bytes"]);
    for (n, file) in comparison.files.iter().enumerate() {
        files.row([letter(n).to_string(), file.file.display().to_string(), grouped(file.bytes)]);
    }
    let mut means = Table::new(mean_columns(comparison));
    for row in mean_rows(comparison) {
        means.row(row.into_iter().map(|(text, _)| text));
    }
    format!("{}\n{}differences: {}\n", files.text(), means.text(), note(comparison))
}

/// Headings of the means: each file, and the difference of each but the first to the first.
fn mean_columns(comparison: &PictureComparison<'_>) -> Vec<String> {
    let files = comparison.files.len();
    let means = (0..files).map(|n| letter(n).to_string());
    ["mean".to_owned()].into_iter().chain(means).chain((1..files).map(difference_heading)).collect()
}

/// For each metric a row of texts, and of the numbers that they show.
fn mean_rows(comparison: &PictureComparison<'_>) -> Vec<Vec<(String, Option<f64>)>> {
    let row = |metric: Metric| {
        let mean = |file: &Evaluated| {
            let mean = metric.mean(&file.report);
            (metric.mean_text(mean), mean)
        };
        let difference = |differences: &FileDifferences| {
            let mean = differences.by_metric.get(metric.name).map(|difference| difference.mean);
            (differences.text(metric), mean)
        };
        let differences = comparison.differences.iter().map(difference);
        [(metric.heading(), None)].into_iter().chain(comparison.files.iter().map(mean)).chain(differences).collect()
    };
    Metric::of(&comparison.files[0].report).into_iter().map(row).collect()
}

/// The heading of file `n` less the first.
fn difference_heading(n: usize) -> String {
    format!("{} − {}", letter(n), letter(0))
}

/// How differences are computed.
fn note(comparison: &PictureComparison<'_>) -> String {
    let views = comparison.files[0].report.views.len();
    format!("mean over {} ± its standard error", plural(views, "view"))
}

fn page(comparison: &PictureComparison<'_>, views: Vec<ShownView>) -> Page {
    let PictureComparison { dataset, split, downscale, files, .. } = comparison;
    let fact = |name: &str, value: String| (name.to_owned(), value);
    let facts = vec![
        fact("dataset", format!("{dataset}, split {split}, downscaled {downscale} times")),
        fact("views", files[0].report.views.len().to_string()),
        fact("differences", note(comparison)),
    ];
    let title = format!("Comparison of {} files", files.len());
    Page { title, facts, tables: vec![files_table(files), means_table(comparison), views_table(files)], views }
}

fn files_table(files: &[Evaluated]) -> PageTable {
    let row = |(n, file): (usize, &Evaluated)| {
        let size = TableCell::number(Some(file.bytes as f64), grouped(file.bytes));
        vec![TableCell::name(format!("{}: {}", letter(n), file.file.display())), size]
    };
    PageTable {
        heading: "Files".into(),
        columns: ["file", "bytes"].map(str::to_owned).to_vec(),
        rows: files.iter().enumerate().map(row).collect(),
    }
}

fn means_table(comparison: &PictureComparison<'_>) -> PageTable {
    let row = |row: Vec<(String, Option<f64>)>| {
        let cell = |(n, (text, value))| if n == 0 { TableCell::name(text) } else { TableCell::number(value, text) };
        row.into_iter().enumerate().map(cell).collect()
    };
    let rows = mean_rows(comparison).into_iter().map(row).collect();
    PageTable { heading: "Means".into(), columns: mean_columns(comparison), rows }
}

/// For each view and metric the number of each file, and its difference to the first.
fn views_table(files: &[Evaluated]) -> PageTable {
    let metrics = Metric::of(&files[0].report);
    let headings = metrics.iter().flat_map(|metric| {
        let heading = metric.heading();
        let of_files = (0..files.len()).map(|n| format!("{heading} {}", letter(n)));
        let differences = (1..files.len()).map(|n| format!("{heading} {}", difference_heading(n)));
        of_files.chain(differences).collect::<Vec<_>>()
    });
    let numbers = |metric: Metric, view: usize| {
        let of_file = |n: usize| &files[n].report.views[view];
        let number = |n| {
            let value = metric.of_view(of_file(n));
            TableCell::number(value, metric.text(value))
        };
        let difference = |n| {
            let value = metric.difference(of_file(n), of_file(0));
            TableCell::number(value, value.map_or_else(|| "-".to_owned(), |value| metric.difference_text(value, true)))
        };
        (0..files.len()).map(number).chain((1..files.len()).map(difference)).collect::<Vec<_>>()
    };
    let row = |(n, view): (usize, &ViewReport)| {
        let numbers = metrics.iter().flat_map(|&metric| numbers(metric, n));
        [TableCell::name(&view.name)].into_iter().chain(numbers).collect()
    };
    PageTable {
        heading: "Views".into(),
        columns: ["view".to_owned()].into_iter().chain(headings).collect(),
        rows: files[0].report.views.iter().enumerate().map(row).collect(),
    }
}
