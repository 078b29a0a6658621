//! `strivec eval`: compare a scene's pictures with photographs.

use std::collections::{HashMap, HashSet};
use std::path::{Path, PathBuf};

use serde::Serialize;

use super::approximations::Approximations;
use super::backend::BackendOptions;
use super::evaluation::{
    Evaluated, Evaluator, MeasureOptions, Metric, OutputOptions, Page, PageTable, Photographs, SceneToEvaluate, Shown,
    ShownView, TableCell,
};
use super::output::{check_outputs, make_folder};
use super::table::Table;
use super::{Context, Error, write_atomically};
use strivec_capture::dataset::Dataset;
use strivec_format::digits::grouped;
use strivec_measure::{
    ERROR_FULL, Parity, RegionReport, Report, Sheet, ViewReport, color_png, error_map, side_by_side,
};

const EXAMPLES: &str = "\
Examples:
  strivec eval lego.strivec lego --split test
  strivec eval lego.strivec lego --split test --downscale 4 --every 10 --sheets sheets --json
  strivec eval lego.strivec lego --ssim 3dgs,skimage --csv lego.csv --report lego.html

The mean PSNR is the mean of the views' PSNR, as papers print it. SSIM uses an 11x11 Gaussian window (sigma 1.5).
The PSNR after a color fit is that after the best affine map of a view's colors: without its exposure and white balance.
LPIPS of the views in --sheets is printed by tools/lpips/measure.py.";

/// The arguments.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct Args {
    /// Scene file
    file: PathBuf,
    #[command(flatten)]
    photographs: Photographs,
    /// Folder for one picture per view: photograph, rendering and error (brightest at 0.2 and above)
    #[arg(long, value_name = "DIR")]
    sheets: Option<PathBuf>,
    #[command(flatten)]
    backend: BackendOptions,
    /// Also compare the renderer with the reference renderer ray by ray on these views; slow
    #[arg(long)]
    parity: bool,
    #[command(flatten)]
    measures: MeasureOptions,
    #[command(flatten)]
    outputs: OutputOptions,
    #[command(flatten)]
    approximations: Approximations,
}

/// The result, as `--json` prints it.
#[derive(Serialize)]
struct Evaluation<'a> {
    dataset: &'a str,
    split: &'a str,
    downscale: u32,
    #[serde(flatten)]
    evaluated: Evaluated,
}

/// Renders the split's views and compares them.
pub(super) fn run(args: &Args, session: &Context) -> Result<(), Error> {
    args.backend.check()?;
    let _reserved = args.outputs.check(session)?;
    let scene = SceneToEvaluate::read(&args.file, session)?;
    let Dataset { name, views, unreadable, .. } = args.photographs.load()?;
    unreadable.iter().for_each(|error| session.console.say(&format!("left out: {error}")));
    let sheets = args.sheets.as_ref().map(|folder| sheets(folder, views.iter().map(|view| view.name.as_str())));
    let _reserved_sheets = match (&args.sheets, &sheets) {
        (Some(folder), Some(sheets)) => {
            make_folder(folder)?;
            check_outputs(sheets, session.force)?
        }
        _ => None,
    };

    let evaluator = Evaluator {
        session,
        backend: &args.backend,
        approximations: &args.approximations,
        ssim: &args.measures.ssim,
        parity: args.parity,
    };
    let mut pictures = args.outputs.pictures(views.len());
    let evaluated = evaluator.evaluate(scene, &views, |view| {
        if let Some(sheets) = &sheets {
            write_sheet(&sheets[view.index], view, session)?;
        }
        pictures.add(view, "")
    })?;
    let Photographs { split, downscale, .. } = &args.photographs;
    let evaluation = Evaluation { dataset: &name, split, downscale: *downscale, evaluated };
    let reports = [(args.file.as_path(), &evaluation.evaluated.report)];
    args.outputs.write(&reports, || page(&evaluation, pictures.into_views()), session)?;
    session.console.result(&evaluation, |evaluation| text(&evaluation.evaluated))
}

/// \[view\] the picture of each of the views `names`. Views of several splits may have one name; the second is `NAME_2`.
fn sheets<'a>(folder: &Path, names: impl Iterator<Item = &'a str>) -> Vec<PathBuf> {
    let (mut taken, mut counts) = (HashSet::new(), HashMap::new());
    let unique = |name: &str| {
        let count = counts.entry(name.to_owned()).or_insert(0_u32);
        loop {
            *count += 1;
            let unique = if *count == 1 { name.to_owned() } else { format!("{name}_{count}") };
            if taken.insert(unique.clone()) {
                return folder.join(format!("{unique}.png"));
            }
        }
    };
    names.map(unique).collect()
}

