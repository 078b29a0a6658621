//! The first view of a scene.

use std::f64::consts::FRAC_PI_2;

use glam::{DQuat, DVec3};

use strivec_field::render::{Gaze, Turntable};
use strivec_format::container::{Pose, TrainingCamera, Views};
use strivec_format::geometry::{Aabb, Camera};
use strivec_format::model::Scene;

/// Vertical angle of view in radians if the file has none.
const ANGLE_OF_VIEW: f64 = 0.7;
/// Elevation of an overview in radians.
const ELEVATION: f64 = 0.45;
/// Edge of the inner cube of a contracted scene, in model units.
const INNER_EDGE: f64 = 2.0;
/// The least distance of the first pivot, as part of the extent.
const NEAREST_PIVOT: f64 = 0.1;

/// A camera pose in the model's space, and the distance to its pivot.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Stand {
    pub(super) pose: Pose,
    /// Distance to the pivot, straight ahead.
    pub(super) distance: f64,
}

impl Stand {
    pub(super) fn axis(&self, axis: DVec3) -> DVec3 {
        self.pose.rotation * axis
    }

    /// The point that it orbits.
    pub(super) fn pivot(&self) -> DVec3 {
        self.pose.position - self.distance * self.axis(DVec3::Z)
    }
}

/// The first view of a scene, and what the controls derive from its cameras.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct FirstView {
    pub(super) stand: Stand,
    /// Vertical angle of view, in radians.
    pub(super) angle: f64,
    /// The direction that is up in pictures, in the model's space.
    pub(super) up: DVec3,
    /// True if the cameras stand within the scene and look away from its middle, as in a room.
    pub(super) looks_around: bool,
}

/// The first view of `scene`: that of a training camera if `cameras` do not surround its bounds (photographs show it
/// from within, or from one side only), else that of `views`, else an overview.
pub(super) fn first_view(scene: &Scene, views: Option<&Views>, cameras: &[TrainingCamera]) -> FirstView {
    let turn = Turntable::of(scene, views, cameras);
    let up = turn.as_ref().map_or_else(|| scene.frame.up_in_model(), |turn| turn.up);
    let looks_around = turn.as_ref().is_some_and(|turn| turn.gaze == Gaze::Outward);
    let (stand, angle) = match (&turn, views) {
        (Some(turn), _) if !cameras.is_empty() => {
            let camera = &cameras[turn.nearest_camera(cameras)];
            let ahead = -(camera.pose.rotation * DVec3::Z);
            let nearest = NEAREST_PIVOT * extent(scene);
            let distance = match turn.gaze {
                Gaze::Inward => (turn.center - camera.pose.position).dot(ahead).max(nearest),
                Gaze::Outward => 2.0 * nearest,
            };
            (Stand { pose: camera.pose, distance }, 2.0 * (0.5 * f64::from(camera.size[1]) / camera.focal[1]).atan())
        }
        (_, Some(views)) => {
            let distance = (views.center - views.first.position).length().max(1e-6);
            (Stand { pose: views.first, distance }, views.angle_of_view)
        }
        (Some(turn), None) => {
            let pose = Pose::from(&turn.camera(0.0, [2, 2]));
            (Stand { pose, distance: turn.distance().max(NEAREST_PIVOT) }, turn.angle_of_view)
        }
        (None, None) => (overview(&scene.bounds, up, ANGLE_OF_VIEW), ANGLE_OF_VIEW),
    };
    FirstView { stand, angle: angle.clamp(0.02, 3.0), up, looks_around }
}

/// The length that speeds are relative to, in model units: the longest edge of the bounds or, in a contracted scene, of
/// the inner cube.
pub(super) fn extent(scene: &Scene) -> f64 {
    if scene.rules.contraction.is_some() { INNER_EDGE } else { scene.bounds.size().max_element() }
}

