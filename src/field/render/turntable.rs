//! A turn through a scene that is seen from inside, or from one side: where a viewer stands, and where it looks.
//!
//! In: the scene and the cameras of its photographs, or the viewpoints of its file. Out: cameras in model space. Scenes
//! that cameras surround from outside of their bounds have none: an orbit around the bounds suits them.

use std::f64::consts::{PI, TAU};

use glam::{DMat3, DQuat, DVec3};

use strivec_format::container::{Pose, TrainingCamera, Views};
use strivec_format::geometry::{Aabb, Camera, Ray, focus_of_axes};
use strivec_format::model::Scene;

/// Cameras surround a point if the mean of their unit directions, seen from it, is shorter than this.
const MAX_MEAN_DIRECTION: f64 = 0.5;
/// Cameras look at one point if the mean cosine of the angle between their axes and the direction to it exceeds this.
const MIN_CONVERGENCE: f64 = 0.75;
/// Cameras look in one direction if the mean of their axes is longer than this.
const MIN_COMMON_AXIS: f64 = 0.9;
/// The photographs' own up direction replaces the frame's if the cosine between the two is less than this.
const MAX_TILT: f64 = 0.85;
/// The mean of the cameras' up directions means nothing if it is shorter than this.
const MIN_MEAN_UP: f64 = 0.3;
/// Radius and height of a turn in the inner cube if no camera is known, and its angle of view in radians.
const INNER_TURN: [f64; 2] = [0.8, 0.3];
const INNER_ANGLE: f64 = 0.9;
/// The smallest radius of a turn, as part of the distance to its center.
const MIN_RADIUS: f64 = 0.05;
/// The smallest swing to either side, in radians.
const MIN_SWING: f64 = 0.05;
/// Deviations of cameras beside a turn: of their distance, as a part of it, and of their elevation in radians.
const BESIDE: [f64; 2] = [0.15, 0.25];
/// The share of the cameras that a swing includes.
const SWING_SHARE: f64 = 0.9;

/// The direction in which the cameras of a turn look.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Gaze {
    /// At the center.
    Inward,
    /// Away from the center, as from the middle of a room.
    Outward,
}

/// A turn around or at a point, in model space.
#[derive(Clone, Debug, PartialEq)]
pub struct Turntable {
    /// Unit vector that points up.
    pub up: DVec3,
    /// The point that the cameras look at or, if they look outward, stand at.
    pub center: DVec3,
    /// Horizontal distance of the cameras from the center.
    pub radius: f64,
    /// Their height above the center.
    pub height: f64,
    /// The direction in which they look.
    pub gaze: Gaze,
    /// Horizontal unit vector from the center towards the first camera.
    pub first: DVec3,
    /// Half the angle of a swing to and fro about `first`, in radians; `None` for a full turn.
    pub swing: Option<f64>,
    /// Angle of view over the shorter side of a picture, in radians.
    pub angle_of_view: f64,
}

/// The pose of a photograph or a viewpoint, and its angle of view over the shorter side.
struct KnownPose {
    pose: Pose,
    angle: f64,
}

impl KnownPose {
    fn axis(&self) -> Ray {
        Ray { origin: self.pose.position, direction: -(self.pose.rotation * DVec3::Z) }
    }
}

impl Turntable {
    /// Usual number of poses of a turn in a file.
    pub const POSES: u32 = 36;
    /// Usual seconds of a turn.
    pub const SECONDS: f64 = 12.0;

    /// The turn through `scene` by `cameras` or, without any, by the path of `views`. `None` if these surround the
    /// scene's bounds from outside, and for a scene in plain space of which neither is known.
    pub fn of(scene: &Scene, views: Option<&Views>, cameras: &[TrainingCamera]) -> Option<Self> {
        let of_camera = |camera: &TrainingCamera| {
            let halves = [0, 1].map(|a| 0.5 * f64::from(camera.size[a]) / camera.focal[a]);
            KnownPose { pose: camera.pose, angle: 2.0 * halves[0].min(halves[1]).atan() }
        };
        let known: Vec<KnownPose> = match views {
            Some(views) if cameras.is_empty() => {
                views.path.iter().map(|&pose| KnownPose { pose, angle: views.angle_of_view }).collect()
            }
            _ => cameras.iter().map(of_camera).collect(),
        };
        let up = scene.frame.up_in_model();
        let is_contracted = scene.rules.contraction.is_some();
        if known.is_empty() {
            return is_contracted.then(|| Self::in_inner_cube(up));
        }
        let up = up_of(&known, up);
        let seen_within = is_contracted || !surround(&known, &scene.bounds, up);
        seen_within.then(|| Self::of_known(scene, &known, up)).filter(Self::is_finite)
    }

