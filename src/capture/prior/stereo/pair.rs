//! How similar a patch of one photograph, on a plane, is in another.

use glam::{DMat3, DVec2, DVec3};

use super::plane::{Plane, direction};
use super::shot::{Patch, StereoShot};
use strivec_format::geometry::Camera;

/// The largest factor by which a patch may be larger or smaller in another photograph.
const MAX_ZOOM: f64 = 2.0;

/// The map from the picture of one camera to that of another.
pub(super) struct Pair<'a> {
    other: &'a StereoShot,
    /// From the axes of the first picture to those of the other.
    rotation: DMat3,
    /// The first camera in the axes of the other picture.
    translation: DVec3,
}

impl<'a> Pair<'a> {
    pub(super) fn new(camera: &Camera, other: &'a StereoShot) -> Self {
        // Axes of the pictures: y down, z ahead.
        let flip = DMat3::from_diagonal(DVec3::new(1.0, -1.0, -1.0));
        let to_other = flip * other.camera.world_from_camera.transpose();
        Self {
            other,
            rotation: to_other * camera.world_from_camera * flip,
            translation: to_other * (camera.position - other.camera.position),
        }
    }

    /// The other picture's point of the point of 1/depth `inverse` on the ray along `direction`, of depth 1; `None` behind
    /// the camera.
    #[inline(always)]
    pub(super) fn point(&self, direction: DVec3, inverse: f64) -> Option<DVec2> {
        let seen = self.rotation * direction + inverse * self.translation;
        let camera = &self.other.camera;
        let at = DVec2::new(seen.x, seen.y) / seen.z;
        (seen.z > 1e-6).then(|| at * DVec2::from(camera.focal) + DVec2::from(camera.principal))
    }

    /// The similarity, from −1 to 1, of the `patch` around the picture point `middle` on `plane`; `None` where the other
    /// photograph does not show it.
    #[inline(always)]
    pub(super) fn similarity(&self, camera: &Camera, middle: DVec2, patch: &Patch, plane: Plane) -> Option<f32> {
        let at = |offset: DVec2| self.point(direction(camera, middle + offset), plane.moved(offset).inverse);
        let origin = at(DVec2::ZERO)?;
        let (right, down) = (at(DVec2::X)? - origin, at(DVec2::Y)? - origin);
        let zoom = right.perp_dot(down);
        if !(MAX_ZOOM.powi(-2)..MAX_ZOOM.powi(2)).contains(&zoom) {
            return None;
        }
        self.other.similarity(patch, origin, right, down)
    }
}
