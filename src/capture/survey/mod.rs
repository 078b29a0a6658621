//! The survey of a capture: where its scene is, decided once from all that is known of it.
//!
//! In: [`Evidence`]: the cameras, the points that the dataset's files have, points matched between opaque photographs, and the
//! boxes and ranges in the files. Out: a [`Survey`], from which the range of rays, the scene's box, the inner box of an unbounded
//! scene and the prior follow, and a [`Remark`] on each part of the evidence that contradicts the rest. Everything goes by
//! medians and quantiles: no single point, camera or pixel decides.

mod footprint;
mod kind;
mod telling;

pub use kind::{Classified, Kind};
pub use telling::{Given, Line};

use std::borrow::Cow;
use std::path::Path;

use glam::DVec3;

use crate::prior::{
    BuildError, CameraBounds, CameraStatistics, SPARSE_OUTLIERS, VoxelBoxes, box_of_places, cells_around, central_box,
    is_open, open_share, points_in, quantile, ray_range, ray_range_of_surroundings, tracked_places, with_margin,
};
use strivec_format::digits::plural;
use strivec_format::geometry::{Aabb, Camera};

/// The share of one part of the evidence that must lie where another has the scene.
const AGREEING: f64 = 0.2;
/// How many times longer than the inner box the box of what photographs show is in an unbounded scene.
const WIDE: f64 = 3.0;
/// The share of the photographs' pixels with a known distance below which what the others show may be anywhere.
const ENOUGH_KNOWN: f64 = 0.5;
/// The share of the pixels with a known distance of a median photograph from which on photographs match, and the part of it below
/// which a photograph matches hardly any other.
const MATCHING: f64 = 0.1;
const UNMATCHED: f64 = 0.1;
/// The margin around the points' box, as a share of its size: surfaces without texture have no points.
const POINTS_MARGIN: f64 = 0.1;
/// The central shares, along each axis, of what photographs show and of the cameras that an inner box holds.
const INNER_SURFACES: f64 = 0.5;
const INNER_CAMERAS: f64 = 0.9;

/// All that is known of where a scene is, in the dataset's space.
#[derive(Clone, Copy, Debug, Default)]
pub struct Evidence<'a> {
    /// The cameras, at least one.
    pub cameras: &'a [Camera],
    /// The file of points on the scene's surfaces.
    pub points: Option<&'a Path>,
    /// The scene's box in the dataset's files.
    pub bounds: Option<Aabb>,
    /// The range of distances from the cameras in the dataset's files.
    pub range: Option<[f64; 2]>,
    /// Places that photographs show at known distances ([`prior::shown`](crate::prior::shown)).
    pub shown: &'a [DVec3],
    /// \[camera\] the share of the photograph's pixels with a known distance ([`prior::known_shares`](crate::prior::known_shares)).
    pub known_shares: &'a [Option<f64>],
    /// Points that were matched between the photographs, some at distances that these do not resolve.
    pub matched: &'a [DVec3],
    /// Nothing shows through the photographs: they have a background.
    pub is_opaque: bool,
    /// The background is of one color ([`dataset::has_plain_background`](crate::dataset::has_plain_background)).
    pub is_plain: bool,
}

/// Where a scene is, in the dataset's space.
#[derive(Clone, Debug, PartialEq)]
pub struct Survey {
    /// How the cameras stand to the scene.
    pub kind: Classified,
    /// The evidence that the range of rays follows.
    pub basis: Basis,
    /// The distances at which rays begin and end.
    pub near_far: [f64; 2],
    /// The scene's box; `None` if only the cameras bound it.
    pub bounds: Option<Aabb>,
    /// The inner box of the scene if it is unbounded.
    pub inner_box: Aabb,
    /// Much of what photographs show is so far away, or behind all that is known, that the scene is better unbounded.
    pub is_wide: bool,
    /// The share of the photographs' pixels whose distance is known; `None` if hardly any is.
    pub known_share: Option<f64>,
    /// The share of the photographs' rays that meet nothing of what is known; `None` if hardly any distance is known.
    pub open_share: Option<f64>,
    /// How many times longer than the inner box the box of nearly all that photographs show is; `None` if it is not known.
    pub width: Option<f64>,
    /// The width of a pixel at what photographs show, in the dataset's units: of the tenth of it that is nearest, of half of
    /// it, of nine tenths; `None` if it is not known.
    pub footprints: Option<[f64; 3]>,
    /// The cells that hold the dataset's points, without outliers.
    pub points: Option<VoxelBoxes>,
    /// The cells that hold all of them.
    pub all_points: Option<VoxelBoxes>,
    /// Points on the surfaces that photographs show, the dataset's and matched ones, but for those far outside of all others;
    /// empty if there are too few matched ones.
    pub surfaces: Vec<DVec3>,
    /// The parts of the evidence that contradict the rest and are not used.
    pub remarks: Vec<Remark>,
}

