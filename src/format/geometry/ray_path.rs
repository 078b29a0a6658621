//! The samples' positions along a ray (spec 4.8 and 4.9).

use glam::DVec3;

use super::{Aabb, Contraction, Ray, Spacing};

/// The path of a ray through model space, by a parameter u in which samples are even: the distance from the ray's
/// origin or, in a contracted scene, the spacing parameter.
#[derive(Clone, Copy, Debug)]
pub struct RayPath {
    ray: Ray,
    contraction: Option<(Contraction, Spacing)>,
    /// u of the first sample, and where samples end; `None` if there are none.
    pub span: Option<(f64, f64)>,
}

impl RayPath {
    /// The path of `ray` between the distances `near_far`: inside `bounds`, or anywhere in a contracted scene.
    pub fn new(ray: &Ray, bounds: &Aabb, contraction: Option<Contraction>, near_far: [f64; 2]) -> Self {
        let [near, far] = near_far;
        let contraction = contraction.map(|contraction| (contraction, Spacing::new(ray)));
        let span = match &contraction {
            None => bounds.intersect(ray).map(|(entry, exit)| (entry.max(near), exit.min(far))),
            Some((_, spacing)) => Some((spacing.parameter(near), spacing.parameter(far))),
        };
        Self { ray: *ray, contraction, span }
    }

    /// The distance along the ray at `u`.
    #[inline(always)]
    pub fn distance(&self, u: f64) -> f64 {
        match &self.contraction {
            None => u,
            Some((_, spacing)) => spacing.foot_distance + spacing.from_foot(u),
        }
    }

    /// The point at `u`, contracted if the scene is.
    #[inline(always)]
    pub fn position(&self, u: f64) -> DVec3 {
        match &self.contraction {
            None => self.ray.at(u),
            Some((contraction, spacing)) => contraction.contract(spacing.point(self.ray.direction, u)),
        }
    }

    /// The contraction and the spacing of samples; `None` if the path is straight.
    pub fn contraction(&self) -> Option<&(Contraction, Spacing)> {
        self.contraction.as_ref()
    }
}
