//! Bounds of the scene from the cameras: near and far distances, and the box of all frusta.

use std::iter::successors;
use std::ops::RangeInclusive;

use glam::DVec3;

use super::{CameraStatistics, VoxelBoxes};
use strivec_format::geometry::{Aabb, Camera, Ray, focus_of_axes};

/// Near and far as multiples of the mean distance between the cameras and the point they look at.
const NEAR_FAR: (f64, f64) = (0.5, 1.5);
/// Far as the same multiple if photographs show what is behind the thing that the cameras look at.
const FAR_OF_SURROUNDINGS: f64 = 2.5;
/// Sampled points of a frustum along columns and rows. Points at the distance far form a spherical cap, which its
/// corners alone do not bound.
const FRUSTUM_POINTS: u32 = 9;

/// The point that the cameras look at, and the range of distances along rays.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CameraBounds {
    /// The point nearest, in the least squares sense, to all optical axes.
    pub focus: DVec3,
    /// Distance at which rays begin, in dataset units.
    pub near: f64,
    /// Distance at which rays end, in dataset units.
    pub far: f64,
}

impl CameraBounds {
    /// Derives all three from the cameras (at least one): near and far are 0.5 and 1.5 of their mean distance to the
    /// focus. For NeRF-synthetic, whose cameras lie on a sphere, these are the usual 2 and 6.
    ///
    /// Parallel axes, a single camera, or cameras that look away from one another determine no focus in front of them.
    /// Then the focus lies on the mean axis: at the foot of the perpendicular from the origin if that is in front of
    /// the cameras, else ahead by the extent of the cameras, else 1 unit ahead.
    ///
    /// Cameras that are many times farther from the others than these from each other do not count.
    pub fn from_cameras<'a>(cameras: impl Iterator<Item = &'a Camera> + Clone) -> Self {
        let all: Vec<Camera> = cameras.copied().collect();
        let statistics = CameraStatistics::of(&all);
        let cameras = statistics.usual(&all);
        let count = cameras.clone().count().max(1) as f64;
        let axes = cameras.clone().map(|camera| Ray { origin: camera.position, direction: axis(camera) });
        let focus = focus_of_axes(axes).unwrap_or_else(|| focus_ahead(cameras.clone(), count));
        let distance = cameras.map(|c| c.position.distance(focus)).sum::<f64>() / count;
        Self { focus, near: NEAR_FAR.0 * distance, far: NEAR_FAR.1 * distance }
    }
}

/// The most cells, and cameras, whose distances are looked at; of more, some at equal steps.
const RANGE_CELLS: usize = 32_768;
const RANGE_CAMERAS: usize = 128;
/// The share of the distances above a range: single cells may be outliers.
const RANGE_OUTLIERS: f64 = 0.002;
/// The share of a picture that cells before a range fill, at most, and their share of what all cells in it fill; and the share of
/// the cameras of which that is more.
const RANGE_PICTURE: f64 = 0.01;
const RANGE_FILLED: f64 = 0.02;
const RANGE_PICTURES: f64 = 0.02;
/// The factor by which a range is wider than the distances of cells, besides a cell: tensors reach past the cells. It is a
/// factor because space before the cameras in which nothing is fills with floaters.
const RANGE_MARGIN: f64 = 1.1;