impl Survey {
    /// True if what pixels without a known distance show may be far away: most pixels have none, or many rays pass all that is
    /// known.
    pub fn unknown_may_be_far(&self) -> bool {
        self.known_share.is_some_and(|share| share < ENOUGH_KNOWN) || is_open(self.open_share)
    }

    /// Puts the names of photographs into the remarks: `of` has that of the camera of a number.
    pub fn name_cameras<'a>(&mut self, of: impl Fn(usize) -> &'a str) {
        for remark in &mut self.remarks {
            if let Remark::OddCameras { numbers, name, .. } | Remark::Unmatched { numbers, name } = remark {
                *name = Some(of(numbers[0]).into());
            }
        }
    }
}

/// The part of the evidence by which a scene has its place.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Basis {
    /// Distances of the photographs' pixels, by matching or by depth maps.
    Distances,
    /// The dataset's points.
    Points,
    /// A range or a box in the dataset's files.
    Files,
    /// The cameras alone.
    Cameras,
}

impl Basis {
    /// The part in a word.
    pub fn name(self) -> &'static str {
        match self {
            Self::Distances => "distances",
            Self::Points => "points",
            Self::Files => "files",
            Self::Cameras => "cameras",
        }
    }
}

/// A part of the evidence that contradicts the rest.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Remark {
    /// Cameras that are far from all others; they are trained on, but do not count for where the scene is.
    #[error(
        "camera {}{} stands {times:.0} times as far from the others as these from each other{}", numbers[0], in_brackets(name),
        others(numbers)
    )]
    OddCameras {
        /// Their numbers, from 0.
        numbers: Vec<usize>,
        /// The photograph of the first, if it is known.
        name: Option<String>,
        /// How many times the first is farther from the middle than half of them.
        times: f64,
    },
    /// Photographs that hardly match any other; they are trained on.
    #[error(
        "photograph {}{} shows hardly anything that others show at the same place{}: the pose may be wrong", numbers[0],
        in_brackets(name), others(numbers)
    )]
    Unmatched {
        /// Their numbers, from 0.
        numbers: Vec<usize>,
        /// The path of the first, if it is known.
        name: Option<String>,
    },
    /// No camera sees the points, or photographs show the scene elsewhere.
    #[error("{what} the points of {file}, which are not used")]
    Points {
        /// The beginning of the message: who sees nothing there.
        what: &'static str,
        /// The file.
        file: String,
    },
    /// Photographs show the scene outside the box.
    #[error(
        "the dataset's box, {min:.3} to {max:.3}, holds {share:.0} % of what photographs show and is not used (of transforms.json, \
         the key is aabb_scale)", min = bounds.min, max = bounds.max, share = 100.0 * share
    )]
    Bounds {
        /// The box.
        bounds: Aabb,
        /// The share of the points in it.
        share: f64,
    },
}

/// Cameras from which no scene follows.
#[derive(Debug, thiserror::Error)]
pub enum SurveyError {
    /// The file of points cannot be read.
    #[error(transparent)]
    Points(#[from] BuildError),
    /// All cameras are at one place.
    #[error(
        "the {count} cameras are all at {place:.3}, and photographs from one place show no depth; poses that are inverted \
         (world to camera instead of camera to world) look like this, too"
    )]
    OnePlace {
        /// The number of cameras.
        count: usize,
        /// Their place.
        place: DVec3,
    },
}

fn in_brackets(name: &Option<String>) -> String {
    name.as_ref().map_or_else(String::new, |name| format!(" ({name})"))
}

fn others(numbers: &[usize]) -> String {
    match numbers.len() - 1 {
        0 => String::new(),
        count => format!(", and so {} {}", if count == 1 { "does" } else { "do" }, plural(count, "other")),
    }
}

