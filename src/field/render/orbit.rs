//! Cameras on a circle around a scene that is seen from outside.
//!
//! In: a scene's frame and bounds. Out: cameras in the dataset's space.

use std::f64::consts::TAU;

use glam::DVec3;

use strivec_format::geometry::{Aabb, Camera};
use strivec_format::model::{Frame, UpAxis};

/// A circle of cameras that look at the center of a scene's bounds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Orbit {
    /// Horizontal field of view, in radians.
    pub horizontal_angle: f64,
    /// Elevation of the cameras above the horizon, in radians.
    pub elevation: f64,
    /// Distance of the cameras from the center, in dataset units; `None` shows the whole scene.
    pub radius: Option<f64>,
}

impl Default for Orbit {
    /// A field of view of 40 degrees, from 30 degrees above the horizon, of the whole scene.
    fn default() -> Self {
        Self { horizontal_angle: 40.0_f64.to_radians(), elevation: 30.0_f64.to_radians(), radius: None }
    }
}

impl Orbit {
    /// `count` cameras evenly around a scene of this `frame` whose `bounds` are in model units, for pictures of `size`
    /// \[columns, rows\]. The cameras are in the dataset's space.
    pub fn cameras(&self, frame: &Frame, bounds: &Aabb, count: u32, size: [u32; 2]) -> Vec<Camera> {
        let dataset_from_model = frame.model_from_dataset.inverse();
        let focal = Camera::focal_of_angle(size[0], self.horizontal_angle);
        let target = dataset_from_model.point(bounds.center());
        let radius = self.radius.unwrap_or_else(|| whole_scene_radius(frame, bounds, size, focal));
        // The first two span the horizon, the third points up.
        let [ahead, aside, up] = match frame.up {
            UpAxis::X => [DVec3::Y, DVec3::Z, DVec3::X],
            UpAxis::Y => [DVec3::Z, DVec3::X, DVec3::Y],
            UpAxis::Z => [DVec3::X, DVec3::Y, DVec3::Z],
            UpAxis::MinusX => [DVec3::Z, DVec3::Y, -DVec3::X],
            UpAxis::MinusY => [DVec3::X, DVec3::Z, -DVec3::Y],
            UpAxis::MinusZ => [DVec3::Y, DVec3::X, -DVec3::Z],
        };
        let (rise, level) = self.elevation.sin_cos();
        let camera = |n: u32| {
            let (sin, cos) = (TAU * (f64::from(n) / f64::from(count))).sin_cos();
            let direction = level * (cos * ahead + sin * aside) + rise * up;
            Camera::looking_at(size, focal, target + radius * direction, target, up)
        };
        (0..count).map(camera).collect()
    }
}

/// The distance, in dataset units, at which the sphere around the scene's bounds fills the picture. It is clamped so
/// that the bounds lie between the scene's near and far, if possible.
fn whole_scene_radius(frame: &Frame, bounds: &Aabb, size: [u32; 2], focal: f64) -> f64 {
    let reach = 0.5 * bounds.size().length();
    let half_angle = (0.5 * f64::from(size[0].min(size[1])) / focal).atan();
    let (nearest, farthest) = (frame.near + reach, frame.far - reach);
    let radius = if nearest <= farthest {
        (reach / half_angle.sin()).clamp(nearest, farthest)
    } else {
        0.5 * (frame.near + frame.far)
    };
    radius / frame.model_from_dataset.scale
}