/// Distances at which rays begin and end, in dataset units. With `geometry`, which is in the cameras' space, the range
/// holds its cells as the cameras that have them in their pictures see them: it begins before what fills some part of a
/// picture, since few cells fill much of a picture that is taken close to them. Without, or if none is in a picture, it is
/// that of [`CameraBounds`].
pub fn ray_range(cameras: &[Camera], geometry: Option<&VoxelBoxes>) -> [f64; 2] {
    let CameraBounds { near, far, .. } = CameraBounds::from_cameras(cameras.iter());
    let Some(boxes) = geometry else { return [near, far] };
    let evenly = |count: usize, most: usize| (0..count).step_by(count.div_ceil(most).max(1));
    let places: Vec<DVec3> = evenly(boxes.cells.len(), RANGE_CELLS).map(|n| boxes.cell_box(n).center()).collect();
    // The side of a place as a cell of its own and of those that are left out for it.
    let side_squared =
        boxes.lattice.pitch.element_product().cbrt().powi(2) * boxes.cells.len() as f64 / places.len().max(1) as f64;
    let (mut begins, mut distances) = (Vec::new(), Vec::new());
    for camera in evenly(cameras.len(), RANGE_CAMERAS).map(|n| &cameras[n]) {
        let is_seen = |place: &&DVec3| camera.project(**place).is_some_and(|at| camera.is_inside(at));
        let mut seen: Vec<f64> = places.iter().filter(is_seen).map(|p| p.distance(camera.position)).collect();
        seen.sort_by(f64::total_cmp);
        let pixels = f64::from(camera.width) * f64::from(camera.height);
        let part = camera.focal[0] * camera.focal[1] * side_squared / pixels;
        let area = |distance: &f64| part / (distance * distance);
        // Few points fill little of any picture.
        let enough = RANGE_PICTURE.min(RANGE_FILLED * seen.iter().map(area).sum::<f64>());
        let mut filled = 0.0;
        let fills = |distance: &&f64| {
            filled += area(distance);
            filled >= enough
        };
        begins.extend(seen.iter().find(fills).or(seen.last()));
        distances.append(&mut seen);
    }
    let quantile = |values: &mut Vec<f64>, share: f64| {
        values.sort_by(f64::total_cmp);
        values.get((share * values.len().saturating_sub(1) as f64) as usize).copied()
    };
    let ends = [quantile(&mut begins, RANGE_PICTURES), quantile(&mut distances, 1.0 - RANGE_OUTLIERS)];
    let [Some(least), Some(most)] = ends else { return [near, far] };
    let cell = boxes.lattice.pitch.length();
    [(least / RANGE_MARGIN - cell).max(0.0), most * RANGE_MARGIN + cell]
}

/// Distances at which rays begin and end, in dataset units, for photographs with opaque backgrounds of which no geometry
/// is known. Rays end where they leave `bounds`, if the scene's box is known, else farther behind the focus than those
/// of [`CameraBounds`]: walls and ground that no ray reaches would be painted into the space before them.
pub(crate) fn ray_range_of_surroundings(cameras: &[Camera], bounds: Option<&Aabb>) -> [f64; 2] {
    let CameraBounds { near, far, .. } = CameraBounds::from_cameras(cameras.iter());
    let Some(bounds) = bounds else { return [near, far / NEAR_FAR.1 * FAR_OF_SURROUNDINGS] };
    let farthest = |camera: &Camera| (camera.position - bounds.min).abs().max((camera.position - bounds.max).abs());
    let far = cameras.iter().map(|camera| farthest(camera).length()).fold(0.0, f64::max);
    let outside = |camera: &Camera| camera.position.distance(camera.position.clamp(bounds.min, bounds.max));
    let nearest = cameras.iter().map(outside).fold(f64::INFINITY, f64::min);
    [if nearest > 0.0 { nearest } else { near.min(0.5 * far) }, far]
}

/// The share of the cameras that see the inner box, and its half edge, in distances of the cameras from what they look at.
const INNER_SEEN: f64 = 0.5;
const INNER_EDGE: RangeInclusive<f64> = 0.2..=1.0;
/// Factor between two half edges that are tried.
const INNER_STEP: f64 = 0.95;

