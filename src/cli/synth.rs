//! `strivec synth`: a synthetic dataset.

use std::path::{Path, PathBuf};

use serde::Serialize;

use super::named_value::one_of;
use super::{Context, Error, picture_size};
use strivec_format::escape::escaped_path;
use strivec_synth::{CameraModel, Surroundings, SynthLayout, SynthOptions, Synthesized};

const EXAMPLES: &str = "\
Examples:
  strivec synth toy --views 40 --size 200x200 --seed 1
  strivec synth fisheye --layout colmap --camera opencv-fisheye --views 52
  strivec synth meadow --outdoor --views 140 --test-views 20
  strivec synth statue --floor --layout colmap --views 49
  strivec synth scene0000_00 --layout scannet --room --views 140 --test-views 20 --size 324x242

Every layout but scannet has the same viewpoints and the exact geometry: a mesh (mesh.ply, mesh.obj), points on the surface \
(points.ply) and the occupied cells (occupancy.npz). The layouts colmap and llff test on every eighth picture. The ScanNet \
layout is what ScanNet's exporter writes: a mesh with holes, poses with an axis alignment, two of them lost, and one \
frame in eight for testing. The layouts blender, nsvf, llff and scannet have pinhole cameras only, transforms all but \
thin-prism-fisheye. An equirectangular picture is the whole sphere: with 8.73 times the width it shows the scene with as many \
pixels as the others. A folder that is not empty needs --force.";

/// The arguments.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct Args {
    /// Folder for the dataset; created if absent
    out: PathBuf,
    /// Dataset layout
    #[arg(long, value_parser = one_of(SynthLayout::ALL, SynthLayout::name), default_value = "blender")]
    layout: SynthLayout,
    /// Camera model; all but pinhole distort
    #[arg(long, value_parser = one_of(CameraModel::ALL, CameraModel::name), default_value = "pinhole")]
    camera: CameraModel,
    /// Views of the training split
    #[arg(long, value_name = "N", default_value_t = 100)]
    views: u32,
    /// Views of the test split, plus a quarter as many for validation in layouts that have them; the ScanNet layout adds them
    /// to --views [default: 20; a seventh of --views, rounded up, in the layouts colmap, colmap-text and llff]
    #[arg(long, value_name = "N")]
    test_views: Option<u32>,
    /// Size of the pictures, in pixels
    #[arg(long, value_name = "WxH", default_value = "200x200", value_parser = picture_size::parse)]
    size: [u32; 2],
    /// Surroundings without an edge instead of a transparent background: a meadow to the horizon, far hills and a sky
    #[arg(long)]
    outdoor: bool,
    /// A closed room instead of a transparent background: floor, walls and ceiling, with cameras in it
    #[arg(long, conflicts_with = "outdoor")]
    room: bool,
    /// A plain floor without an edge instead of a transparent background, in photographs of different exposures; the layout
    /// transforms has depth maps
    #[arg(long, conflicts_with_all = ["outdoor", "room"])]
    floor: bool,
    /// Random seed; equal seeds give equal bytes
    #[arg(long, value_name = "S", default_value_t = 0)]
    seed: u64,
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
pub(super) fn run(args: &Args, session: &Context) -> Result<(), Error> {
    let &Args { layout, camera, views, size, seed, outdoor, room, floor, .. } = args;
    let surroundings = match [outdoor, room, floor] {
        [true, ..] => Surroundings::Meadow,
        [_, true, _] => Surroundings::Room,
        [.., true] => Surroundings::Floor,
        [false, false, false] => Surroundings::None,
    };
    let folder = &args.out;
    session.console.say(&format!("synth: making {}", folder.display()));
    let test_views = args.test_views.or(layout.test_views(views)).unwrap_or(SynthOptions::default().test_views);
    let options = SynthOptions { layout, camera, views, test_views, size, seed, surroundings, force: session.force };
    let made = strivec_synth::synthesize(folder, &options)?;
    let Synthesized { pictures, lost, triangles, torn: torn_share, points, occupied_cells } = made;
    if layout == SynthLayout::ScanNet {
        let report = ScanReport { folder, pictures, lost, triangles, torn_share };
        return session.console.result(&report, |report| {
            format!(
                "{}: {pictures} pictures, {lost} of them lost, {triangles} triangles, {:.1} % of the surface missing",
                escaped_path(report.folder),
                100.0 * torn_share
            )
        });
    }
    let report = Report { folder, pictures, triangles, points, occupied_cells };
    session.console.result(&report, |report| {
        format!(
            "{}: {pictures} pictures, {triangles} triangles, {points} points, {occupied_cells} occupied cells",
            escaped_path(report.folder)
        )
    })
}
