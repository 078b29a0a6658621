//! Exact solids: a box, cut by an inner and an outer sphere or cylinder.
//!
//! This form includes blocks, rods, spheres, pipes, bowls and blocks with a hole, so rays, distances, occupancy and
//! tessellation need one routine each.

use glam::{DMat3, DVec3};

use strivec_format::geometry::{Aabb, Ray};

/// The point or axis from which [`Solid::round`] measures distances, in the solid's own space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum About {
    /// The origin: the round surfaces are spheres.
    Point,
    /// The z axis: the round surfaces are cylinders.
    Axis,
}

/// Keeps the points at distances from `inner` to `outer` from `about`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Round {
    pub(super) about: About,
    /// The inner radius; 0 if nothing is cut out.
    pub(super) inner: f64,
    /// The outer radius; infinite if only the box is the limit.
    pub(super) outer: f64,
}

/// A piece of a solid's surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Face {
    /// The box's face at the lower or upper end of an axis.
    Flat { axis: usize, upper: bool },
    /// The outer sphere or cylinder.
    Outer,
    /// The inner sphere or cylinder: the wall of a hole.
    Inner,
}

/// A closed solid: the points of `bounds` that `round` keeps.
#[derive(Clone, Debug)]
pub(super) struct Solid {
    /// Orthonormal; the columns are the solid's axes in the world.
    pub(super) world_from_local: DMat3,
    /// The origin of the solid's own space, in the world.
    pub(super) center: DVec3,
    /// The box, in the solid's own space.
    pub(super) bounds: Aabb,
    pub(super) round: Option<Round>,
    /// Center (in the world) and squared radius of a sphere around it.
    reach: (DVec3, f64),
}

/// One crossing of a ray and a solid's surface.
#[derive(Clone, Copy, Debug)]
pub(super) struct Crossing {
    /// Distance along the ray; negative behind its origin.
    pub(super) t: f64,
    pub(super) face: Face,
}

impl Solid {
    /// The solid that `bounds` and `round` keep, with its axes along the world's and its origin at `center`.
    fn new(center: DVec3, bounds: Aabb, round: Option<Round>) -> Self {
        let world_from_local = DMat3::IDENTITY;
        let mut solid = Self { world_from_local, center, bounds, round, reach: (center, 0.0) };
        solid.set_reach();
        solid
    }

    /// A ball of `radius`.
    pub(super) fn sphere(center: DVec3, radius: f64) -> Self {
        let round = Round { about: About::Point, inner: 0.0, outer: radius };
        Self::new(center, Aabb::around(DVec3::ZERO, DVec3::splat(radius)), Some(round))
    }

    /// A capped cylinder around its z axis.
    pub(super) fn rod(center: DVec3, radius: f64, half_length: f64) -> Self {
        Self::pipe(center, 0.0, radius, half_length)
    }

    /// A cylinder with a hole along its z axis.
    pub(super) fn pipe(center: DVec3, inner: f64, outer: f64, half_length: f64) -> Self {
        let bounds = Aabb::around(DVec3::ZERO, DVec3::new(outer, outer, half_length));
        Self::new(center, bounds, Some(Round { about: About::Axis, inner, outer }))
    }

    /// A box of `center` ± `half`.
    pub(super) fn block(center: DVec3, half: DVec3) -> Self {
        Self::new(center, Aabb::around(DVec3::ZERO, half), None)
    }

    /// The box `bounds` (around the origin) with a round hole along its z axis.
    pub(super) fn pierced_block(center: DVec3, bounds: Aabb, hole: f64) -> Self {
        Self::new(center, bounds, Some(Round { about: About::Axis, inner: hole, outer: f64::INFINITY }))
    }

    /// The lower half of a hollow ball: open towards its z axis.
    pub(super) fn bowl(center: DVec3, inner: f64, outer: f64) -> Self {
        let bounds = Aabb { min: DVec3::splat(-outer), max: DVec3::new(outer, outer, 0.0) };
        Self::new(center, bounds, Some(Round { about: About::Point, inner, outer }))
    }

    /// The solid turned about its origin.
    pub(super) fn turned(mut self, rotation: DMat3) -> Self {
        self.world_from_local = rotation * self.world_from_local;
        self.set_reach();
        self
    }

    fn set_reach(&mut self) {
        let radius = 0.5 * self.bounds.size().length() + 1e-6;
        self.reach = (self.world(self.bounds.center()), radius * radius);
    }

    /// `point`, in the world, mapped to the solid's own space.
    pub(super) fn local(&self, point: DVec3) -> DVec3 {
        self.world_from_local.transpose() * (point - self.center)
    }

    /// `point`, in the solid's own space, mapped to the world.
    pub(super) fn world(&self, point: DVec3) -> DVec3 {
        self.world_from_local * point + self.center
    }

    /// The depth of `point` (in the world) below the nearest of the solid's surfaces; 0 on the surface. Negative
    /// outside, with an absolute value of at most the distance from the solid.
    pub(super) fn depth(&self, point: DVec3) -> f64 {
        let p = self.local(point);
        let flat = (p - self.bounds.min).min(self.bounds.max - p).min_element();
        self.round.map_or(flat, |round| {
            let distance = round.about.offset(p).length();
            let inner = if round.inner > 0.0 { distance - round.inner } else { f64::INFINITY };
            flat.min(inner).min(round.outer - distance)
        })
    }

