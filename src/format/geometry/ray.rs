//! Rays.

use glam::DVec3;

/// A half line from `origin` along the unit vector `direction`; its parameter is a distance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ray {
    /// The start of the ray.
    pub origin: DVec3,
    /// The direction of the ray, of length 1.
    pub direction: DVec3,
}

impl Ray {
    /// The point at distance `t`.
    pub fn at(&self, t: f64) -> DVec3 {
        self.origin + t * self.direction
    }
}
