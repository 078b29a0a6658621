//! `strivec dataset info`.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use glam::DVec3;
use serde::Serialize;

use super::picture::FloorPlan;
use super::{Context, DatasetOptions, Error};
use crate::table::{plural, short};
use crate::write_atomically;
use strivec_capture::dataset;
use strivec_capture::dataset::{CameraGroup, Description, InventoryEntry, LoadOptions, NamedCamera, Standing};
use strivec_capture::prior;
use strivec_capture::prior::{CameraBounds, VoxelBoxes};
use strivec_capture::survey::{Evidence, Remark, survey};
use strivec_format::escape::escaped_path;
use strivec_format::geometry::Camera;
use strivec_measure::color_png;

const EXAMPLES: &str = "\
Examples:
  strivec dataset info capture
  strivec dataset info capture --picture cameras.png
  strivec dataset info scene --layout colmap --json";

/// The arguments.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct Args {
    /// Dataset folder
    dataset: PathBuf,
    /// Picture of the cameras, their rays, the points and the box to write, from above and from the side
    #[arg(long, value_name = "PNG")]
    picture: Option<PathBuf>,
    #[command(flatten)]
    options: DatasetOptions,
}

/// The result, as `--json` prints it.
#[derive(Serialize)]
struct Info<'a> {
    name: &'a str,
    layout: &'static str,
    splits: Vec<SplitFacts<'a>>,
    /// Kinds of cameras, those of the most photographs first.
    cameras: Vec<Kind>,
    masks: usize,
    /// Frames without a pose.
    lost: usize,
    /// Photographs whose pictures do not exist.
    missing: &'a [PathBuf],
    points: Option<PointFacts<'a>>,
    /// The box of the dataset's files: the smallest and the largest corner.
    bounds: Option<[[f64; 3]; 2]>,
    /// The point nearest to all optical axes, and the distances of the cameras to it: smallest, mean, largest.
    focus: [f64; 3],
    focus_distances: [f64; 3],
    /// The distances at which rays begin and end.
    near_far: [f64; 2],
    /// What of the folder is used, what is not, and what is named but not there.
    inventory: Vec<InventoryRow<'a>>,
    #[serde(skip)]
    groups: Vec<CameraGroup>,
    /// The inventory's lines for people, with their labels.
    #[serde(skip)]
    told: Vec<(&'static str, String)>,
}

#[derive(Serialize)]
struct InventoryRow<'a> {
    /// `used`, `unused`, `absent` or `doubtful`.
    standing: &'static str,
    path: &'a str,
    count: usize,
    what: &'a str,
}

#[derive(Serialize)]
struct SplitFacts<'a> {
    name: &'static str,
    photographs: usize,
    #[serde(skip)]
    cameras: &'a [NamedCamera],
}

#[derive(Serialize)]
struct Kind {
    photographs: usize,
    /// Columns and rows.
    size: [u32; 2],
    lens: String,
    /// Focal lengths along columns and rows, in pixels.
    focal: [f64; 2],
    /// Horizontal and vertical, in degrees; `None` if the lens does not see the picture's edges.
    angles: Option<[f64; 2]>,
}

#[derive(Serialize)]
struct PointFacts<'a> {
    file: &'a Path,
    /// The points' box without outliers.
    bounds: [[f64; 3]; 2],
}

impl<'a> InventoryRow<'a> {
    fn of(entry: &'a InventoryEntry) -> Self {
        let InventoryEntry { standing, path, count, what } = entry;
        Self { standing: standing.name(), path, count: *count, what }
    }
}

/// Prints what the dataset is, and draws it.
pub(super) fn run(args: &Args, session: &Context) -> Result<(), Error> {
    let description = dataset::describe(&args.dataset, &args.options.load_options(1))?;
    let Description { name, layout, splits, masks, lost, missing, points, bounds, range, inventory } = &description;
    let cameras: Vec<Camera> = splits.iter().flat_map(|(_, named)| named.iter().map(|n| n.camera)).collect();
    let is_opaque = is_opaque(args);
    let evidence = Evidence {
        cameras: &cameras,
        points: points.as_deref(),
        bounds: *bounds,
        range: *range,
        shown: &[],
        matched: &[],
        is_opaque,
    };
    let location = survey(&evidence)?;
    let focus = CameraBounds::from_cameras(cameras.iter()).focus;
    let distances = cameras.iter().map(|camera| camera.position.distance(focus));
    let mean = distances.clone().sum::<f64>() / cameras.len() as f64;
    let corners = |bounds: &strivec_format::geometry::Aabb| [bounds.min, bounds.max].map(|corner| corner.to_array());
    let mut inventory = inventory.clone();
    if let Some(file) = points.as_deref().filter(|_| location.points.is_none()) {
        let path = file.strip_prefix(&args.dataset).unwrap_or(file).to_string_lossy().into_owned();
        let said = location.remarks.iter().find(|remark| matches!(remark, Remark::Points { .. }));
        let what = said.map_or_else(|| "its points have no extent".into(), ToString::to_string);
        let entry = InventoryEntry { standing: Standing::Unused, path, count: 1, what };
        inventory.entries.retain(|other| other.standing != Standing::Used || other.path != entry.path);
        inventory.entries.insert(0, entry);
    }
    let left_out = points.as_deref().and_then(|file| prior::points_left_out(&args.dataset, file));
    drop(inventory.entries.splice(..0, left_out));
    for remark in location.remarks.iter().filter(|remark| !matches!(remark, Remark::Points { .. })) {
        let entry =
            InventoryEntry { standing: Standing::Doubtful, path: ".".into(), count: 1, what: remark.to_string() };
        inventory.entries.push(entry);
    }
    let info = Info {
        name,
        layout: layout.name(),
        splits: (splits.iter())
            .map(|(name, cameras)| SplitFacts { name, photographs: cameras.len(), cameras })
            .collect(),
        cameras: kinds(&cameras),
        masks: *masks,
        lost: *lost,
        missing,
        points: (points.as_ref().zip(location.points.as_ref()))
            .map(|(file, cells)| PointFacts { file, bounds: corners(&cells.bounds()) }),
        bounds: bounds.as_ref().map(corners),
        focus: focus.to_array(),
        focus_distances: [distances.clone().fold(f64::INFINITY, f64::min), mean, distances.fold(0.0, f64::max)],
        near_far: location.near_far,
        inventory: inventory.entries.iter().map(InventoryRow::of).collect(),
        groups: dataset::group_cameras(&cameras),
        told: inventory.lines(),
    };
    if let Some(path) = &args.picture {
        let points = location.points.iter().flat_map(VoxelBoxes::boxes).map(|cell| cell.center()).collect();
        let plan = FloorPlan {
            splits: &info.splits.iter().map(|s| (s.name, s.cameras)).collect::<Vec<_>>(),
            points,
            bounds: *bounds,
            focus,
            near_far: location.near_far,
        };
        let (size, colors) = plan.draw()?;
        write_atomically(path, &color_png(size, &colors)?, session.force)?;
    }
    session.console.result(&info, text)
}