/// The place of the scene of which `evidence` tells, by the first that is known: points that were matched between its
/// photographs, the dataset's points, the range in its files, its box if photographs are opaque, the cameras alone.
///
/// # Errors
///
/// If all cameras are at one place, or the file of points cannot be read. A file whose points have no extent counts as none.
pub fn survey(evidence: &Evidence<'_>) -> Result<Survey, SurveyError> {
    let Evidence { cameras, is_opaque, .. } = *evidence;
    let statistics = CameraStatistics::of(cameras);
    if statistics.one_place {
        return Err(SurveyError::OnePlace { count: cameras.len(), place: statistics.middle });
    }
    let numbers: Vec<usize> = (0..cameras.len()).filter(|&n| statistics.odd[n]).collect();
    let first = numbers.first().map(|&n| statistics.times(cameras, n));
    let mut remarks: Vec<Remark> =
        first.map(|times| Remark::OddCameras { numbers, name: None, times }).into_iter().collect();
    remarks.extend(unmatched(evidence.known_shares).map(|numbers| Remark::Unmatched { numbers, name: None }));
    let usual: Vec<Camera> = statistics.usual(cameras).copied().collect();
    let places = evidence.shown;
    let shown = box_of_places(places);
    let [points, all_points] = points_of(evidence, &usual, shown.as_ref(), &mut remarks)?;
    let bounds = evidence.bounds.filter(|bounds| {
        let share = match (&shown, &points) {
            (Some(_), _) => share_in(bounds, places.iter().copied()),
            (None, Some(points)) => share_in(bounds, points.boxes().map(|cell| cell.center())),
            (None, None) => 1.0,
        };
        if share < AGREEING {
            remarks.push(Remark::Bounds { bounds: *bounds, share });
        }
        share >= AGREEING
    });
    let by_cameras = || match is_opaque {
        true => ray_range_of_surroundings(&usual, bounds.as_ref()),
        false => ray_range(&usual, None),
    };
    // Without distances, the dataset's points are what photographs show.
    let places: Cow<'_, [DVec3]> = match (&shown, evidence.points.filter(|_| points.is_some())) {
        (None, Some(file)) => tracked_places(file)?.into(),
        _ => places.into(),
    };
    let inner_box = inner_box(&statistics, cameras, &places);
    let width = shown
        .or_else(|| box_of_places(&places))
        .map(|shown| shown.size().max_element() / inner_box.size().max_element());
    let known_share = shown.map(|_| mean(evidence.known_shares.iter().flatten()));
    let within = shown.as_ref().map(with_margin);
    let open_share = open_share(&usual, evidence.shown);
    let is_wide = is_opaque && (width.is_some_and(|times| times > WIDE) || is_open(open_share));
    let surfaces = within.map_or_else(Vec::new, |within| {
        let centers = points.iter().flat_map(VoxelBoxes::boxes).map(|cell| cell.center());
        evidence
            .shown
            .iter()
            .chain(evidence.matched)
            .copied()
            .chain(centers)
            .filter(|&at| is_wide || within.contains(at))
            .collect()
    });
    let surface_cells = cells_around(&surfaces);
    let (near_far, basis) = match (&surface_cells, &points, evidence.range) {
        (Some(cells), ..) => (ray_range(&usual, Some(cells)), Basis::Distances),
        (None, Some(cells), _) => (ray_range(&usual, Some(cells)), Basis::Points),
        (None, None, Some(range)) => (range, Basis::Files),
        (None, None, None) => (by_cameras(), if is_opaque && bounds.is_some() { Basis::Files } else { Basis::Cameras }),
    };
    let around = |cells: &VoxelBoxes| {
        let bounds = cells.bounds();
        bounds.grown(POINTS_MARGIN * bounds.size())
    };
    let known = [points.as_ref().map(around), shown].into_iter().flatten().reduce(|a, b| a.union(&b));
    Ok(Survey {
        kind: Classified::of(&usual, is_opaque, evidence.is_plain, is_wide),
        basis,
        near_far,
        bounds: bounds.or(known),
        inner_box,
        is_wide,
        known_share,
        open_share,
        width,
        footprints: footprint::footprints(&usual, &places),
        points,
        all_points,
        surfaces,
        remarks,
    })
}

