//! The first view of a scene.

use std::f64::consts::FRAC_PI_2;

use glam::{DQuat, DVec3};

use crate::container::{Pose, TrainingCamera, Views};
use crate::geometry::{Aabb, Camera};
use crate::model::Scene;

/// Vertical angle of view in radians if the file has none.
const ANGLE_OF_VIEW: f64 = 0.7;
/// Elevation of an overview in radians.
const ELEVATION: f64 = 0.45;
/// Cameras surround a scene if the mean of their unit directions, seen from its center, is shorter than this.
const MAX_MEAN_DIRECTION: f64 = 0.5;

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

/// The first view of `scene`, and its vertical angle in radians: that of a training camera if `cameras` do not surround
/// the scene (photographs show it from one side only), else that of `views`, else an overview.
pub(super) fn first_view(scene: &Scene, up: DVec3, views: Option<&Views>, cameras: &[TrainingCamera]) -> (Stand, f64) {
    let (center, extent) = (scene.bounds.center(), scene.bounds.size().max_element());
    if !cameras.is_empty() && !surround(cameras, &scene.bounds, up) {
        let mean = cameras.iter().map(|camera| camera.pose.position).sum::<DVec3>() / cameras.len() as f64;
        let far = |camera: &&TrainingCamera| camera.pose.position.distance_squared(mean);
        if let Some(camera) = cameras.iter().min_by(|a, b| far(a).total_cmp(&far(b))) {
            let stand = Stand { pose: camera.pose, distance: extent };
            let ahead = (center - stand.pose.position).dot(-stand.axis(DVec3::Z));
            let angle = 2.0 * (0.5 * f64::from(camera.size[1]) / camera.focal[1]).atan();
            return (Stand { distance: ahead.max(0.1 * extent), ..stand }, angle.clamp(0.02, 3.0));
        }
    }
    let angle = views.map_or(ANGLE_OF_VIEW, |views| views.angle_of_view).clamp(0.02, 3.0);
    let stand = match views {
        Some(views) => Stand { pose: views.first, distance: (views.center - views.first.position).length().max(1e-6) },
        None => overview(&scene.bounds, up, angle),
    };
    (stand, angle)
}

/// True if most of `cameras` are outside of `bounds` and they are on all sides of it.
fn surround(cameras: &[TrainingCamera], bounds: &Aabb, up: DVec3) -> bool {
    let inside = cameras.iter().filter(|camera| bounds.contains(camera.pose.position)).count();
    let direction = |camera: &TrainingCamera| {
        let to = camera.pose.position - bounds.center();
        (to - to.dot(up) * up).normalize_or_zero()
    };
    let mean = cameras.iter().map(direction).sum::<DVec3>() / cameras.len() as f64;
    2 * inside < cameras.len() && mean.length() < MAX_MEAN_DIRECTION
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
        let scene = crate::container::decode(include_bytes!("../../fixtures/v1/f32.strivec")).unwrap();
        let bounds = Aabb::around(DVec3::ZERO, DVec3::ONE);
        let scene = Scene { bounds, ..scene };
        let from = |cameras: &[TrainingCamera]| first_view(&scene, DVec3::Z, None, cameras);
        let overview = from(&[]);
        assert_eq!(from(&circle(2.0 * std::f64::consts::PI, 4.0)), overview, "all sides");
        let one_side = circle(1.5, 4.0);
        let (stand, angle) = from(&one_side);
        assert!(one_side.iter().any(|camera| camera.pose == stand.pose), "{stand:?}");
        assert!((angle - 2.0 * (10.0_f64 / 25.0).atan()).abs() < 1e-12 && stand.pivot().length() < 1e-6);
        let inside = circle(2.0 * std::f64::consts::PI, 0.5);
        assert!(inside.iter().any(|camera| camera.pose == from(&inside).0.pose), "from inside");
    }
}