/// True if the first photograph has a background; false if it cannot be read.
fn is_opaque(args: &Args) -> bool {
    let first = LoadOptions { views: Some(0..1), ..args.options.load_options(1) };
    dataset::load(&args.dataset, "train", &first).is_ok_and(|dataset| dataset::are_opaque(&dataset.views))
}

/// Cameras of the same size, lens and focal lengths are of one kind.
fn kinds(cameras: &[Camera]) -> Vec<Kind> {
    let mut kinds: BTreeMap<_, (usize, &Camera)> = BTreeMap::new();
    for camera in cameras {
        let key = (camera.width, camera.height, camera.focal.map(f64::to_bits), camera.lens.name());
        kinds.entry(key).or_insert((0, camera)).0 += 1;
    }
    let mut kinds: Vec<Kind> = (kinds.into_values())
        .map(|(photographs, camera)| Kind {
            photographs,
            size: [camera.width, camera.height],
            lens: camera.lens.name(),
            focal: camera.focal,
            angles: angles(camera),
        })
        .collect();
    kinds.sort_by_key(|kind| std::cmp::Reverse(kind.photographs));
    kinds
}

/// The angles between the rays through the middles of opposite edges, in degrees.
fn angles(camera: &Camera) -> Option<[f64; 2]> {
    let [width, height] = [camera.width, camera.height].map(f64::from);
    let [x, y] = camera.principal;
    let through = |x: f64, y: f64| camera.ray_through(x, y).map(|ray| ray.direction);
    let ahead = -camera.world_from_camera.z_axis;
    let angle = |a: DVec3, b: DVec3| (a.angle_between(ahead) + b.angle_between(ahead)).to_degrees();
    Some([angle(through(0.0, y)?, through(width, y)?), angle(through(x, 0.0)?, through(x, height)?)])
}

fn text(info: &Info<'_>) -> String {
    // Digits below a ten-thousandth of the scene are noise.
    let unit = 10f64.powf((1e-4 * info.focus_distances[1]).log10().floor());
    let three = |v: &[f64; 3]| v.map(|v| short((v / unit).round() * unit)).join(" ");
    let splits: Vec<_> = info.splits.iter().map(|split| format!("{} {}", split.photographs, split.name)).collect();
    let mut lines = vec![
        format!(
            "{}: {} in the layout {}",
            info.name,
            plural(info.splits.iter().map(|s| s.photographs).sum(), "photograph"),
            info.layout
        ),
        format!("splits        {}", splits.join(", ")),
    ];
    for group in &info.groups {
        // The angles of view are those of all photographs of one camera.
        let kind = info.cameras.iter().find(|_| info.cameras.len() == 1);
        let angles = kind.and_then(|kind| kind.angles);
        let angles = angles.map_or_else(String::new, |[x, y]| format!(", {x:.1} x {y:.1} degrees"));
        lines.push(format!("cameras       {group}{angles}"));
    }
    if info.masks > 0 {
        lines.push(format!("masks         {}", plural(info.masks, "photograph")));
    }
    if info.lost > 0 {
        lines.push(format!("without pose  {}", plural(info.lost, "frame")));
    }
    if let Some(PointFacts { file, bounds: [min, max] }) = &info.points {
        lines.push(format!("points        {}, in {} to {}", escaped_path(file), three(min), three(max)));
    }
    if let Some([min, max]) = &info.bounds {
        lines.push(format!("box           {} to {}", three(min), three(max)));
    }
    let [least, mean, most] = info.focus_distances.map(short);
    lines.push(format!("focus         {}, {least} to {most} from the cameras, mean {mean}", three(&info.focus)));
    let [near, far] = info.near_far.map(short);
    lines.push(format!("rays          from {near} to {far}"));
    lines.extend(info.told.iter().map(|(label, line)| format!("{label:<14}{line}")));
    lines.join("\n") + "\n"
}