/// A view from slightly above, at a distance that shows the sphere around `bounds`.
pub(super) fn overview(bounds: &Aabb, up: DVec3, angle_of_view: f64) -> Stand {
    let ahead = up.any_orthonormal_vector();
    let back = ELEVATION.cos() * ahead + ELEVATION.sin() * up;
    let distance = 0.5 * bounds.size().length() / (0.5 * angle_of_view).min(FRAC_PI_2).sin();
    let camera = Camera::looking_at([2, 2], 1.0, bounds.center() + distance * back, bounds.center(), up);
    let pose = Pose { position: camera.position, rotation: DQuat::from_mat3(&camera.world_from_camera) };
    Stand { pose, distance }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use super::*;

    /// Cameras in a circle of radius `radius` around the origin, from 0 to `angle`, that look at it.
    fn circle(angle: f64, radius: f64) -> Vec<TrainingCamera> {
        let camera = |n: u32| {
            let (sin, cos) = (angle * f64::from(n) / 20.0).sin_cos();
            let at = radius * DVec3::new(cos, sin, 0.2);
            TrainingCamera::from(&Camera::looking_at([40, 20], 25.0, at, DVec3::ZERO, DVec3::Z))
        };
        (0..20).map(camera).collect()
    }

    #[test]
    fn scenes_that_are_not_surrounded_begin_at_a_camera() {
        let scene = Scene { bounds: Aabb::around(DVec3::ZERO, DVec3::ONE), ..plain() };
        let from = |cameras: &[TrainingCamera]| first_view(&scene, None, cameras);
        let overview = from(&[]);
        assert_eq!(from(&circle(2.0 * PI, 4.0)), overview, "all sides");
        let one_side = circle(1.5, 4.0);
        let FirstView { stand, angle, looks_around, .. } = from(&one_side);
        assert!(one_side.iter().any(|camera| camera.pose == stand.pose), "{stand:?}");
        assert!((angle - 2.0 * (10.0_f64 / 25.0).atan()).abs() < 1e-12 && stand.pivot().length() < 1e-6);
        let inside = circle(2.0 * PI, 0.5);
        assert!(inside.iter().any(|camera| camera.pose == from(&inside).stand.pose), "from inside");
        assert!(!looks_around && !from(&inside).looks_around);
    }

    #[test]
    fn unbounded_scenes_begin_at_a_camera_of_the_capture_and_orbit_what_it_looks_at() {
        let scene = unbounded();
        // Cameras on all sides, outside of the inner cube; they do not follow from the bounds of contracted space.
        let cameras = circle(2.0 * PI, 4.0);
        let FirstView { stand, .. } = first_view(&scene, None, &cameras);
        assert!(cameras.iter().any(|camera| camera.pose == stand.pose), "{stand:?}");
        assert!(stand.pivot().length() < 1e-6, "{stand:?}");
        // A scene without cameras begins in the inner cube and looks at its middle.
        let FirstView { stand, .. } = first_view(&scene, None, &[]);
        assert!(stand.pose.position.abs().max_element() < 1.0 && stand.pivot().length() < 1e-9, "{stand:?}");
        assert_eq!(extent(&scene), 2.0);
    }

    #[test]
    fn in_a_room_the_camera_looks_around_and_up_is_that_of_its_pictures() {
        let scene = Scene { bounds: Aabb::around(DVec3::ZERO, DVec3::splat(3.0)), ..plain() };
        // All directions from the middle of the room, whose floor is at +y.
        let camera = |n: u32| {
            let (sin, cos) = f64::from(n).sin_cos();
            let at = DVec3::new(0.3 * cos, 0.1, 0.3 * sin);
            let toward = at + DVec3::new(cos, 0.2 * (3.0 * sin).sin(), sin);
            TrainingCamera::from(&Camera::looking_at([40, 20], 25.0, at, toward, -DVec3::Y))
        };
        let cameras: Vec<_> = (0..20).map(camera).collect();
        let FirstView { stand, up, looks_around, .. } = first_view(&scene, None, &cameras);
        assert!(looks_around && cameras.iter().any(|camera| camera.pose == stand.pose));
        assert!(up.dot(-DVec3::Y) > 0.99, "{up}");
    }

    fn plain() -> Scene {
        strivec_format::container::decode(include_bytes!(concat!(
            env!("CARGO_MANIFEST_DIR"),
            "/../../fixtures/v1/f32.strivec"
        )))
        .unwrap()
    }

    /// A contracted scene.
    fn unbounded() -> Scene {
        let mut scene = plain();
        let contraction = strivec_format::geometry::Contraction { shell: 0.4 };
        (scene.bounds, scene.rules.contraction) = (contraction.bounds(), Some(contraction));
        scene
    }
}
