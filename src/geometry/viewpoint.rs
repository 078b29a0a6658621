//! Where a camera stands and where it looks, apart from the picture that it takes.

use glam::{DMat3, DQuat, DVec3};

use super::Camera;

/// Where a camera stands, where it looks, and how much it sees. The size of its picture is left open.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Viewpoint {
    /// In the world.
    pub position: DVec3,
    /// From the camera's axes, as [`Camera`] has them, to the world's: a unit quaternion.
    pub rotation: DQuat,
    /// Radians that a picture spans from top to bottom.
    pub vertical_angle: f64,
}

impl Viewpoint {
    /// That of `camera`, whose principal point is taken to be its picture's middle.
    pub fn from_camera(camera: &Camera) -> Self {
        Self {
            position: camera.position,
            rotation: DQuat::from_mat3(&camera.world_from_camera).normalize(),
            vertical_angle: 2.0 * (0.5 * f64::from(camera.height) / camera.focal[1]).atan(),
        }
    }

    /// A camera here that takes pictures of `size`, columns and rows.
    pub fn camera(&self, size: [u32; 2]) -> Camera {
        let focal = Camera::focal_of_angle(size[1], self.vertical_angle);
        Camera {
            width: size[0],
            height: size[1],
            focal: [focal, focal],
            principal: size.map(|extent| 0.5 * f64::from(extent)),
            world_from_camera: DMat3::from_quat(self.rotation),
            position: self.position,
        }
    }

    /// The logarithm of the focal length of a picture two units high: equal steps of it are equal zooms.
    pub(super) fn zoom(&self) -> f64 {
        -(0.5 * self.vertical_angle).tan().ln()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_viewpoint_is_a_cameras() {
        let camera = Camera::looking_at([40, 30], 25.0, DVec3::new(1.0, -5.0, 2.0), DVec3::ZERO, DVec3::Z);
        let again = Viewpoint::from_camera(&camera).camera([40, 30]);
        assert!((again.focal[0] - 25.0).abs() < 1e-12 && again.position == camera.position);
        assert!(again.world_from_camera.abs_diff_eq(camera.world_from_camera, 1e-12));
    }
}
