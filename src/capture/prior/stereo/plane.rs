//! Planes before a camera.

use glam::{DVec2, DVec3};

use strivec_format::geometry::Camera;

/// A plane before a camera: 1/depth on it is affine in the picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Plane {
    /// 1/depth in the middle of a patch.
    pub(super) inverse: f64,
    /// The change of 1/depth per pixel along columns and rows.
    pub(super) slope: DVec2,
    /// Patches look as similar elsewhere on their rays: it may be anywhere.
    pub(super) may_be_anywhere: bool,
}

impl Plane {
    /// This plane, seen from a middle that is `offset` pixels away.
    pub(super) fn moved(self, offset: DVec2) -> Self {
        Self { inverse: self.inverse + self.slope.dot(offset), ..self }
    }

    /// This plane in the precision in which planes are kept.
    pub(super) fn rounded(self) -> Self {
        Self { inverse: f64::from(self.inverse as f32), slope: self.slope.as_vec2().as_dvec2(), ..self }
    }

    /// The depth in the middle of the patch.
    pub(super) fn depth(self) -> f64 {
        1.0 / self.inverse
    }
}

/// The direction of the picture point `at` of a pinhole camera, of depth 1, in the axes of the picture.
#[inline(always)]
pub(super) fn direction(camera: &Camera, at: DVec2) -> DVec3 {
    ((at - DVec2::from(camera.principal)) / DVec2::from(camera.focal)).extend(1.0)
}
