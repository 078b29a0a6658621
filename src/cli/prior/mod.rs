//! `strivec prior`, and priors from files for other commands.

mod inputs;
mod shaping;
mod show;

use std::path::{Path, PathBuf};

use serde::Serialize;

pub(super) use inputs::Inputs;
use shaping::Shaping;

use super::error::with_flags;
use super::observer::ConsoleObserver;
use super::table::{plural, short};
use super::{Context, Error, check_output, write_atomically};
use crate::dataset::DatasetOptions;
use strivec_capture::dataset;
use strivec_capture::prior;
use strivec_capture::prior::Counts;
use strivec_format::escape::escaped_path;
use strivec_recipe as recipe;

const EXAMPLES: &str = "\
Examples:
  strivec prior mesh.ply -o prior.npz
  strivec prior scan.laz more.e57 -o prior.npz --voxel 0.05 --outliers 16,2 --min-points 3
  strivec prior scene0101_04 -o prior.npz --close 0.2
  strivec prior coarse_last.tar -o prior.npz
  strivec prior model.glb -o prior.npz --up y --scale 0.001 --data lego
  strivec prior show prior.npz --data lego --out sheet.png

Reads PLY, OBJ, STL, OFF, glTF and GLB meshes; PLY, XYZ, XYZN, XYZRGB, TXT, CSV, PTS, NPY, PCD, LAS, LAZ and E57 \
clouds; COLMAP's points3D.bin and .txt; Gaussian splats as PLY, .splat, SPZ, SOG and in glTF; DVGO's and TensoRF's checkpoints; NPY and NPZ grids; OctoMap's .bt and .ot; a ScanNet scene's folder. \
Several inputs are joined. The output opens in NumPy: cells, origin, pitch and, if there are colors, colors.";

/// The arguments.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES, args_conflicts_with_subcommands = true, subcommand_negates_reqs = true)]
pub(super) struct Args {
    #[command(subcommand)]
    command: Option<Command>,
    /// Geometry files and folders
    #[arg(required = true, value_name = "INPUT")]
    inputs: Vec<PathBuf>,
    /// Prior file to write
    #[arg(long, short, value_name = "NPZ", required = true)]
    output: Option<PathBuf>,
    /// Dataset folder: report the share of its cameras' rays that meet the prior, and the likely cause if it is small
    #[arg(long, value_name = "DATASET")]
    data: Option<PathBuf>,
    #[command(flatten)]
    dataset: DatasetOptions,
    #[command(flatten)]
    shaping: Shaping,
}

#[derive(Debug, clap::Subcommand)]
enum Command {
    /// Show a prior over photographs
    Show(show::Args),
}

/// The result, as `--json` prints it.
#[derive(Serialize)]
struct Report<'a> {
    file: &'a Path,
    cells: usize,
    /// Edge lengths of a cell.
    pitch: [f64; 3],
    /// The smallest and the largest corner.
    bounds: [[f64; 3]; 2],
    colored: bool,
    points: u64,
    outliers: u64,
    /// Points left out because they are marked as withheld.
    withheld: u64,
    /// Points left out because their class is noise.
    noise: u64,
    /// Splats left out because of their opacity.
    transparent: u64,
    /// Points and triangles left out because a coordinate is not finite.
    not_finite: u64,
    triangles: u64,
    degenerate_triangles: u64,
    grid_cells: u64,
    /// The share of the cameras' rays that meet the prior.
    share_of_rays: Option<f64>,
    /// The likely cause if that share is small.
    advice: Option<String>,
}

/// Reads geometry and writes its occupied cells.
pub(super) fn run(args: &Args, session: &Context) -> Result<(), Error> {
    if let Some(Command::Show(args)) = &args.command {
        return show::run(args, session);
    }
    let Some(output) = &args.output else { return Err(Error::Usage("give --output".into())) };
    let _reserved = check_output(output, session.force)?;
    let mut observer = ConsoleObserver::unstoppable(&session.console);
    let built = recipe::build_prior(&args.inputs, &args.shaping.options()?, &mut observer)?;
    let sight = match &args.data {
        Some(folder) => {
            let cameras = dataset::load_cameras(folder, "train", None, &args.dataset.load_options(1))?;
            let cameras: Vec<_> = cameras.into_iter().map(|named| named.camera).collect();
            Some(recipe::check_sight(&built.boxes, &cameras, &mut observer))
        }
        None => None,
    };
    let bytes = prior::to_npz(&built).map_err(Error::io("write", output))?;
    write_atomically(output, &bytes, session.force)?;
    let bounds = built.boxes.bounds();
    let Counts { points, outliers, triangles, degenerate, cells, withheld, noise, transparent, not_finite } =
        built.counts;
    let report = Report {
        file: output,
        cells: built.boxes.cells.len(),
        pitch: built.boxes.lattice.pitch.into(),
        bounds: [bounds.min, bounds.max].map(Into::into),
        colored: built.colors.is_some(),
        points,
        outliers,
        withheld,
        noise,
        transparent,
        not_finite,
        triangles,
        degenerate_triangles: degenerate,
        grid_cells: cells,
        share_of_rays: sight.as_ref().map(|sight| sight.share),
        advice: sight.and_then(|sight| sight.advice).map(|advice| with_flags(&advice)),
    };
    session.console.result(&report, |r| {
        let [x, y, z] = r.pitch.map(short);
        let cells = plural(r.cells, "cell");
        format!(
            "{}: {cells} of {x} x {y} x {z}, from {} to {}",
            escaped_path(r.file),
            r.bounds[0].map(short).join(", "),
            r.bounds[1].map(short).join(", ")
        )
    })
}
