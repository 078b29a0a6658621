//! Viewpoints: a camera's position, rotation and field of view, without the size of its picture.

use glam::{DMat3, DQuat, DVec3};

use super::{Camera, Lens};

/// A camera's position, rotation and field of view. The size of its picture is not part of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Viewpoint {
    /// The position in the world.
    pub position: DVec3,
    /// The rotation from the camera's axes, as defined by [`Camera`], to the world's: a unit quaternion.
    pub rotation: DQuat,
    /// The vertical field of view in radians.
    pub vertical_angle: f64,
}

impl Viewpoint {
    /// The viewpoint of `camera`, whose principal point is assumed to be the middle of its picture.
    pub fn from_camera(camera: &Camera) -> Self {
        Self {
            position: camera.position,
            rotation: DQuat::from_mat3(&camera.world_from_camera).normalize(),
            vertical_angle: 2.0 * (0.5 * f64::from(camera.height) / camera.focal[1]).atan(),
        }
    }

    /// The camera at this viewpoint with pictures of `size` (columns and rows).
    pub fn camera(&self, size: [u32; 2]) -> Camera {
        let focal = Camera::focal_of_angle(size[1], self.vertical_angle);
        Camera {
            width: size[0],
            height: size[1],
            focal: [focal, focal],
            principal: size.map(|extent| 0.5 * f64::from(extent)),
            lens: Lens::PINHOLE,
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
