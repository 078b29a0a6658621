//! Pinhole cameras: the only definition of the camera's axes and of pixel centers.

use glam::{DMat3, DMat4, DVec3};

use super::{NotRigid, Ray, Similarity, rigid};

/// A pinhole camera in OpenGL's and Blender's axes: x to the right, y up, looking along −z.
///
/// Pixel (column, row) counts from the top left; its center is (column + ½, row + ½).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Focal lengths in pixels, along columns and rows.
    pub focal: [f64; 2],
    /// The principal point in pixels from the top left corner of the picture.
    pub principal: [f64; 2],
    /// Orthonormal, right-handed: its columns are the camera's x, y and z axes in the world.
    pub world_from_camera: DMat3,
    /// The camera's position in the world.
    pub position: DVec3,
}

/// Numbers that do not form a camera pose.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("a camera pose must be {expected}; found {found}")]
pub struct PoseError {
    /// The property that a pose must have.
    pub expected: &'static str,
    /// The numbers found, or their count.
    pub found: String,
}

impl Camera {
    /// The focal length in pixels of a picture `extent` pixels across that spans `angle` radians.
    pub fn focal_of_angle(extent: u32, angle: f64) -> f64 {
        0.5 * f64::from(extent) / (0.5 * angle).tan()
    }

    /// A camera at `position` that looks at `target` with `up` upwards, its principal point in the middle.
    /// `up` must not be parallel to the line of sight.
    pub fn looking_at(size: [u32; 2], focal: f64, position: DVec3, target: DVec3, up: DVec3) -> Self {
        let back = (position - target).normalize();
        let right = up.cross(back).normalize();
        Self {
            width: size[0],
            height: size[1],
            focal: [focal, focal],
            principal: [0.5 * f64::from(size[0]), 0.5 * f64::from(size[1])],
            world_from_camera: DMat3::from_cols(right, back.cross(right), back),
            position,
        }
    }

    /// The camera of the row-major camera-to-world matrix `pose`, its principal point in the middle.
    ///
    /// # Errors
    ///
    /// If `pose` is not 16 finite numbers that form a right-handed rotation, within 0.001, and a translation.
    pub fn posed(pose: &[f64], size: [u32; 2], focal: f64) -> Result<Self, PoseError> {
        let numbers: [f64; 16] =
            pose.try_into().map_err(|_| PoseError { expected: "16 numbers", found: pose.len().to_string() })?;
        let rows = std::array::from_fn(|row| std::array::from_fn(|column| numbers[4 * row + column]));
        let (world_from_camera, position) =
            rigid(&rows).map_err(|NotRigid { expected, .. }| PoseError { expected, found: format!("{pose:?}") })?;
        let principal = size.map(|extent| 0.5 * f64::from(extent));
        Ok(Self { width: size[0], height: size[1], focal: [focal; 2], principal, world_from_camera, position })
    }

    /// The row-major camera-to-world matrix, as accepted by [`Camera::posed`].
    pub fn pose(&self) -> [f64; 16] {
        let [x, y, z] = self.world_from_camera.to_cols_array_2d().map(DVec3::from);
        DMat4::from_cols(x.extend(0.0), y.extend(0.0), z.extend(0.0), self.position.extend(1.0))
            .transpose()
            .to_cols_array()
    }

    /// The ray from the camera through the picture point (x, y), in pixels from the top left corner.
    pub fn ray_through(&self, x: f64, y: f64) -> Ray {
        let in_camera =
            DVec3::new((x - self.principal[0]) / self.focal[0], -(y - self.principal[1]) / self.focal[1], -1.0);
        Ray { origin: self.position, direction: (self.world_from_camera * in_camera).normalize() }
    }

    /// The ray through the center of pixel (`column`, `row`).
    pub fn ray(&self, column: u32, row: u32) -> Ray {
        self.ray_through(f64::from(column) + 0.5, f64::from(row) + 0.5)
    }

    /// The same view in the target space of `map`.
    pub fn mapped(&self, map: &Similarity) -> Self {
        Self {
            world_from_camera: DMat3::from_quat(map.rotation) * self.world_from_camera,
            position: map.point(self.position),
            ..*self
        }
    }

    /// The camera of the same view in a picture `factor` times smaller in both directions. The size is rounded
    /// down: the remaining last columns and rows lie outside the picture.
    pub fn downscaled(&self, factor: u32) -> Self {
        let f = f64::from(factor);
        Self {
            width: self.width / factor,
            height: self.height / factor,
            focal: self.focal.map(|v| v / f),
            principal: self.principal.map(|v| v / f),
            ..*self
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn middle_of_the_picture_looks_at_the_target_and_columns_grow_to_the_right() {
        let camera = Camera::looking_at([4, 2], 3.0, DVec3::new(0.0, -5.0, 0.0), DVec3::ZERO, DVec3::Z);
        assert!((camera.ray_through(2.0, 1.0).direction - DVec3::Y).length() < 1e-15);
        assert!(camera.ray(3, 0).direction.x > 0.0, "columns grow to the right");
        assert!(camera.ray(3, 0).direction.z > 0.0, "rows grow downwards");
    }

    #[test]
    fn a_pose_is_that_of_its_camera() {
        let camera = Camera::looking_at([4, 2], 3.0, DVec3::new(1.0, -5.0, 2.0), DVec3::X, DVec3::Z);
        let again = Camera::posed(&camera.pose(), [4, 2], 3.0).unwrap();
        assert!(again.world_from_camera.abs_diff_eq(camera.world_from_camera, 1e-12));
        assert_eq!((again.position, camera.pose()[7]), (camera.position, -5.0));
        assert!(Camera::posed(&camera.pose()[1..], [4, 2], 3.0).is_err());
    }

    #[test]
    fn downscaled_pixel_center_is_the_middle_of_its_block() {
        let camera = Camera::looking_at([8, 8], 5.0, DVec3::new(1.0, -5.0, 2.0), DVec3::ZERO, DVec3::Z);
        let small = camera.downscaled(4);
        let difference = small.ray(1, 0).direction - camera.ray_through(6.0, 2.0).direction;
        assert!(difference.length() < 1e-15);
    }
}