    /// The turn through a contracted scene of which no camera is known: its cameras are in the inner cube.
    fn in_inner_cube(up: DVec3) -> Self {
        let [radius, height] = INNER_TURN;
        let first = up.any_orthonormal_vector();
        let (gaze, angle_of_view) = (Gaze::Inward, INNER_ANGLE);
        Self { up, center: DVec3::ZERO, radius, height, gaze, first, swing: None, angle_of_view }
    }

    fn of_known(scene: &Scene, known: &[KnownPose], up: DVec3) -> Self {
        let count = known.len() as f64;
        // Medians: a few cameras apart from the others must not move the turn.
        let position = DVec3::from([0, 1, 2].map(|a| median(known.iter().map(|k| k.pose.position[a]))));
        let mean_axis = known.iter().map(|k| k.axis().direction).sum::<DVec3>() / count;
        let convergence = |focus: &DVec3| {
            let cosine = |k: &KnownPose| (focus - k.pose.position).normalize_or_zero().dot(k.axis().direction);
            known.iter().map(cosine).sum::<f64>() / count
        };
        let focus = focus_of_axes(known.iter().map(KnownPose::axis)).filter(|f| convergence(f) > MIN_CONVERGENCE);
        let focus = focus.or_else(|| {
            let ahead = mean_axis.try_normalize().filter(|_| mean_axis.length() > MIN_COMMON_AXIS)?;
            let distance = match scene.rules.contraction {
                Some(_) => 1.0,
                None => (scene.bounds.center() - position).dot(ahead).max(0.1 * scene.bounds.size().max_element()),
            };
            Some(position + distance * ahead)
        });
        let angle_of_view = median(known.iter().map(|k| k.angle)).clamp(0.02, 3.0);
        let level = |v: DVec3| v - v.dot(up) * up;
        let (gaze, center) = focus.map_or((Gaze::Outward, position), |focus| (Gaze::Inward, focus));
        let from_center = |k: &KnownPose| match gaze {
            Gaze::Inward => level(k.pose.position - center),
            Gaze::Outward => level(k.axis().direction),
        };
        let [radius, height] = match gaze {
            Gaze::Outward => [0.0; 2],
            Gaze::Inward => {
                let height = median(known.iter().map(|k| (k.pose.position - center).dot(up)));
                let radius = median(known.iter().map(|k| from_center(k).length()));
                [radius.max(MIN_RADIUS * height.abs()).max(f64::MIN_POSITIVE), height]
            }
        };
        let directions: Vec<DVec3> = known.iter().filter_map(|k| from_center(k).try_normalize()).collect();
        let mean = directions.iter().sum::<DVec3>() / directions.len().max(1) as f64;
        let middle = mean.try_normalize().filter(|_| mean.length() > MAX_MEAN_DIRECTION);
        let swing = middle.map(|middle| {
            let mut angles: Vec<f64> = directions.iter().map(|d| d.angle_between(middle)).collect();
            angles.sort_by(f64::total_cmp);
            angles[(SWING_SHARE * (angles.len() - 1) as f64) as usize].max(MIN_SWING)
        });
        let mut turn = Self { up, center, radius, height, gaze, first: DVec3::X, swing, angle_of_view };
        let nearest = nearest(known.iter().map(|k| turn.distance_to(&k.pose)));
        let first = middle.or_else(|| from_center(&known[nearest]).try_normalize());
        turn.first = first.unwrap_or_else(|| up.any_orthonormal_vector());
        turn
    }

    /// False if coordinates of cameras were too large for the sums.
    fn is_finite(&self) -> bool {
        let lengths = self.radius + self.height + self.swing.unwrap_or_default();
        self.center.is_finite() && self.first.is_finite() && self.distance().is_finite() && lengths.is_finite()
    }

