//! Axis-aligned boxes.

use std::fmt;

use glam::DVec3;

use super::Ray;

/// A closed axis-aligned box; both corners belong to it.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct Aabb {
    /// The smallest corner.
    pub min: DVec3,
    /// The largest corner.
    pub max: DVec3,
}

/// A box as text: its smallest and its largest corner.
impl fmt::Display for Aabb {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        // The debug format of a number has an exponent where it would have many digits.
        let corner = |[x, y, z]: [f64; 3]| format!("({x:?}, {y:?}, {z:?})");
        write!(f, "{} to {}", corner(self.min.to_array()), corner(self.max.to_array()))
    }
}

impl Aabb {
    /// The box that contains nothing: the neutral element of [`Aabb::union`].
    pub const EMPTY: Self = Self { min: DVec3::INFINITY, max: DVec3::NEG_INFINITY };

    /// The box of `center` ± `half`.
    pub fn around(center: DVec3, half: DVec3) -> Self {
        Self { min: center - half, max: center + half }
    }

    /// The smallest box that contains all `points`; [`Aabb::EMPTY`] if there are none.
    pub fn from_points(points: impl IntoIterator<Item = DVec3>) -> Self {
        points.into_iter().fold(Self::EMPTY, |b, p| Self { min: b.min.min(p), max: b.max.max(p) })
    }

    /// True if both corners are finite and the box has a positive extent on every axis.
    pub fn is_solid(&self) -> bool {
        self.min.is_finite() && self.max.is_finite() && self.min.cmplt(self.max).all()
    }

    /// True if `point` lies in the closed box.
    pub fn contains(&self, point: DVec3) -> bool {
        self.min.cmple(point).all() && point.cmple(self.max).all()
    }

    /// The smallest box that contains both boxes.
    pub fn union(&self, other: &Self) -> Self {
        Self { min: self.min.min(other.min), max: self.max.max(other.max) }
    }

    /// The intersection of both boxes; not solid if they do not overlap.
    pub fn intersection(&self, other: &Self) -> Self {
        Self { min: self.min.max(other.min), max: self.max.min(other.max) }
    }

    /// The box grown by `margin` to each side.
    pub fn grown(&self, margin: DVec3) -> Self {
        Self { min: self.min - margin, max: self.max + margin }
    }

    /// The eight corners: bit a of a corner's index is set if the corner is the largest along axis a.
    pub fn corners(&self) -> [DVec3; 8] {
        let pick = |corner: usize, axis: usize| if corner >> axis & 1 == 0 { self.min[axis] } else { self.max[axis] };
        [0, 1, 2, 3, 4, 5, 6, 7].map(|corner| DVec3::new(pick(corner, 0), pick(corner, 1), pick(corner, 2)))
    }

    /// Edge lengths.
    pub fn size(&self) -> DVec3 {
        self.max - self.min
    }

    /// The center.
    pub fn center(&self) -> DVec3 {
        0.5 * (self.min + self.max)
    }

    /// The ray parameters at which `ray` enters and leaves the box; the entry is negative if it starts inside.
    /// `None` if the ray misses the box or the box lies behind it.
    pub fn intersect(&self, ray: &Ray) -> Option<(f64, f64)> {
        let mut entry = f64::NEG_INFINITY;
        let mut exit = f64::INFINITY;
        for axis in 0..3 {
            let (origin, direction) = (ray.origin[axis], ray.direction[axis]);
            if direction == 0.0 {
                // Parallel to this slab: inside it everywhere or nowhere. (0/0 must not reach the comparison.)
                if origin < self.min[axis] || origin > self.max[axis] {
                    return None;
                }
                continue;
            }
            let to_min = (self.min[axis] - origin) / direction;
            let to_max = (self.max[axis] - origin) / direction;
            entry = entry.max(to_min.min(to_max));
            exit = exit.min(to_min.max(to_max));
        }
        (entry <= exit && exit >= 0.0).then_some((entry, exit))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const UNIT: Aabb = Aabb { min: DVec3::NEG_ONE, max: DVec3::ONE };

    #[test]
    fn ray_through_the_middle_enters_and_leaves() {
        let ray = Ray { origin: DVec3::new(-3.0, 0.0, 0.0), direction: DVec3::X };
        assert_eq!(UNIT.intersect(&ray), Some((2.0, 4.0)));
    }

    #[test]
    fn ray_parallel_to_a_face_hits_on_it_and_misses_beside_it() {
        let on = Ray { origin: DVec3::new(-3.0, 1.0, 0.0), direction: DVec3::X };
        let beside = Ray { origin: DVec3::new(-3.0, 1.0 + 1e-12, 0.0), direction: DVec3::X };
        assert_eq!(UNIT.intersect(&on), Some((2.0, 4.0)));
        assert_eq!(UNIT.intersect(&beside), None);
    }

    #[test]
    fn box_behind_the_ray_is_missed_and_a_ray_from_inside_has_a_negative_entry() {
        let behind = Ray { origin: DVec3::new(3.0, 0.0, 0.0), direction: DVec3::X };
        let inside = Ray { origin: DVec3::ZERO, direction: DVec3::X };
        assert_eq!(UNIT.intersect(&behind), None);
        assert_eq!(UNIT.intersect(&inside), Some((-1.0, 1.0)));
    }
}
