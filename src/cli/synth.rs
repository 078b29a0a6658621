//! `strivec synth`: a synthetic dataset.

use std::path::{Path, PathBuf};

use clap::ValueEnum;
use serde::Serialize;

use super::{Error, Session, picture_size};
use crate::dataset::{self, SynthOptions, Synthesised, SynthesisedScan};

const EXAMPLES: &str = "\
Examples:
  strivec synth toy --views 40 --size 200x200 --seed 1
  strivec synth scene0000_00 --layout scannet --views 140 --test-views 20 --size 324x242

Writes the Blender layout (transforms_train.json and so on) and, beside it, the exact mesh \
(mesh.ply, mesh.obj), points on the surface (points.ply) and the occupied cells (occupancy.npz). \
With --layout scannet it writes a room as ScanNet's exporter leaves it: a mesh with holes, poses that the \
scan's own file aligns, two of them lost, and one frame of eight for testing. \
A folder that holds something is refused without --force.";

/// The arguments.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct Args {
    /// Folder for the dataset; made where it is absent
    out: PathBuf,
    /// How the files lie in the folder
    #[arg(long, value_enum, default_value_t)]
    layout: Layout,
    /// Views of the training split
    #[arg(long, value_name = "N", default_value_t = 100)]
    views: u32,
    /// Views of the test split; a quarter as many are made for validation. ScanNet's layout only adds them up
    #[arg(long, value_name = "N", default_value_t = 20)]
    test_views: u32,
    /// Size of the pictures
    #[arg(long, value_name = "WxH", default_value = "200x200", value_parser = picture_size::parse)]
    size: [u32; 2],
    /// Of every random choice; the bytes depend on it alone
    #[arg(long, value_name = "S", default_value_t = 0)]
    seed: u64,
}

/// How photographs lie in a folder.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
enum Layout {
    /// As NeRF-synthetic's
    #[default]
    Blender,
    /// As a scan of ScanNet's
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
        let SynthesisedScan { pictures, lost, triangles, torn } = dataset::synthesise_scan(&args.out, &options)?;
        let report = ScanReport { folder: &args.out, pictures, lost, triangles, torn_share: torn };
        return session.console.result(&report, |report| {
            format!(
                "{}: {pictures} pictures, {lost} of them lost, {triangles} triangles, {:.1} % of the surface missing",
                report.folder.display(),
                100.0 * torn
            )
        });
    }
    let Synthesised { pictures, triangles, points, occupied_cells } = dataset::synthesise(&args.out, &options)?;
    let report = Report { folder: &args.out, pictures, triangles, points, occupied_cells };
    session.console.result(&report, |report| {
        format!(
            "{}: {pictures} pictures, {triangles} triangles, {points} points, {occupied_cells} occupied cells",
            report.folder.display()
        )
    })
}