    /// The camera after `share` of the turn, from 0 to 1, of pictures of `size` with `focal` pixels of focal length, at
    /// this `distance` from the center and this `elevation` above it in radians.
    pub fn camera_at(&self, share: f64, size: [u32; 2], focal: f64, distance: f64, elevation: f64) -> Camera {
        let turn = self.swing.map_or(TAU * share, |swing| swing.min(PI) * (TAU * share).sin());
        let direction = DQuat::from_axis_angle(self.up, turn) * self.first;
        let (rise, level) = elevation.sin_cos();
        let from_center = level * direction + rise * self.up;
        // Relative to the center: far from the origin a unit vector may be lost in rounding.
        let [from, target] = match self.gaze {
            Gaze::Inward => [from_center, DVec3::ZERO],
            Gaze::Outward => [DVec3::ZERO, direction],
        };
        let position = self.center + distance * from_center;
        Camera { position, ..Camera::looking_at(size, focal, from, target, self.up) }
    }

    /// The camera after `share` of the turn, from 0 to 1, with pictures of `size`.
    pub fn camera(&self, share: f64, size: [u32; 2]) -> Camera {
        self.camera_at(share, size, self.focal(size), self.distance(), self.elevation())
    }

    /// `count` cameras of square pictures of `size`, along the turn by the golden angle and beside it: nearer and farther,
    /// higher and lower; or, if they look outward, up and down.
    pub fn spread(&self, count: usize, size: u32) -> Vec<Camera> {
        let (size, focal) = ([size; 2], self.focal([size; 2]));
        (0..count)
            .map(|n| {
                // The golden angle spreads any number of cameras evenly.
                let share = n as f64 * 0.5 * (3.0 - 5.0_f64.sqrt());
                let beside = (2.4 * n as f64).sin();
                let distance = self.distance() * (1.0 + BESIDE[0] * (1.7 * n as f64).sin());
                let elevation = (self.elevation() + BESIDE[1] * beside).clamp(-1.4, 1.4);
                match self.gaze {
                    Gaze::Inward => self.camera_at(share, size, focal, distance, elevation),
                    Gaze::Outward => {
                        let level = self.camera_at(share, size, focal, 0.0, 0.0);
                        let pitch = DMat3::from_rotation_x(2.0 * BESIDE[1] * beside);
                        Camera { world_from_camera: level.world_from_camera * pitch, ..level }
                    }
                }
            })
            .collect()
    }

    /// Focal length in pixels of pictures of `size` with the turn's angle of view.
    pub fn focal(&self, size: [u32; 2]) -> f64 {
        Camera::focal_of_angle(size[0].min(size[1]), self.angle_of_view)
    }

    /// Distance of the cameras from the center.
    pub fn distance(&self) -> f64 {
        self.radius.hypot(self.height)
    }

    /// Elevation of the cameras above the center, in radians.
    pub fn elevation(&self) -> f64 {
        if self.radius > 0.0 { self.height.atan2(self.radius) } else { 0.0 }
    }

    /// Index of the camera whose pose is most like those of the turn.
    pub fn nearest_camera(&self, cameras: &[TrainingCamera]) -> usize {
        nearest(cameras.iter().map(|camera| self.distance_to(&camera.pose)))
    }

    /// The turn as the viewpoints of a file: `count` poses in `seconds`. Pictures are assumed to be square.
    pub fn views(&self, count: u32, seconds: f64) -> Views {
        let path: Vec<Pose> =
            (0..count).map(|n| Pose::from(&self.camera(f64::from(n) / f64::from(count), [2, 2]))).collect();
        let center = match self.gaze {
            Gaze::Inward => self.center,
            Gaze::Outward => self.center + self.first,
        };
        Views { angle_of_view: self.angle_of_view, first: path[0], center, seconds, is_closed: true, path }
    }

