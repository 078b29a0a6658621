//! Whether 32 bits hold coordinates: those of a scene far from the origin, as in geographic coordinates, need more.

use glam::DVec3;

use super::Space;
use super::marching::MAX_RESOLUTION;
use strivec_format::geometry::Aabb;
use strivec_format::model::Scene;

/// Different coordinates that 32 bits must have along the edge of the smallest cell of a surface.
const STEPS_OF_CELL: f64 = 1024.0;

/// Coordinates that 32 bits hold too coarsely: at the farthest of them, neighboring numbers of 32 bits are farther apart
/// than 2^-21 of the longest edge of the box around all, a 1024th of the smallest cell of [`surface`](super::surface).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CoarseCoordinates {
    /// The box around the coordinates.
    pub bounds: Aabb,
    /// The distance of neighboring numbers of 32 bits at the coordinate that is farthest from 0.
    pub spacing: f64,
}

impl CoarseCoordinates {
    /// The coordinates of the box `bounds`; `None` if 32 bits are enough, as where nothing is more than four edges of the
    /// box away from the origin, or if the box is empty.
    ///
    /// ```
    /// use glam::DVec3;
    /// use strivec_export::CoarseCoordinates;
    /// use strivec_format::geometry::Aabb;
    ///
    /// let at = |x: f64| CoarseCoordinates::of(&Aabb::around(DVec3::X * x, DVec3::ONE));
    /// assert_eq!(at(3.0), None);
    /// assert_eq!(at(5e6).map(|coarse| coarse.spacing), Some(0.5));
    /// ```
    pub fn of(bounds: &Aabb) -> Option<Self> {
        let farthest = bounds.min.abs().max(bounds.max.abs()).max_element().min(f32::MAX.into()) as f32;
        let spacing = f64::from(farthest.next_up()) - f64::from(farthest);
        let edge = bounds.size().max_element();
        let is_coarse = spacing * STEPS_OF_CELL * f64::from(MAX_RESOLUTION) > edge;
        (is_coarse && edge >= 0.0).then_some(Self { bounds: *bounds, spacing })
    }

    /// The coordinates of the bounds of `scene` in `space`.
    pub fn of_scene(scene: &Scene, space: Space) -> Option<Self> {
        let map = space.map_from_model(&scene.frame);
        Self::of(&Aabb::from_points(scene.bounds.corners().map(|corner| map.point(corner))))
    }

    /// The middle of the box, rounded to numbers of 32 bits.
    pub fn middle(&self) -> DVec3 {
        self.bounds.center().as_vec3().as_dvec3()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn coordinates_are_coarse_from_some_edges_of_their_box_away_on() {
        let at = |x: f64, edge: f64| CoarseCoordinates::of(&Aabb::around(DVec3::Z * -x, DVec3::splat(0.5 * edge)));
        for edge in [1e-3, 1.0, 3.7e5] {
            assert_eq!([0.0, 1.0, 3.4].map(|edges| at(edges * edge, edge)), [None; 3], "{edge}");
            assert!([8.0, 1e3, 1e9].iter().all(|edges| at(edges * edge, edge).is_some()), "{edge}");
        }
        assert_eq!(at(5e6, 10.0).map(|coarse| coarse.middle()), Some(DVec3::Z * -5e6));
        assert_eq!(CoarseCoordinates::of(&Aabb::EMPTY), None);
        assert_eq!(at(1e39, 1.0).map(|coarse| coarse.spacing), Some(f64::INFINITY));
    }
}
