//! `strivec dataset info`.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use glam::DVec3;
use serde::Serialize;

use super::picture::FloorPlan;
use super::{Context, DatasetOptions, Error};
use crate::error::with_flags;
use crate::observer::ConsoleObserver;
use crate::table::{plural, short};
use crate::write_atomically;
use strivec_capture::dataset;
use strivec_capture::dataset::{
    CameraGroup, Description, InventoryEntry, LoadOptions, NamedCamera, Photograph, Standing,
};
use strivec_capture::prior;
use strivec_capture::prior::{CameraBounds, VoxelBoxes};
use strivec_capture::survey::{Evidence, Given, Remark, Survey, survey};
use strivec_format::escape::escaped_path;
use strivec_format::geometry::Camera;
use strivec_measure::color_png;
use strivec_recipe as recipe;
use strivec_recipe::Photographs;
use strivec_train::TrainConfig;

/// Photographs whose pixels are looked at without matching.
const SAMPLES: usize = 8;

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
    /// Match photographs, as training does: where the scene is by what they show, not by the dataset's points and cameras
    #[arg(long = "match")]
    matches: bool,
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
    /// The survey: the kind of the capture, and its place.
    survey: SurveyFacts,
    /// What of the folder is used, what is not, and what is named but not there.
    inventory: Vec<InventoryRow<'a>>,
    #[serde(skip)]
    groups: Vec<CameraGroup>,
    /// The lines of the survey and of the inventory, with their labels.
    #[serde(skip)]
    lines: Vec<(&'static str, String)>,
}

#[derive(Serialize)]
struct SurveyFacts {
    kind: &'static str,
    /// The share of the cameras that look at one point.
    at_one_thing: f64,
    /// The evidence that the range of rays follows: `distances`, `points`, `files` or `cameras`.
    basis: &'static str,
    unbounded: bool,
    inner_box: [[f64; 3]; 2],
    /// The width of a pixel at the nearest tenth, the half and nine tenths of what photographs show.
    footprints: Option<[f64; 3]>,
    doubtful: Vec<String>,
}

impl SurveyFacts {
    fn of(survey: &Survey) -> Self {
        Self {
            kind: survey.kind.kind.name(),
            at_one_thing: survey.kind.at_one_thing,
            basis: survey.basis.name(),
            unbounded: survey.is_wide,
            inner_box: [survey.inner_box.min, survey.inner_box.max].map(|corner| corner.to_array()),
            footprints: survey.footprints,
            doubtful: survey.remarks.iter().map(ToString::to_string).collect(),
        }
    }
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
    let named: Vec<&NamedCamera> = splits.iter().flat_map(|(_, named)| named).collect();
    let cameras: Vec<Camera> = named.iter().map(|named| named.camera).collect();
    let location = if args.matches {
        matched(args, session)?
    } else {
        let samples = samples(args, named.len());
        let mut found = survey(&Evidence {
            cameras: &cameras,
            points: points.as_deref(),
            bounds: *bounds,
            range: *range,
            is_opaque: !samples.is_empty() && dataset::are_opaque(&samples),
            is_plain: dataset::has_plain_background(&samples),
            ..Evidence::default()
        })?;
        found.name_cameras(|n| &named[n].path);
        found
    };
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
        survey: SurveyFacts::of(&location),
        inventory: inventory.entries.iter().map(InventoryRow::of).collect(),
        groups: dataset::group_cameras(&cameras),
        lines: [lines(location.clone()), inventory.lines()].concat(),
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

/// The survey of the photographs that training begins with.
fn matched(args: &Args, session: &Context) -> Result<Survey, Error> {
    let interrupted = session.interrupts()?;
    let mut observer = ConsoleObserver::new(&session.console, &interrupted);
    let photographs = Photographs { options: args.options.load_options(1), downscale: None };
    let options = photographs.load_options(&args.dataset, None, &mut observer)?;
    let mut dataset = recipe::load(&args.dataset, &options, &mut observer)?;
    Ok(recipe::survey_photographs(&TrainConfig::default(), &mut dataset, &mut observer)?)
}

/// A few of `count` photographs, evenly spread; none if they cannot be read.
fn samples(args: &Args, count: usize) -> Vec<Photograph> {
    let options = LoadOptions { every: count.div_ceil(SAMPLES).max(1), ..args.options.load_options(1) };
    dataset::load(&args.dataset, "train", &options).map_or_else(|_| Vec::new(), |dataset| dataset.views)
}

/// The lines of a survey with their labels, without a remark on points, which the inventory has.
fn lines(mut survey: Survey) -> Vec<(&'static str, String)> {
    survey.remarks.retain(|remark| !matches!(remark, Remark::Points { .. }));
    let lines = survey.lines(Given::default()).into_iter();
    lines.map(|(label, line)| (label, with_flags(&line))).collect()
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
    lines.extend(info.lines.iter().map(|(label, line)| format!("{label:<14}{line}")));
    lines.join("\n") + "\n"
}