/// The inner box of an unbounded scene, in dataset units. If cameras look at one thing, it is the largest cube around it
/// whose surface half of the cameras see, in the mean over its corners, edges and sides. Else, as in a room, it is the box
/// of the cameras and of the point that they look at.
pub fn inner_box(cameras: &[Camera]) -> Aabb {
    let CameraBounds { focus, near, .. } = CameraBounds::from_cameras(cameras.iter());
    let distance = near / NEAR_FAR.0;
    let places: Vec<DVec3> =
        (0..27).map(|n| DVec3::new(f64::from(n % 3), f64::from(n / 3 % 3), f64::from(n / 9)) - 1.0).collect();
    let seen = |half: f64| {
        let is_seen =
            |camera: &Camera, place: DVec3| camera.project(focus + half * place).is_some_and(|at| camera.is_inside(at));
        let count = cameras.iter().flat_map(|camera| places.iter().filter(|&&place| is_seen(camera, place))).count();
        count as f64 / (places.len() * cameras.len().max(1)) as f64
    };
    let halves = successors(Some(*INNER_EDGE.end()), |half| Some(half * INNER_STEP));
    let found = halves.take_while(|half| half >= INNER_EDGE.start()).find(|half| seen(half * distance) >= INNER_SEEN);
    if let Some(half) = found.filter(|_| distance.is_finite()) {
        return Aabb::around(focus, DVec3::splat(half * distance));
    }
    let seen = Aabb::from_points(cameras.iter().map(|camera| camera.position).chain([focus]));
    // A single camera, or one place of all, spans no box.
    seen.union(&Aabb::around(focus, DVec3::splat(near)))
}

/// The box of all frusta between `near` and `far`; [`Aabb::EMPTY`] without cameras.
pub fn frusta_box<'a>(cameras: impl Iterator<Item = &'a Camera>, near: f64, far: f64) -> Aabb {
    let steps = || (0..FRUSTUM_POINTS).map(|i| f64::from(i) / f64::from(FRUSTUM_POINTS - 1));
    Aabb::from_points(cameras.flat_map(|camera| {
        steps().flat_map(move |v| {
            steps()
                .filter_map(move |u| camera.ray_through(u * f64::from(camera.width), v * f64::from(camera.height)))
                .flat_map(move |ray| [ray.at(near), ray.at(far)])
        })
    }))
}

fn axis(camera: &Camera) -> DVec3 {
    -camera.world_from_camera.z_axis
}

fn focus_ahead<'a>(cameras: impl Iterator<Item = &'a Camera> + Clone, count: f64) -> DVec3 {
    let center = cameras.clone().map(|c| c.position).sum::<DVec3>() / count;
    let mean_axis = cameras.clone().map(axis).sum::<DVec3>();
    // Axes that cancel out have no mean; use that of the first camera.
    let ahead = mean_axis.try_normalize().or_else(|| cameras.clone().next().map(axis)).unwrap_or(DVec3::NEG_Z);
    let to_origin = -center.dot(ahead);
    let apart = Aabb::from_points(cameras.map(|c| c.position)).size().length();
    let distance = [to_origin, apart].into_iter().find(|&d| d.is_finite() && d > 1e-6 * center.length());
    center + ahead * distance.unwrap_or(1.0)
}

#[cfg(test)]
mod tests {
    use glam::UVec3;

    use super::*;
    use strivec_format::geometry::Lattice;

    fn ring(radius: f64, target: DVec3, scale: f64) -> Vec<Camera> {
        (0..12)
            .map(|i| {
                let angle = f64::from(i) * std::f64::consts::FRAC_PI_6;
                let offset = radius * DVec3::new(angle.cos() * 0.9, angle.sin() * 0.9, 0.19_f64.sqrt());
                Camera::looking_at([20, 10], 25.0, scale * (target + offset), scale * target, DVec3::Z)
            })
            .collect()
    }

    #[test]
    fn cameras_around_a_point_focus_on_it_at_any_scale() {
        for scale in [1e-6, 1.0, 1e6] {
            let target = DVec3::new(1.0, -2.0, 3.0);
            let cameras = ring(4.0, target, scale);
            let bounds = CameraBounds::from_cameras(cameras.iter());
            assert!(bounds.focus.distance(scale * target) < 1e-9 * scale, "{bounds:?}");
            assert!((bounds.near / scale - 2.0).abs() < 1e-9 && (bounds.far / scale - 6.0).abs() < 1e-9, "{bounds:?}");
        }
    }