    /// The outward unit normal, in the world, of `face` at `point` (in the world).
    pub(super) fn normal(&self, face: Face, point: DVec3) -> DVec3 {
        let about = self.round.map_or(About::Point, |round| round.about);
        let local = match face {
            Face::Flat { axis, upper } => DVec3::AXES[axis] * if upper { 1.0 } else { -1.0 },
            Face::Outer => about.offset(self.local(point)).normalize(),
            Face::Inner => -about.offset(self.local(point)).normalize(),
        };
        self.world_from_local * local
    }

    /// True if a sphere around the solid lies on the ray, ahead of its origin or around it: a quick test that is
    /// necessary for a crossing at a positive distance.
    #[inline]
    pub(super) fn may_meet(&self, ray: &Ray) -> bool {
        let to_reach = self.reach.0 - ray.origin;
        let (along, squared) = (to_reach.dot(ray.direction), to_reach.length_squared());
        squared - along * along <= self.reach.1 && (along >= 0.0 || squared <= self.reach.1)
    }

    /// The spans of the line of `ray` within the solid, in order: two if a hole lies between them.
    pub(super) fn spans(&self, ray: &Ray) -> [Option<[Crossing; 2]>; 2] {
        let to_local = self.world_from_local.transpose();
        let (origin, direction) = (to_local * (ray.origin - self.center), to_local * ray.direction);
        // The round surface first: its miss is cheaper to compute.
        let outside = match self.round {
            Some(round) if round.outer.is_finite() => match round.about.roots(origin, direction, round.outer) {
                None => return [None, None],
                roots => roots,
            },
            _ => None,
        };
        let Some([mut enter, mut leave]) = self.flat_span(origin, direction) else { return [None, None] };
        if let Some([a, b]) = outside {
            if a > enter.t {
                enter = Crossing { t: a, face: Face::Outer };
            }
            if b < leave.t {
                leave = Crossing { t: b, face: Face::Outer };
            }
        }
        let Some(round) = self.round else { return [Some([enter, leave]), None] };
        let span = |enter: Crossing, leave: Crossing| (enter.t < leave.t).then_some([enter, leave]);
        let hole = if round.inner > 0.0 { round.about.roots(origin, direction, round.inner) } else { None };
        let Some([a, b]) = hole else { return [span(enter, leave), None] };
        let before = if a < leave.t { Crossing { t: a, face: Face::Inner } } else { leave };
        let after = if b > enter.t { Crossing { t: b, face: Face::Inner } } else { enter };
        // A hole that ends before the box is entered leaves the second span alone, whole.
        [span(enter, before), span(after, leave)]
    }

    /// The crossings of a line into and out of `bounds`, all in the solid's own space.
    fn flat_span(&self, origin: DVec3, direction: DVec3) -> Option<[Crossing; 2]> {
        let mut enter = Crossing { t: f64::NEG_INFINITY, face: Face::Outer };
        let mut leave = Crossing { t: f64::INFINITY, face: Face::Outer };
        for axis in 0..3 {
            let (o, d) = (origin[axis], direction[axis]);
            if d == 0.0 {
                if o < self.bounds.min[axis] || o > self.bounds.max[axis] {
                    return None;
                }
                continue;
            }
            let upwards = d > 0.0;
            let (to_min, to_max) = ((self.bounds.min[axis] - o) / d, (self.bounds.max[axis] - o) / d);
            let (first, last) = if upwards { (to_min, to_max) } else { (to_max, to_min) };
            if first > enter.t {
                enter = Crossing { t: first, face: Face::Flat { axis, upper: !upwards } };
            }
            if last < leave.t {
                leave = Crossing { t: last, face: Face::Flat { axis, upper: upwards } };
            }
        }
        (enter.t < leave.t).then_some([enter, leave])
    }
}

impl About {
    /// The vector to `p` from this point or the nearest point of this axis, in the solid's own space.
    pub(super) fn offset(self, p: DVec3) -> DVec3 {
        match self {
            Self::Point => p,
            Self::Axis => DVec3::new(p.x, p.y, 0.0),
        }
    }

    /// The values of t at which the line origin + t·direction crosses the sphere or cylinder of `radius`; `None` if it
    /// misses or only touches it. A line along a cylinder inside it crosses it at ∓∞.
    fn roots(self, origin: DVec3, direction: DVec3, radius: f64) -> Option<[f64; 2]> {
        let (o, d) = (self.offset(origin), self.offset(direction));
        let (a, b, c) = (d.length_squared(), o.dot(d), o.length_squared() - radius * radius);
        if a == 0.0 {
            return (c < 0.0).then_some([f64::NEG_INFINITY, f64::INFINITY]);
        }
        let discriminant = b * b - a * c;
        (discriminant > 0.0).then(|| [(-b - discriminant.sqrt()) / a, (-b + discriminant.sqrt()) / a])
    }
}