/// The cells of the dataset's points without outliers and of all of them, unless no camera sees them, or photographs show the
/// scene elsewhere.
fn points_of(
    evidence: &Evidence<'_>,
    cameras: &[Camera],
    shown: Option<&Aabb>,
    remarks: &mut Vec<Remark>,
) -> Result<[Option<VoxelBoxes>; 2], SurveyError> {
    let Some(file) = evidence.points else { return Ok([None, None]) };
    let [points, all] = [points_in(file, Some(SPARSE_OUTLIERS))?, points_in(file, None)?];
    let Some(cells) = &points else { return Ok([points, all]) };
    let centers = || cells.boxes().map(|cell| cell.center());
    let is_seen = |at: &DVec3| cameras.iter().any(|c| c.project(*at).is_some_and(|pixel| c.is_inside(pixel)));
    let seen = centers().filter(is_seen).count() as f64;
    let what = if seen < AGREEING * cells.cells.len() as f64 {
        "no camera sees"
    } else if shown.is_some_and(|shown| share_in(&shown.grown(shown.size()), centers()) < AGREEING) {
        "the photographs do not show the scene at"
    } else {
        return Ok([points, all]);
    };
    remarks.push(Remark::Points { what, file: file.display().to_string() });
    Ok([None, None])
}

/// The inner box of an unbounded scene: it holds half of what photographs show, by its area in them, and most cameras.
fn inner_box(statistics: &CameraStatistics, cameras: &[Camera], shown: &[DVec3]) -> Aabb {
    let of_cameras = statistics.central_box(cameras, INNER_CAMERAS);
    if shown.is_empty() {
        let CameraBounds { focus, near, .. } = CameraBounds::from_cameras(cameras.iter());
        return of_cameras.union(&Aabb::around(focus, DVec3::splat(near)));
    }
    of_cameras.union(&central_box(shown, INNER_SURFACES))
}

/// The numbers of the photographs that hardly match any other, where most match well; `None` if all do.
fn unmatched(known_shares: &[Option<f64>]) -> Option<Vec<usize>> {
    let median = quantile(known_shares.iter().flatten().copied().collect(), 0.5);
    let is_unmatched = |share: f64| median >= MATCHING && share < UNMATCHED * median;
    let numbers: Vec<usize> = (0..known_shares.len()).filter(|&n| known_shares[n].is_some_and(is_unmatched)).collect();
    (!numbers.is_empty()).then_some(numbers)
}

fn mean<'a>(values: impl Iterator<Item = &'a f64> + Clone) -> f64 {
    values.clone().sum::<f64>() / values.count().max(1) as f64
}

/// The share of `points` in `bounds`.
fn share_in(bounds: &Aabb, points: impl Iterator<Item = DVec3>) -> f64 {
    let [mut all, mut inside] = [0.0, 0.0];
    for point in points {
        all += 1.0;
        inside += f64::from(u8::from(bounds.contains(point)));
    }
    inside / f64::max(all, 1.0)
}

#[cfg(test)]
mod tests {
    use std::fs;
    use std::path::PathBuf;

    use super::*;

    /// Places that leave no holes between their cells.
    const MANY: usize = 100_000;

    /// Cameras around a sphere of radius 1, which fills their pictures.
    fn cameras() -> Vec<Camera> {
        (0..8)
            .map(|n| {
                let at = 4.0 * DVec3::new(f64::from(n).cos(), f64::from(n).sin(), 0.3);
                Camera::looking_at([64, 64], 200.0, at, DVec3::ZERO, DVec3::Z)
            })
            .collect()
    }