/// Writes the photograph, the rendering and the error side by side.
fn write_sheet(path: &Path, view: &Shown<'_>, session: &Context) -> Result<(), Error> {
    let difference = error_map(view.rendered, view.photograph, ERROR_FULL)?;
    let pictures = [view.photograph.to_vec(), view.rendered.to_vec(), difference];
    let joined = side_by_side(&pictures.map(|colors| Sheet { size: view.size, colors }));
    write_atomically(path, &color_png(joined.size, &joined.colors)?, session.force)
}

fn text(evaluated: &Evaluated) -> String {
    let Evaluated { report, regions, parity, .. } = evaluated;
    views_text(report) + "\n" + &regions_text(regions) + &parity.map_or_else(String::new, parity_text)
}

fn views_text(report: &Report) -> String {
    let metrics = Metric::of(report);
    let mut table = Table::new(["view".to_owned()].into_iter().chain(metrics.iter().map(|metric| metric.heading())));
    for view in &report.views {
        let numbers = metrics.iter().map(|metric| metric.text(metric.of_view(view)));
        table.row([view.name.clone()].into_iter().chain(numbers));
    }
    let means = metrics.iter().map(|metric| metric.mean_text(metric.mean(report)));
    table.row([format!("mean of {}", report.views.len())].into_iter().chain(means));
    table.text()
}

/// Headings of a region's numbers.
const REGION_COLUMNS: [&str; 4] = ["region", "pixels", "error", "PSNR"];

/// A region's shares of pixels and of error and its PSNR, as texts.
fn region_texts(region: &RegionReport) -> [String; 3] {
    let percent = |share: f64| format!("{:.1} %", 100.0 * share);
    [percent(region.share_of_pixels), percent(region.share_of_error), format!("{:.2}", region.psnr)]
}

fn regions_text(regions: &[RegionReport]) -> String {
    let mut table = Table::new(REGION_COLUMNS);
    for region in regions {
        table.row([region.region.name().to_owned()].into_iter().chain(region_texts(region)));
    }
    table.text()
}

fn parity_text(parity: Parity) -> String {
    format!(
        "against the reference: {} clear rays, largest difference {:.2e}; {} rays ({:.2} %) near a decision: \
         median {:.1e}, 99.9 % {:.1e}, largest {:.1e}",
        parity.clear_rays,
        parity.clear_maximum,
        parity.near_rays,
        100.0 * parity.near_share(),
        parity.near_median,
        parity.near_999,
        parity.near_maximum
    )
}

fn page(evaluation: &Evaluation<'_>, views: Vec<ShownView>) -> Page {
    let Evaluation { dataset, split, downscale, evaluated } = evaluation;
    let Evaluated { file, bytes, report, regions, seconds_per_view, .. } = evaluated;
    let fact = |name: &str, value: String| (name.to_owned(), value);
    let mut facts = vec![
        fact("file", format!("{}, {} bytes", file.display(), grouped(*bytes))),
        fact("dataset", format!("{dataset}, split {split}, downscaled {downscale} times")),
        fact("views", report.views.len().to_string()),
        fact("rendering", format!("{seconds_per_view:.2} s per view")),
    ];
    let mean = |metric: Metric| fact(&format!("mean {}", metric.heading()), metric.mean_text(metric.mean(report)));
    facts.extend(Metric::of(report).into_iter().map(mean));
    let title = format!("Evaluation of {}", file.display());
    Page { title, facts, tables: vec![views_table(report), regions_table(regions)], views }
}

fn views_table(report: &Report) -> PageTable {
    let metrics = Metric::of(report);
    let row = |view: &ViewReport| {
        let number = |metric: &Metric| {
            let value = metric.of_view(view);
            TableCell::number(value, metric.text(value))
        };
        [TableCell::name(&view.name)].into_iter().chain(metrics.iter().map(number)).collect()
    };
    PageTable {
        heading: "Views".into(),
        columns: ["view".to_owned()].into_iter().chain(metrics.iter().map(|metric| metric.heading())).collect(),
        rows: report.views.iter().map(row).collect(),
    }
}

fn regions_table(regions: &[RegionReport]) -> PageTable {
    let row = |region: &RegionReport| {
        let values = [region.share_of_pixels, region.share_of_error, region.psnr].map(Some);
        let numbers = values.into_iter().zip(region_texts(region)).map(|(value, text)| TableCell::number(value, text));
        [TableCell::name(region.region.name())].into_iter().chain(numbers).collect()
    };
    PageTable {
        heading: "Regions of the photographs".into(),
        columns: REGION_COLUMNS.map(str::to_owned).to_vec(),
        rows: regions.iter().map(row).collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn views_of_one_name_have_sheets_of_their_own() {
        let names = ["r_0", "r_1", "r_0", "r_0_2", "r_0"];
        let sheets = sheets(Path::new("out"), names.into_iter());
        let expected = ["r_0.png", "r_1.png", "r_0_2.png", "r_0_2_2.png", "r_0_3.png"];
        assert_eq!(sheets, expected.map(|name| Path::new("out").join(name)));
    }
}
