//! `strivec synth`: a synthetic dataset.

use std::path::{Path, PathBuf};

use clap::ValueEnum;
use serde::Serialize;

use super::{Error, Session, picture_size};
use crate::dataset::{self, SynthOptions, Synthesized, SynthesizedScan};

const EXAMPLES: &str = "\
Examples:
  strivec synth toy --views 40 --size 200x200 --seed 1
  strivec synth scene0000_00 --layout scannet --views 140 --test-views 20 --size 324x242

The Blender layout has transforms_train.json and the like, the exact mesh (mesh.ply, mesh.obj), points on the surface \
(points.ply) and the occupied cells (occupancy.npz). The ScanNet layout is a room as written by ScanNet's exporter: a mesh \
with holes, poses with an axis alignment, two of them lost, and one frame in eight for testing. A folder that is not empty \
needs --force.";

/// The arguments.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct Args {
    /// Folder for the dataset; created if absent
    out: PathBuf,
    /// Dataset layout
    #[arg(long, value_enum, default_value_t)]
    layout: Layout,
    /// Views of the training split
    #[arg(long, value_name = "N", default_value_t = 100)]
    views: u32,
    /// Views of the test split, plus a quarter as many for validation; the ScanNet layout adds them to --views
    #[arg(long, value_name = "N", default_value_t = 20)]
    test_views: u32,
    /// Size of the pictures, in pixels
    #[arg(long, value_name = "WxH", default_value = "200x200", value_parser = picture_size::parse)]
    size: [u32; 2],
    /// Random seed; equal seeds give equal bytes
    #[arg(long, value_name = "S", default_value_t = 0)]
    seed: u64,
}

/// Dataset layouts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
enum Layout {
    /// Blender layout, as in NeRF-synthetic
    #[default]
    Blender,
    /// ScanNet layout
    Scannet,
}

/// The result, as `--json` prints it.
#[derive(Serialize)]
struct Report<'a> {
    folder: &'a Path,
    pictures: usize,
    triangles: usize,
    points: usize,
    occupied_cells: usize,
}

/// The result with ScanNet's layout, as `--json` prints it.
#[derive(Serialize)]
struct ScanReport<'a> {
    folder: &'a Path,
    pictures: usize,
    lost: usize,
    triangles: usize,
    torn_share: f64,
}

/// Makes the dataset.
pub(super) fn run(args: &Args, session: &Session) -> Result<(), Error> {
    let &Args { views, test_views, size, seed, .. } = args;
    session.console.say(&format!("synth: making {}", args.out.display()));
    let options = SynthOptions { views, test_views, size, seed, force: session.force };
    if args.layout == Layout::Scannet {
        let SynthesizedScan { pictures, lost, triangles, torn } = dataset::synthesize_scan(&args.out, &options)?;
        let report = ScanReport { folder: &args.out, pictures, lost, triangles, torn_share: torn };
        return session.console.result(&report, |report| {
            format!(
                "{}: {pictures} pictures, {lost} of them lost, {triangles} triangles, {:.1} % of the surface missing",
                report.folder.display(),
                100.0 * torn
            )
        });
    }
    let Synthesized { pictures, triangles, points, occupied_cells } = dataset::synthesize(&args.out, &options)?;
    let report = Report { folder: &args.out, pictures, triangles, points, occupied_cells };
    session.console.result(&report, |report| {
        format!(
            "{}: {pictures} pictures, {triangles} triangles, {points} points, {occupied_cells} occupied cells",
            report.folder.display()
        )
    })
}