    /// How unlike those of the turn `pose` is: 0 for its own.
    fn distance_to(&self, pose: &Pose) -> f64 {
        let from = pose.position - self.center;
        let ahead = -(pose.rotation * DVec3::Z);
        match self.gaze {
            Gaze::Outward => from.length() + ahead.dot(self.up).abs(),
            Gaze::Inward => {
                let height = from.dot(self.up);
                let radius = (from - height * self.up).length();
                let apart = (radius - self.radius).hypot(height - self.height);
                apart / self.distance() + 1.0 + ahead.dot(from.normalize_or_zero())
            }
        }
    }
}

/// The direction that is up in the pictures of `known`, if it differs much from `up`, the frame's.
fn up_of(known: &[KnownPose], up: DVec3) -> DVec3 {
    let mean = known.iter().map(|k| k.pose.rotation * DVec3::Y).sum::<DVec3>() / known.len() as f64;
    let own = mean.try_normalize().filter(|own| mean.length() > MIN_MEAN_UP && own.dot(up) < MAX_TILT);
    own.unwrap_or(up)
}

/// True if most of `known` are outside of `bounds` and they are on all sides of it.
fn surround(known: &[KnownPose], bounds: &Aabb, up: DVec3) -> bool {
    let inside = known.iter().filter(|k| bounds.contains(k.pose.position)).count();
    let direction = |k: &KnownPose| {
        let to = k.pose.position - bounds.center();
        (to - to.dot(up) * up).normalize_or_zero()
    };
    let mean = known.iter().map(direction).sum::<DVec3>() / known.len() as f64;
    2 * inside < known.len() && mean.length() < MAX_MEAN_DIRECTION
}

/// Index of the least of `distances`.
fn nearest(distances: impl Iterator<Item = f64>) -> usize {
    distances.enumerate().min_by(|(_, a), (_, b)| a.total_cmp(b)).map_or(0, |(n, _)| n)
}

