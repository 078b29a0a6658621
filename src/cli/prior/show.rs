//! `strivec prior show`: a prior over the photographs that it should fit.

use std::path::{Path, PathBuf};

use serde::Serialize;

use super::shaping::Shaping;
use crate::error::with_flags;
use crate::observer::ConsoleObserver;
use crate::table::{plural, short};
use crate::view_selection::ViewSelection;
use crate::{Context, Error, check_output, write_atomically};
use strivec_capture::dataset;
use strivec_capture::dataset::Dataset;
use strivec_capture::prior;
use strivec_capture::prior::{Built, PriorVisibility, Shading, SparseVoxelTree};
use strivec_format::escape::escaped_path;
use strivec_format::geometry::Camera;
use strivec_measure::{Sheet, color_png, side_by_side, stacked};
use strivec_recipe as recipe;

const EXAMPLES: &str = "\
Examples:
  strivec prior show room.npz --data scene0101_04 --out room.png --downscale 4 --every 50
  strivec prior show mesh.ply --data lego --out sheet.png --views 0..4

Each row shows a photograph, and the same photograph overlaid with the first cell met by each ray: in the cell's color, if \
the prior has colors, and in a color by distance, from red (near) to blue (far). A prior that fits covers the scene and \
nothing else.";
/// Default number of views on a sheet.
const ROWS: usize = 4;
/// Background color for transparent pixels.
const BACKGROUND: [f32; 3] = [1.0; 3];

/// The arguments.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Args {
    /// Output of `strivec prior`, or any of its inputs; several are joined
    #[arg(value_name = "PRIOR", required = true)]
    inputs: Vec<PathBuf>,
    /// Dataset folder
    #[arg(long, value_name = "DATASET")]
    data: PathBuf,
    /// Picture to write
    #[arg(long, value_name = "PNG")]
    out: PathBuf,
    /// Split of the dataset: train, val, test or all; for Blender's layout S of transforms_S.json
    #[arg(long, value_name = "S", default_value = "train")]
    split: String,
    /// Downscale photographs N times
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..))]
    downscale: u32,
    #[command(flatten)]
    selection: ViewSelection,
    #[command(flatten)]
    shaping: Shaping,
}

/// The result, as `--json` prints it.
#[derive(Serialize)]
struct ShowReport<'a> {
    file: &'a Path,
    views: usize,
    cells: usize,
    /// The share of the shown cameras' rays that meet the prior.
    share_of_rays: f64,
    /// Distances of the nearest and the farthest cell that a ray meets, in dataset units: red and blue on the sheet.
    distances: Option<[f64; 2]>,
    /// The likely cause if that share is small.
    advice: Option<String>,
}

/// Writes the sheet.
pub(crate) fn run(args: &Args, session: &Context) -> Result<(), Error> {
    let _reserved = check_output(&args.out, session.force)?;
    let Built { boxes, colors, .. } = recipe::build_prior(
        &args.inputs,
        &args.shaping.options()?,
        &mut ConsoleObserver::unstoppable(&session.console),
    )?;
    let mut options = args.selection.options(args.downscale);
    if options.views.is_none() && options.every == 1 {
        let count = dataset::load_cameras(&args.data, &args.split, None, &options)?.len();
        options.every = count.div_ceil(ROWS).max(1);
    }
    let Dataset { views, .. } = dataset::load(&args.data, &args.split, &options)?;
    let tree = SparseVoxelTree::new(&boxes);
    let cameras: Vec<Camera> = views.iter().map(|view| view.camera).collect();
    let distances = prior::distance_range(&tree, &cameras);
    let by_distance = Shading::Distance(distances.unwrap_or_default());
    let shadings: Vec<_> = colors.as_deref().map(Shading::Cells).into_iter().chain([by_distance]).collect();
    let mut rows = Vec::new();
    for view in &views {
        let photograph = view.pixels.colors(BACKGROUND);
        let size = [view.camera.width, view.camera.height];
        let mut row = Vec::new();
        for &shading in &shadings {
            let colors = prior::overlay(&tree, &boxes, shading, &view.camera, &photograph)
                .map_err(|error| Error::Runtime(error.to_string()))?;
            row.push(Sheet { size, colors });
        }
        row.insert(0, Sheet { size, colors: photograph });
        rows.push(side_by_side(&row));
    }
    let sheet = stacked(&rows);
    write_atomically(&args.out, &color_png(sheet.size, &sheet.colors)?, session.force)?;

    let PriorVisibility { share, advice } = prior::check_alignment(&boxes, &cameras);
    let shown = ShowReport {
        file: &args.out,
        views: views.len(),
        cells: boxes.cells.len(),
        share_of_rays: share,
        distances,
        advice: advice.map(|advice| with_flags(&advice)),
    };
    session.console.result(&shown, |shown| {
        let advice = shown.advice.as_ref().map_or_else(String::new, |advice| format!("\n{advice}"));
        let (file, views, cells) = (escaped_path(shown.file), plural(shown.views, "view"), plural(shown.cells, "cell"));
        let distances = shown.distances.map_or_else(String::new, |range| {
            let [near, far] = range.map(short);
            format!(", {near} (red) to {far} (blue) away")
        });
        let share = 100.0 * shown.share_of_rays;
        format!("{file}: {views}, {cells}; {share:.1} % of their rays meet one{distances}{advice}")
    })
}
