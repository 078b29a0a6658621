//! Cameras: the only definition of the camera's axes and of pixel centers.

use std::ops::Range;

use glam::{DMat3, DMat4, DVec2, DVec3};

use super::{Lens, NotRigid, Ray, Similarity, rigid};

/// A camera in OpenGL's and Blender's axes: x to the right, y up, looking along −z.
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
    /// The projection and its distortion.
    pub lens: Lens,
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
            lens: Lens::PINHOLE,
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
        let [width, height] = size;
        let lens = Lens::PINHOLE;
        Ok(Self { width, height, focal: [focal; 2], principal, lens, world_from_camera, position })
    }

    /// The row-major camera-to-world matrix, as accepted by [`Camera::posed`].
    pub fn pose(&self) -> [f64; 16] {
        let [x, y, z] = self.world_from_camera.to_cols_array_2d().map(DVec3::from);
        DMat4::from_cols(x.extend(0.0), y.extend(0.0), z.extend(0.0), self.position.extend(1.0))
            .transpose()
            .to_cols_array()
    }

    /// The ray from the camera through the picture point (x, y), in pixels from the top left corner. `None` where the
    /// lens sees nothing: never for a pinhole, beyond the fold of a distortion or the sphere of directions for others.
    pub fn ray_through(&self, x: f64, y: f64) -> Option<Ray> {
        let point = DVec2::new((x - self.principal[0]) / self.focal[0], (y - self.principal[1]) / self.focal[1]);
        let in_camera = if self.lens.is_pinhole() {
            DVec3::new(point.x, -point.y, -1.0)
        } else {
            let direction = self.lens.direction(point)?;
            DVec3::new(direction.x, -direction.y, -direction.z)
        };
        Some(Ray { origin: self.position, direction: (self.world_from_camera * in_camera).normalize() })
    }

    /// The ray through the center of pixel (`column`, `row`); `None` as for [`Camera::ray_through`].
    pub fn ray(&self, column: u32, row: u32) -> Option<Ray> {
        self.ray_through(f64::from(column) + 0.5, f64::from(row) + 0.5)
    }

    /// The rays of all pixels of `rows`, row by row.
    pub fn rays(&self, rows: Range<u32>) -> impl Iterator<Item = Option<Ray>> + '_ {
        rows.flat_map(move |row| (0..self.width).map(move |column| self.ray(column, row)))
    }

    /// \[height\]\[width\] true for the pixels that have a ray; `None` if all do.
    pub fn seen_pixels(&self) -> Option<Vec<bool>> {
        if self.lens.is_pinhole() {
            return None;
        }
        let has_ray = |ray: Option<Ray>| ray.is_some();
        // A lens sees less the farther from its axis, so that a picture whose border is seen is seen wholly.
        let [right, bottom] = [self.width - 1, self.height - 1];
        let border = (0..self.width).flat_map(|x| [(x, 0), (x, bottom)]);
        let border = border.chain((0..self.height).flat_map(|y| [(0, y), (right, y)]));
        let is_whole = border.into_iter().all(|(x, y)| has_ray(self.ray(x, y)));
        (!is_whole).then(|| self.rays(0..self.height).map(has_ray).collect())
    }

    /// The picture point, in pixels from the top left corner, on which `point` of the world falls, inside the picture or
    /// not. `None` behind a perspective camera and beyond the fold of a distortion.
    pub fn project(&self, point: DVec3) -> Option<DVec2> {
        let seen = self.world_from_camera.transpose() * (point - self.position);
        let at = self.lens.point(DVec3::new(seen.x, -seen.y, -seen.z))?;
        Some(DVec2::from(self.focal) * at + DVec2::from(self.principal))
    }

    /// True if the picture point `at`, in pixels from the top left corner, is in the picture.
    pub fn is_inside(&self, at: DVec2) -> bool {
        (0.0..=f64::from(self.width)).contains(&at.x) && (0.0..=f64::from(self.height)).contains(&at.y)
    }

    /// This camera in the target space of `map`, with the same view of the scene.
    pub fn mapped(&self, map: &Similarity) -> Self {
        Self {
            world_from_camera: DMat3::from_quat(map.rotation) * self.world_from_camera,
            position: map.point(self.position),
            ..*self
        }
    }

    /// The angle between the orientations of two cameras, in degrees.
    pub fn degrees_to(&self, other: &Self) -> f64 {
        let turn = self.world_from_camera.transpose() * other.world_from_camera;
        // The cosine of a small angle loses half of its digits, the sine none.
        let sine = 0.5
            * DVec3::new(turn.y_axis.z - turn.z_axis.y, turn.z_axis.x - turn.x_axis.z, turn.x_axis.y - turn.y_axis.x)
                .length();
        let cosine = 0.5 * (turn.x_axis.x + turn.y_axis.y + turn.z_axis.z - 1.0);
        sine.atan2(cosine).to_degrees()
    }

    /// The pinhole camera of the same view and size: its focal lengths and its principal point are this camera's, so that
    /// both pictures agree at the principal point.
    pub fn undistorted(&self) -> Self {
        Self { lens: Lens::PINHOLE, ..*self }
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

    /// The camera of the same view in a picture of `size` pixels: the whole picture, whose columns and rows are stretched
    /// each by its own factor.
    pub fn resized(&self, size: [u32; 2]) -> Self {
        let [x, y] = [f64::from(size[0]) / f64::from(self.width), f64::from(size[1]) / f64::from(self.height)];
        Self {
            width: size[0],
            height: size[1],
            focal: [self.focal[0] * x, self.focal[1] * y],
            principal: [self.principal[0] * x, self.principal[1] * y],
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
        assert!((camera.ray_through(2.0, 1.0).unwrap().direction - DVec3::Y).length() < 1e-15);
        assert!(camera.ray(3, 0).unwrap().direction.x > 0.0, "columns grow to the right");
        assert!(camera.ray(3, 0).unwrap().direction.z > 0.0, "rows grow downwards");
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
        let difference = small.ray(1, 0).unwrap().direction - camera.ray_through(6.0, 2.0).unwrap().direction;
        assert!(difference.length() < 1e-15);
    }

    #[test]
    fn resized_pictures_show_the_same_at_their_corners() {
        let camera = Camera::looking_at([8, 6], 5.0, DVec3::new(1.0, -5.0, 2.0), DVec3::ZERO, DVec3::Z);
        let large = camera.resized([20, 24]);
        for (small, large) in [([0.0, 0.0], camera.ray_through(0.0, 0.0)), ([20.0, 24.0], camera.ray_through(8.0, 6.0))]
            .map(|(corner, ray)| (large.ray_through(corner[0], corner[1]), ray))
        {
            assert!((small.unwrap().direction - large.unwrap().direction).length() < 1e-15);
        }
    }
}