    fn opaque(cameras: &[Camera]) -> Evidence<'_> {
        Evidence { cameras, is_opaque: true, ..Evidence::default() }
    }

    /// A file of a grid of `edge`³ points, 0.8 wide, around `middle`.
    fn points_file(folder: &tempfile::TempDir, edge: u32, middle: DVec3) -> PathBuf {
        let file = folder.path().join("points.xyz");
        let line = |n: u32| {
            let step = |n: u32| 0.8 * f64::from(n % edge) / f64::from(edge - 1) - 0.4;
            let at = middle + DVec3::new(step(n), step(n / edge), step(n / edge / edge));
            format!("{} {} {}", at.x, at.y, at.z)
        };
        fs::write(&file, (0..edge * edge * edge).map(line).collect::<Vec<_>>().join("\n")).unwrap();
        file
    }

    /// Places spread evenly over the sphere of this radius (a spiral by the golden angle).
    fn places(count: usize, radius: f64) -> Vec<DVec3> {
        let of = |n: f64| {
            let (z, turn) = (1.0 - (2.0 * n + 1.0) / count as f64, 2.399_963 * n);
            let across = (1.0 - z * z).sqrt();
            radius * DVec3::new(across * turn.cos(), across * turn.sin(), z)
        };
        (0..count).map(|n| of(n as f64)).collect()
    }

    #[test]
    fn points_precede_the_box_and_the_box_precedes_the_cameras() {
        let folder = tempfile::tempdir().unwrap();
        let (cameras, file) = (cameras(), points_file(&folder, 5, DVec3::ZERO));
        let bounds = Aabb::around(DVec3::ZERO, DVec3::ONE);
        let of = |points: Option<&Path>, bounds, range, is_opaque| {
            survey(&Evidence { cameras: &cameras, points, bounds, range, is_opaque, ..Evidence::default() }).unwrap()
        };

        let by_points = of(Some(&file), None, None, true);
        let [near, far] = by_points.near_far;
        assert!(near > 3.0 && near < 3.6 && far < 5.5, "{near} to {far}");
        let size = by_points.bounds.unwrap().size();
        assert!(size.min_element() > 0.8 && size.max_element() < 1.3, "{size}");
        assert_eq!(of(Some(&file), Some(bounds), None, true).bounds, Some(bounds));
        assert_eq!(of(Some(&file), None, Some([1.0, 9.0]), true).near_far, by_points.near_far);

        assert_eq!(of(None, None, Some([1.0, 9.0]), true).near_far, [1.0, 9.0]);
        let surroundings = |bounds| ray_range_of_surroundings(&cameras, bounds);
        assert_eq!(of(None, Some(bounds), None, true).near_far, surroundings(Some(&bounds)));
        assert_eq!(of(None, Some(bounds), None, false).near_far, ray_range(&cameras, None));
        assert_eq!(of(None, None, None, true).near_far, surroundings(None));

        // Points in one place have no extent.
        fs::write(&file, "1 1 1\n1 1 1\n").unwrap();
        let none = of(Some(&file), None, None, false);
        assert_eq!((none.near_far, none.bounds, none.points), (ray_range(&cameras, None), None, None));
    }

    #[test]
    fn evidence_that_contradicts_what_photographs_show_is_named_and_not_used() {
        let folder = tempfile::tempdir().unwrap();
        let (cameras, places) = (cameras(), places(MANY, 1.0));
        let shown = |points, bounds| {
            let evidence =
                Evidence { points, bounds, shown: &places, known_shares: &[Some(0.8); 8], ..opaque(&cameras) };
            survey(&evidence).unwrap()
        };
        let clean = shown(None, None);
        assert!(clean.remarks.is_empty() && !clean.is_wide && clean.surfaces.len() == MANY);
        assert!(clean.near_far[0] > 2.0 && clean.near_far[1] < 6.5, "{:?}", clean.near_far);

        let file = points_file(&folder, 5, DVec3::new(0.0, 9.0, 0.0));
        let elsewhere = shown(Some(&file), None);
        assert!(elsewhere.remarks[0].to_string().contains("points.xyz, which are not used"), "{:?}", elsewhere.remarks);
        assert_eq!((elsewhere.near_far, elsewhere.points), (clean.near_far, None));

        let small = shown(None, Some(Aabb::around(DVec3::ZERO, DVec3::splat(0.1))));
        assert!(small.remarks[0].to_string().contains("aabb_scale"), "{:?}", small.remarks);
        assert_eq!((small.near_far, small.bounds), (clean.near_far, clean.bounds));
        let right = Aabb::around(DVec3::ZERO, DVec3::splat(1.5));
        assert_eq!(shown(None, Some(right)).bounds, Some(right));
    }

    #[test]
    fn points_that_no_camera_sees_are_not_used() {
        let folder = tempfile::tempdir().unwrap();
        let file = points_file(&folder, 5, DVec3::new(0.0, 0.0, 50.0));
        let evidence = Evidence { cameras: &cameras(), points: Some(&file), is_opaque: true, ..Evidence::default() };
        let found = survey(&evidence).unwrap();
        assert!(found.remarks[0].to_string().starts_with("no camera sees"), "{:?}", found.remarks);
        assert_eq!((found.points, found.bounds), (None, None));
    }

    #[test]
    fn a_few_points_begin_the_range_before_the_nearest_of_them() {
        let folder = tempfile::tempdir().unwrap();
        let file = points_file(&folder, 3, DVec3::ZERO);
        let evidence = Evidence { cameras: &cameras(), points: Some(&file), is_opaque: true, ..Evidence::default() };
        let [near, _] = survey(&evidence).unwrap().near_far;
        let nearest = 4.0 * 1.09_f64.sqrt() - 0.4 * 3.0_f64.sqrt();
        assert!(near < nearest + 0.1 && near > 2.5, "{near}, the nearest corner may be at {nearest}");
    }

    #[test]
    fn one_camera_far_away_is_named_and_changes_nothing() {
        let mut spoiled = cameras();
        let of = |cameras: &[Camera]| survey(&Evidence { cameras, is_opaque: true, ..Evidence::default() }).unwrap();
        let clean = of(&spoiled);
        spoiled.push(Camera { position: DVec3::new(8000.0, 0.0, 0.0), ..spoiled[0] });
        let found = of(&spoiled);
        assert_eq!((found.near_far, found.inner_box), (clean.near_far, clean.inner_box));
        assert!(found.remarks[0].to_string().starts_with("camera 8 stands"), "{:?}", found.remarks);
    }

    #[test]
    fn photographs_that_match_no_other_are_named_where_most_match() {
        let cameras = cameras();
        let places = places(2000, 1.0);
        let of = |shares: [Option<f64>; 8]| {
            survey(&Evidence { shown: &places, known_shares: &shares, ..opaque(&cameras) }).unwrap()
        };
        let mut found = of([0.5, 0.6, 0.04, 0.7, 0.8, 0.0, 0.2, 0.6].map(Some));
        found.name_cameras(|n| ["a", "b", "c.jpg"][n]);
        assert_eq!(
            found.remarks[0].to_string(),
            "photograph 2 (c.jpg) shows hardly anything that others show at the same place, and so does 1 other: the pose may be wrong"
        );
        assert!((found.known_share.unwrap() - 0.43).abs() < 1e-9);
        assert!(
            of([Some(0.5), Some(0.6), None, Some(0.7), None, None, None, None]).remarks.is_empty(),
            "not looked at"
        );
        assert!(
            of([0.05, 0.06, 0.0, 0.07, 0.08, 0.0, 0.02, 0.06].map(Some)).remarks.is_empty(),
            "surfaces without texture"
        );
    }

    #[test]
    fn cameras_at_one_place_are_refused() {
        let mut cameras = cameras();
        cameras.iter_mut().for_each(|camera| camera.position = DVec3::ONE);
        let error = survey(&Evidence { cameras: &cameras, ..Evidence::default() }).unwrap_err().to_string();
        assert!(
            error.contains("the 8 cameras are all at [1.000, 1.000, 1.000]") && error.contains("inverted"),
            "{error}"
        );
    }

    #[test]
    fn much_that_is_far_makes_a_scene_unbounded_and_a_little_does_not() {
        let cameras = cameras();
        let of = |far: usize| {
            let shown: Vec<DVec3> = places(MANY, 1.0).into_iter().chain(places(far, 60.0)).collect();
            survey(&Evidence { shown: &shown, known_shares: &[Some(0.8); 8], ..opaque(&cameras) }).unwrap()
        };
        let (few, much) = (of(MANY / 130), of(3 * MANY / 10));
        assert!(!few.is_wide && much.is_wide);
        assert!(few.bounds.unwrap().size().max_element() < 3.0, "{:?}", few.bounds);
        assert_eq!(few.surfaces.len(), MANY, "those far outside are not in the prior");
        assert!(much.inner_box.size().max_element() < 9.0, "{:?}", much.inner_box);
        assert_eq!(much.surfaces.len(), MANY + 3 * MANY / 10);
    }

    #[test]
    fn a_scene_is_unbounded_if_many_rays_pass_all_that_is_known() {
        let cameras = cameras();
        let of = |radius: f64| survey(&Evidence { shown: &places(MANY, radius), ..opaque(&cameras) }).unwrap();
        let (whole, partial) = (of(1.0), of(0.6));
        assert!(whole.open_share.unwrap() < 0.05 && !whole.is_wide, "{:?}", whole.open_share);
        assert!(partial.open_share.unwrap() > 0.2 && partial.is_wide, "{:?}", partial.open_share);
    }
}