/// The upper median; 0 of nothing.
fn median(values: impl Iterator<Item = f64>) -> f64 {
    let mut sorted: Vec<f64> = values.collect();
    sorted.sort_by(f64::total_cmp);
    sorted.get(sorted.len() / 2).copied().unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;
    use strivec_format::geometry::Contraction;

    fn plain() -> Scene {
        let scene = strivec_format::container::decode(include_bytes!(concat!(
            env!("CARGO_MANIFEST_DIR"),
            "/../../fixtures/v1/f32.strivec"
        )))
        .unwrap();
        Scene { bounds: Aabb::around(DVec3::ZERO, DVec3::ONE), ..scene }
    }

    fn unbounded() -> Scene {
        let mut scene = plain();
        let contraction = Contraction { shell: 0.4 };
        (scene.bounds, scene.rules.contraction) = (contraction.bounds(), Some(contraction));
        scene
    }

    /// Cameras around (0.1, 0, −0.2) at all azimuths up to `angle`, with `up` upwards, that look at it or away.
    fn ring(angle: f64, radius: f64, gaze: Gaze, up: DVec3) -> Vec<TrainingCamera> {
        let center = DVec3::new(0.1, 0.0, -0.2);
        let (aside, ahead) = up.any_orthonormal_pair();
        let camera = |n: u32| {
            let (sin, cos) = (angle * f64::from(n) / 24.0).sin_cos();
            let out = cos * aside + sin * ahead;
            let at = center + radius * out + (0.4 + 0.02 * f64::from(n % 3)) * up;
            let toward = if gaze == Gaze::Inward { center } else { at + out };
            TrainingCamera::from(&Camera::looking_at([60, 40], 50.0, at, toward, up))
        };
        (0..24).map(camera).collect()
    }

    #[test]
    fn a_capture_on_all_sides_is_turned_around_as_its_cameras_stood() {
        for up in [DVec3::Z, -DVec3::Y] {
            let turn = Turntable::of(&unbounded(), None, &ring(TAU, 0.8, Gaze::Inward, up)).unwrap();
            assert_eq!((turn.gaze, turn.swing), (Gaze::Inward, None));
            assert!(turn.up.dot(up) > 0.999, "{turn:?}");
            assert!((turn.center - DVec3::new(0.1, 0.0, -0.2)).length() < 0.02, "{turn:?}");
            assert!((turn.radius - 0.8).abs() < 0.02 && (turn.height - 0.42).abs() < 0.03, "{turn:?}");
            assert!((turn.angle_of_view - 2.0 * (20.0_f64 / 50.0).atan()).abs() < 1e-12);
            for n in 0..8 {
                let camera = turn.camera(f64::from(n) / 8.0, [40, 30]);
                let ahead = camera.ray_through(20.0, 15.0).unwrap();
                assert!((ahead.at(turn.distance()) - turn.center).length() < 1e-9);
                assert!(camera.world_from_camera.y_axis.dot(up) > 0.5, "up is up");
            }
        }
    }

    #[test]
    fn a_capture_of_one_side_swings_where_its_cameras_stood() {
        let cameras = ring(1.2, 3.0, Gaze::Inward, DVec3::Z);
        let turn = Turntable::of(&plain(), None, &cameras).unwrap();
        assert!(turn.swing.is_some_and(|swing| (0.4..0.6).contains(&swing)), "{turn:?}");
        for n in 0..20 {
            let at = turn.camera(f64::from(n) / 20.0, [2, 2]).position;
            let nearest = cameras.iter().map(|c| c.pose.position.distance(at)).fold(f64::INFINITY, f64::min);
            assert!(nearest < 0.2, "{n}: {nearest}");
        }
    }

    #[test]
    fn a_room_is_turned_in() {
        let cameras = ring(TAU, 0.4, Gaze::Outward, DVec3::Z);
        let turn = Turntable::of(&plain(), None, &cameras).unwrap();
        assert_eq!((turn.gaze, turn.swing), (Gaze::Outward, None));
        let ahead = |share: f64| turn.camera(share, [2, 2]).ray_through(1.0, 1.0).unwrap();
        assert!((ahead(0.0).origin - ahead(0.5).origin).length() < 1e-9);
        assert!(ahead(0.0).direction.dot(ahead(0.5).direction) < -0.99);
        let spread = turn.spread(12, 8);
        assert!(spread.iter().any(|c| c.world_from_camera.z_axis.z > 0.2), "some look down");
        assert!(spread.iter().any(|c| c.world_from_camera.z_axis.z < -0.2), "some look up");
    }

    #[test]
    fn the_viewpoints_of_a_file_give_the_turn_that_they_are_from() {
        for (scene, cameras) in [
            (unbounded(), ring(TAU, 0.8, Gaze::Inward, -DVec3::Y)),
            (unbounded(), ring(TAU, 0.3, Gaze::Outward, DVec3::Z)),
            (plain(), ring(TAU, 0.3, Gaze::Outward, DVec3::Z)),
        ] {
            let turn = Turntable::of(&scene, None, &cameras).unwrap();
            let views = turn.views(Turntable::POSES, Turntable::SECONDS);
            let again = Turntable::of(&scene, Some(&views), &[]).unwrap();
            assert_eq!((again.gaze, again.swing), (turn.gaze, turn.swing));
            assert!((again.center - turn.center).length() < 1e-6, "{again:?} {turn:?}");
            let apart = (again.radius - turn.radius).abs() + (again.height - turn.height).abs();
            assert!(apart < 1e-6 && (again.angle_of_view - turn.angle_of_view).abs() < 1e-12);
        }
    }

    #[test]
    fn scenes_seen_from_outside_have_no_turn_and_wild_cameras_no_wild_one() {
        assert_eq!(Turntable::of(&plain(), None, &[]), None);
        assert_eq!(Turntable::of(&plain(), None, &ring(TAU, 3.0, Gaze::Inward, DVec3::Z)), None);
        let turn = Turntable::of(&unbounded(), None, &[]).unwrap();
        let place = turn.camera(0.3, [2, 2]).position;
        assert!(place.abs().max_element() < 1.0 && turn.spread(20, 8).len() == 20);
        for cameras in [ring(TAU, 1e300, Gaze::Inward, DVec3::Z), ring(TAU, 1e308, Gaze::Outward, DVec3::Z)] {
            if let Some(turn) = Turntable::of(&unbounded(), None, &cameras) {
                let camera = turn.camera(0.3, [2, 2]);
                assert!(camera.position.is_finite() && camera.world_from_camera.is_finite(), "{turn:?}");
            }
        }
    }
}
