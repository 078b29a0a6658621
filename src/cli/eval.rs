//! `strivec eval`: compare a scene's pictures with photographs.

use std::path::{Path, PathBuf};
use std::time::Instant;

use serde::Serialize;

use super::approximations::Approximations;
use super::backend::{BackendOptions, Drawn};
use super::output::{check_outputs, make_folder};
use super::progress::Progress;
use super::render::colors;
use super::table::Table;
use super::view_selection::ViewSelection;
use super::{Error, Session, refined_poses, scene_file, write_atomically};
use crate::dataset::{self, Dataset, LoadOptions, View};
use crate::measure::{
    self, Canvas, Region, RegionErrors, RegionReport, ViewReport, color_png, counted, error_map, side_by_side,
};
use crate::render::{RenderSettings, upsample_bilinear};

const EXAMPLES: &str = "\
Examples:
  strivec eval lego.strivec lego --split test
  strivec eval lego.strivec lego --split test --downscale 4 --every 10 --sheets sheets --json

The mean PSNR is the mean of the views' PSNR, as papers print it. SSIM uses an 11x11 Gaussian window (sigma 1.5).
The PSNR after a color fit is that after the best affine map of a view's colors: without its exposure and white balance.";
/// The difference shown as the brightest color of an error picture.
const ERROR_FULL: f32 = 0.2;

/// The arguments.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct Args {
    /// Scene file
    file: PathBuf,
    /// Dataset folder
    dataset: PathBuf,
    /// Split of the dataset: train, val, test or all; for Blender's layout S of transforms_S.json
    #[arg(long, value_name = "S", default_value = "test")]
    split: String,
    /// Downscale photographs N times
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..))]
    downscale: u32,
    #[command(flatten)]
    selection: ViewSelection,
    /// Refined poses of the training views, as `train --refine-poses` writes them: views move by the similarity from the
    /// dataset's poses to these [default: views stay where the dataset has them]
    #[arg(long, value_name = "FILE")]
    aligned_to: Option<PathBuf>,
    /// Folder for one picture per view: photograph, rendering and error (brightest at 0.2 and above)
    #[arg(long, value_name = "DIR")]
    sheets: Option<PathBuf>,
    #[command(flatten)]
    backend: BackendOptions,
    /// Also compare the renderer with the reference renderer ray by ray on these views; slow
    #[arg(long)]
    parity: bool,
    #[command(flatten)]
    approximations: Approximations,
}

/// The result, as `--json` prints it.
#[derive(Serialize)]
struct Evaluation<'a> {
    file: &'a Path,
    bytes: u64,
    dataset: &'a str,
    split: &'a str,
    downscale: u32,
    #[serde(flatten)]
    drawn: Drawn,
    #[serde(flatten)]
    settings: RenderSettings,
    /// Preparation of the renderer, with the density cache.
    seconds_preparing: f64,
    /// Mean time of rendering a view.
    seconds_per_view: f64,
    #[serde(flatten)]
    report: measure::Report,
    /// Errors by region of the photographs.
    regions: Vec<RegionReport>,
    /// Comparison of the renderer with the reference.
    parity: Option<measure::Parity>,
}