    fn assert_usable(cameras: &[Camera], near: f64, far: f64) {
        let bounds = CameraBounds::from_cameras(cameras.iter());
        assert!((bounds.near - near).abs() < 1e-6 * near && (bounds.far - far).abs() < 1e-6 * far, "{bounds:?}");
        assert!(frusta_box(cameras.iter(), bounds.near, bounds.far).is_solid());
    }

    #[test]
    fn a_single_camera_looks_past_the_origin_or_one_unit_ahead() {
        let towards = Camera::looking_at([8, 8], 9.0, DVec3::new(0.0, -4.0, 0.0), DVec3::ZERO, DVec3::Z);
        assert_usable(&[towards], 2.0, 6.0);
        let away = Camera::looking_at([8, 8], 9.0, DVec3::new(0.0, -4.0, 0.0), DVec3::new(0.0, -5.0, 0.0), DVec3::Z);
        assert_usable(&[away], 0.5, 1.5);
        let inside = Camera::looking_at([8, 8], 9.0, DVec3::ZERO, DVec3::X, DVec3::Z);
        assert_usable(&[inside], 0.5, 1.5);
    }

    #[test]
    fn parallel_cameras_fall_back_to_the_origin_ahead() {
        let cameras: Vec<_> = (0..5)
            .map(|i| {
                let position = DVec3::new(f64::from(i) - 2.0, -10.0, 0.0);
                Camera::looking_at([8, 8], 9.0, position, position + DVec3::Y, DVec3::Z)
            })
            .collect();
        let bounds = CameraBounds::from_cameras(cameras.iter());
        assert!(bounds.focus.length() < 1e-9, "{bounds:?}");
        assert!(bounds.near > 4.9 && bounds.far < 16.0);
    }

    #[test]
    fn cameras_that_look_outwards_from_one_place_get_finite_bounds() {
        for radius in [0.0, 1.0] {
            let cameras: Vec<_> = ring(1.0, DVec3::ZERO, 1.0)
                .iter()
                .map(|c| {
                    let out = c.position;
                    Camera::looking_at([8, 8], 9.0, radius * out, (radius + 1.0) * out, DVec3::Z)
                })
                .collect();
            let bounds = CameraBounds::from_cameras(cameras.iter());
            assert!(bounds.near > 0.0 && bounds.near < bounds.far && bounds.far.is_finite(), "{bounds:?}");
            assert!(bounds.focus.is_finite());
        }
    }

    #[test]
    fn the_range_holds_the_cells_that_cameras_see() {
        // A room: cameras in its middle look at its walls, which are farther than the cameras are apart.
        let cameras: Vec<_> = (0..8)
            .map(|i| {
                let out = DVec3::new(f64::from(i).cos(), f64::from(i).sin(), 0.0);
                Camera::looking_at([8, 8], 9.0, 0.1 * out, out, DVec3::Z)
            })
            .collect();
        let lattice = Lattice { origin: DVec3::splat(-3.0), pitch: DVec3::splat(0.1) };
        let cells = (0..60).flat_map(|i| [UVec3::new(i, 0, 30), UVec3::new(i, 59, 30)]).collect();
        let room = VoxelBoxes { lattice, cells };
        let [near, far] = ray_range(&cameras, Some(&room));
        assert!((1.9..2.9).contains(&near) && (3.0..5.0).contains(&far), "{near} {far}");
        let [unaided, end] = ray_range(&cameras, None);
        assert!(end < near, "the cameras alone end at {end}");
        // Cells that no picture shows are no evidence.
        let above = VoxelBoxes { cells: vec![UVec3::new(30, 30, 90)], ..room };
        assert_eq!(ray_range(&cameras, Some(&above)), [unaided, end]);
    }