/// Renders the split's views and compares them.
pub(super) fn run(args: &Args, session: &Session) -> Result<(), Error> {
    args.backend.check()?;
    let (scene_file, bytes) = scene_file::read(&args.file, &session.console)?;
    let bytes = bytes.len() as u64;
    let options = args.selection.options(args.downscale);
    let Dataset { name, mut views, .. } = dataset::load(&args.dataset, &args.split, &options)?;
    if let Some(path) = &args.aligned_to {
        let all = LoadOptions { views: None, every: 1, ..options };
        let (map, focal_scale) =
            refined_poses::alignment(path, &dataset::load_cameras(&args.dataset, "train", None, &all)?)?;
        for View { camera, .. } in &mut views {
            *camera = camera.mapped(&map);
            camera.focal = camera.focal.map(|focal| focal_scale * focal);
        }
    }
    let sheet = |folder: &Path, view: &View| folder.join(format!("{}.png", view.name));
    if let Some(folder) = &args.sheets {
        make_folder(folder)?;
        let planned: Vec<PathBuf> = views.iter().map(|view| sheet(folder, view)).collect();
        check_outputs(&planned, session.force)?;
    }

    let size = views.first().map_or([0, 0], |view| [view.camera.width, view.camera.height]);
    let settings = args.approximations.settings(&scene_file, &args.file, size)?;
    let scene = scene_file::with_scales_of(scene_file, &settings.approximation);
    let frame = scene.frame.clone();
    let whole = args.parity.then(|| scene.clone());
    let start = Instant::now();
    let mut renderer = args.backend.prepare(scene, &settings.approximation, &session.console)?;
    let seconds_preparing = start.elapsed().as_secs_f64();
    let progress = Progress::start(&session.console, "eval", views.len() as u64);
    let mut reports: Vec<ViewReport> = Vec::new();
    let mut errors = RegionErrors::default();
    let mut seconds = 0.0;
    for view in &views {
        let start = Instant::now();
        let camera = view.camera.mapped(&frame.model_from_dataset);
        let size = [camera.width, camera.height];
        let picture = upsample_bilinear(&renderer.render(&camera.downscaled(settings.divisor))?, size);
        seconds += start.elapsed().as_secs_f64();
        let (photograph, rendered) = (view.pixels.colors(frame.background), colors(&picture));
        let report = ViewReport::new(&view.name, size, &rendered, &photograph, view.mask.as_deref())?;
        let regions = Region::from_photograph(size, &photograph, &view.pixels.opacities())?;
        match &view.mask {
            None => errors.add(&regions, &rendered, &photograph)?,
            Some(mask) => {
                errors.add(&counted(&regions, mask), &counted(&rendered, mask), &counted(&photograph, mask))?;
            }
        }
        if let Some(folder) = &args.sheets {
            let difference = error_map(&rendered, &photograph, ERROR_FULL)?;
            let pictures = [photograph, rendered, difference].map(|colors| Canvas { size, colors });
            let joined = side_by_side(&pictures);
            write_atomically(&sheet(folder, view), &color_png(joined.size, &joined.colors)?, session.force)?;
        }
        reports.push(report);
        progress.set(reports.len() as u64, || {
            let mean = reports.iter().map(|r| r.psnr).sum::<f64>() / reports.len() as f64;
            format!("mean {mean:.2} dB")
        });
    }
    let seconds_per_view = seconds / views.len() as f64;
    progress.finish(&format!("{seconds_per_view:.2} s per view"));

    let report = measure::Report::new(reports)
        .ok_or_else(|| Error::Malformed(format!("{}: the selected split has no views", args.dataset.display())))?;
    let parity = match whole {
        None => None,
        Some(scene) => {
            session.console.say("comparing with the reference");
            let cameras: Vec<_> = views.iter().map(|v| v.camera.mapped(&frame.model_from_dataset)).collect();
            Some(renderer.parity(&scene, &cameras)?)
        }
    };
    let evaluation = Evaluation {
        file: &args.file,
        bytes,
        dataset: &name,
        split: &args.split,
        downscale: args.downscale,
        drawn: renderer.drawn(),
        settings,
        seconds_preparing,
        seconds_per_view,
        report,
        regions: errors.report(),
        parity,
    };
    session.console.result(&evaluation, |e| {
        text(&e.report) + "\n" + &regions_text(&e.regions) + &e.parity.map_or_else(String::new, parity_text)
    })
}

fn parity_text(parity: measure::Parity) -> String {
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

fn regions_text(regions: &[RegionReport]) -> String {
    let mut table = Table::new(["region", "pixels", "error", "PSNR"]);
    let percent = |share: f64| format!("{:.1} %", 100.0 * share);
    for r in regions {
        let name = r.region.name().to_owned();
        table.row([name, percent(r.share_of_pixels), percent(r.share_of_error), format!("{:.2}", r.psnr)]);
    }
    table.text()
}

fn text(report: &measure::Report) -> String {
    let mut table = Table::new(["view", "PSNR", "after color fit", "SSIM"]);
    let ssim = |value: Option<f64>| value.map_or_else(|| "-".to_owned(), |v| format!("{v:.4}"));
    for view in &report.views {
        let fitted = format!("{:.2}", view.psnr_after_color_fit);
        table.row([view.name.clone(), format!("{:.2}", view.psnr), fitted, ssim(view.ssim)]);
    }
    let mean = format!("mean of {}", report.views.len());
    let [psnr, fitted] = [report.psnr, report.psnr_after_color_fit].map(|psnr| format!("{psnr:.3}"));
    table.row([mean, psnr, fitted, ssim(report.ssim)]);
    table.text()
}