    #[test]
    fn the_range_begins_before_what_is_close_to_some_cameras_but_not_before_a_stray_cell() {
        // Cameras at a wall of 10 by 10 units, every eighth of them close to it.
        let look = |i: u32| {
            let from = DVec3::new(f64::from(i) / 30.0 - 2.0, 0.0, if i.is_multiple_of(8) { 0.5 } else { 5.0 });
            Camera::looking_at([80, 60], 80.0, from, from - DVec3::Z, DVec3::Y)
        };
        let cameras: Vec<_> = (0..128).map(look).collect();
        let lattice = Lattice { origin: DVec3::new(-5.0, -5.0, -0.05), pitch: DVec3::splat(0.1) };
        let wall: Vec<UVec3> = (0..10_000).map(|n| UVec3::new(n % 100, n / 100, 0)).collect();
        let boxes = |more: Vec<UVec3>| VoxelBoxes { lattice, cells: wall.iter().copied().chain(more).collect() };
        let [near, _] = ray_range(&cameras, Some(&boxes(Vec::new())));
        assert!((0.2..0.5).contains(&near), "{near}");
        // A cell right before one of the others.
        let [still, _] = ray_range(&cameras, Some(&boxes(vec![UVec3::new(40, 50, 49)])));
        assert!((still - near).abs() < 0.05, "{near} {still}");
    }

    #[test]
    fn surroundings_reach_behind_the_focus_or_to_the_far_corner_of_the_box() {
        let cameras = ring(4.0, DVec3::ZERO, 1.0);
        let [near, far] = ray_range_of_surroundings(&cameras, None);
        assert!((near - 2.0).abs() < 1e-9 && (far - 10.0).abs() < 1e-9, "{near} {far}");
        let small = Aabb::around(DVec3::ZERO, DVec3::splat(1.0));
        let [near, far] = ray_range_of_surroundings(&cameras, Some(&small));
        assert!((2.2..3.1).contains(&near) && (5.0..5.8).contains(&far), "{near} {far}");
        let large = Aabb::around(DVec3::ZERO, DVec3::splat(6.0));
        let [near, far] = ray_range_of_surroundings(&cameras, Some(&large));
        assert!((near - 2.0).abs() < 1e-9 && far > 12.0, "{near} {far}");
    }

    #[test]
    fn the_inner_box_is_what_half_of_the_cameras_see_or_the_cameras_own() {
        let target = DVec3::new(1.0, 2.0, -3.0);
        let around = inner_box(&ring(4.0, target, 1.0));
        assert!((around.center() - target).length() < 1e-9);
        // Cameras 4 away whose pictures are 0.8 wide and 0.4 high per unit of distance.
        let half = 0.5 * around.size();
        assert!(half.max_element() - half.min_element() < 1e-9 && (0.8..1.6).contains(&half.x), "{half}");
        let scaled = inner_box(&ring(4.0, target, 1e3));
        assert!((scaled.size() / around.size() - 1e3).abs().max_element() < 1e-6);
        // Cameras in a room that look outward: no cube is seen by half of them.
        let outward: Vec<_> = ring(1.0, DVec3::ZERO, 1.0)
            .iter()
            .map(|c| Camera::looking_at([8, 8], 9.0, c.position, 2.0 * c.position, DVec3::Z))
            .collect();
        let room = inner_box(&outward);
        assert!(outward.iter().all(|camera| room.contains(camera.position)), "{room:?}");
    }

    #[test]
    fn frusta_box_holds_the_cap_in_the_middle_of_the_picture() {
        let camera = Camera::looking_at([8, 8], 9.0, DVec3::ZERO, DVec3::X, DVec3::Z);
        let bounds = frusta_box([camera].iter(), 1.0, 3.0);
        assert!((bounds.max.x - 3.0).abs() < 1e-12, "{bounds:?}");
        assert!(bounds.min.x < 1.0, "corners at the distance near lie less deep");
        let corner = camera.ray_through(0.0, 0.0).unwrap().at(3.0);
        assert!((bounds.max.y - corner.y.abs()).abs() < 1e-12 || bounds.max.y > corner.y.abs());
    }
}
