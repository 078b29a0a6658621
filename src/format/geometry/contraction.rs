//! The contraction of unbounded scenes, and the spacing of samples along rays through them (spec 4.9).

use glam::DVec3;

use super::{Aabb, Ray};

/// Half the diagonal of the inner cube: beyond this distance from the origin, no ray is inside it.
const INNER_RADIUS: f64 = 1.732_050_807_568_877_2;

/// Spacing parameters of samples lie between −this and this.
pub const MAX_SPACING: f64 = 2.0 * INNER_RADIUS;

/// Spacing parameters end this far from ±[`MAX_SPACING`], where the distance is infinite.
const END: f64 = 1e-12;

/// The contraction of all space, in the maximum norm, into the cube of [−1 − b, 1 + b]³. The inner cube [−1, 1]³ stays
/// as it is.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct Contraction {
    /// b, the width of the shell around the inner cube that holds the rest of space; more than 0, at most 1.
    pub shell: f64,
}

impl Contraction {
    /// The cube that contains all contracted points.
    pub fn bounds(&self) -> Aabb {
        Aabb::around(DVec3::ZERO, DVec3::splat(1.0 + self.shell))
    }

    /// The image of `point`: x if ‖x‖ ≤ 1, else x/‖x‖·(1 + b − b/‖x‖), in the maximum norm.
    #[inline(always)]
    pub fn contract(&self, point: DVec3) -> DVec3 {
        let norm = point.abs().max_element();
        if norm <= 1.0 { point } else { point * ((1.0 + self.shell - self.shell / norm) / norm) }
    }

    /// The point whose image is `contracted`, which lies in the open bounds; points on the bounds or beyond are taken
    /// as very far away.
    pub fn expand(&self, contracted: DVec3) -> DVec3 {
        let norm = contracted.abs().max_element();
        if norm <= 1.0 {
            return contracted;
        }
        contracted * (self.shell / (1.0 + self.shell - norm).max(END) / norm)
    }

    /// The smallest box that contains the image of the box `from`, which may be infinite.
    pub fn contract_box(&self, from: &Aabb) -> Aabb {
        // |y_a| grows with |x_a| and falls with the other coordinates' sizes.
        let least = from.min.max(DVec3::ZERO).max(-from.max);
        let most = from.min.abs().max(from.max.abs());
        let end = |axis: usize, value: f64, toward: f64| {
            let mut point = if value * toward > 0.0 { least } else { most };
            point[axis] = value;
            self.contract(point.clamp(DVec3::splat(-1.0 / END), DVec3::splat(1.0 / END)))[axis]
        };
        let corner = |corner: DVec3, toward: f64| DVec3::from([0, 1, 2].map(|axis| end(axis, corner[axis], toward)));
        Aabb { min: corner(from.min, -1.0), max: corner(from.max, 1.0) }
    }
}

/// The spacing of samples on a ray through a contracted scene. With s the distance from the ray's foot, the point
/// nearest to the origin, in units of q = max(1, |foot|/√3), the spacing parameter u is s while |s| ≤ √3, and linear
/// in 1/s beyond. Samples are even in u, so a ray has at most 4·√3/δ of them, however far it goes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spacing {
    /// The point of the ray's line nearest to the origin.
    pub foot: DVec3,
    /// The foot's distance along the ray; negative behind the ray's origin.
    pub foot_distance: f64,
    /// q.
    pub scale: f64,
}

impl Spacing {
    /// The spacing on `ray`.
    pub fn new(ray: &Ray) -> Self {
        let foot_distance = -ray.origin.dot(ray.direction);
        let foot = ray.at(foot_distance);
        Self { foot, foot_distance, scale: (foot.length() / INNER_RADIUS).max(1.0) }
    }

    /// The spacing parameter u of the point at distance `t` along the ray; `t` may be infinite.
    pub fn parameter(&self, t: f64) -> f64 {
        let s = (t - self.foot_distance) / self.scale;
        if s.abs() <= INNER_RADIUS { s } else { (MAX_SPACING - INNER_RADIUS * INNER_RADIUS / s.abs()).copysign(s) }
    }

    /// The distance from the foot of the point of spacing parameter `u`.
    #[inline(always)]
    pub fn from_foot(&self, u: f64) -> f64 {
        let far = INNER_RADIUS * INNER_RADIUS / (MAX_SPACING - u.abs()).max(END);
        self.scale * if u.abs() <= INNER_RADIUS { u } else { far.copysign(u) }
    }

    /// The point of spacing parameter `u` on the ray along `direction`, not contracted.
    #[inline(always)]
    pub fn point(&self, direction: DVec3, u: f64) -> DVec3 {
        self.foot + self.from_foot(u) * direction
    }

    /// A bound of the speed of contracted points outside the inner cube: by how much a coordinate changes with u.
    pub fn max_speed(&self, contraction: &Contraction) -> f64 {
        // With r = ‖x‖: the coordinates of x/r change by at most |foot|/r² per unit of s·q, those of b/r·x/r by at most
        // b/r² more. ds/du is at most s²/3, and r² at least (|foot|² + q²·s²)/3 and 1, so q/r²·ds/du is at most 1/q.
        ((1.0 + contraction.shell) * self.foot.length() + contraction.shell) / self.scale
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PAPER: Contraction = Contraction { shell: 0.4 };

    /// Points of a low-discrepancy sequence on a ball, at distances of 0.1 to 1e5.
    fn points() -> impl Iterator<Item = DVec3> {
        (1..400).map(|n| {
            let [a, b, c] = [0.819_172_513_4, 0.671_043_606_7, 0.549_700_477_9].map(|f| (f64::from(n) * f).fract());
            let direction = (2.0 * DVec3::new(a, b, c) - 1.0).normalize();
            direction * 10_f64.powf(6.0 * f64::from(n) / 400.0 - 1.0)
        })
    }

    #[test]
    fn the_inner_cube_stays_and_the_rest_fills_the_shell() {
        assert_eq!(PAPER.contract(DVec3::new(1.0, -0.3, 0.2)), DVec3::new(1.0, -0.3, 0.2));
        assert!((PAPER.contract(DVec3::new(2.0, 0.0, -1.0)) - DVec3::new(1.2, 0.0, -0.6)).length() < 1e-15);
        let far = PAPER.contract(DVec3::new(0.0, -1e9, 0.0)).y;
        assert!((-1.4..-1.4 + 1e-8).contains(&far), "{far}");
    }

    #[test]
    fn expansion_is_the_inverse() {
        for point in points() {
            let back = PAPER.expand(PAPER.contract(point));
            // 1 + b − ‖y‖ loses digits with the distance.
            assert!((back - point).length() <= 1e-15 * point.length() * (1.0 + point.length() / 0.4) * 4.0, "{point}");
        }
    }

    #[test]
    fn the_box_of_a_contracted_box_is_tight() {
        for [low, high] in
            [[[-3.0, -0.2, 1.5], [-2.0, 4.0, 9.0]], [[-0.5; 3], [0.7; 3]], [[2.0, 3.0, -1.0], [5.0, 7.0, -0.5]]]
        {
            let from = Aabb { min: DVec3::from(low), max: DVec3::from(high) };
            let found = PAPER.contract_box(&from);
            const STEPS: u32 = 40;
            let grid = (0..(STEPS + 1).pow(3)).map(|n| {
                let at = glam::UVec3::new(n % (STEPS + 1), n / (STEPS + 1) % (STEPS + 1), n / (STEPS + 1).pow(2));
                PAPER.contract(from.min + at.as_dvec3() / f64::from(STEPS) * from.size())
            });
            let exact = Aabb::from_points(grid);
            assert!((found.min - exact.min).abs().max_element() < 0.01, "{found:?} {exact:?}");
            assert!((found.max - exact.max).abs().max_element() < 0.01, "{found:?} {exact:?}");
            assert!(found.grown(DVec3::splat(1e-12)).union(&exact) == found.grown(DVec3::splat(1e-12)));
        }
        let all = Aabb { min: DVec3::NEG_INFINITY, max: DVec3::INFINITY };
        assert!((PAPER.contract_box(&all).max - 1.4).abs().max_element() < 1e-9);
    }

    #[test]
    fn parameter_and_distance_are_inverse_and_continuous() {
        for (origin, through) in points().zip(points().skip(7)) {
            let ray = Ray { origin, direction: (through - origin).normalize() };
            let spacing = Spacing::new(&ray);
            for u in [-3.4, -1.8, -1.7, -0.3, 0.0, 1.0, 1.733, 2.5, 3.3] {
                let t = spacing.foot_distance + spacing.from_foot(u);
                assert!((spacing.parameter(t) - u).abs() < 1e-9 * (1.0 + origin.length()), "{u}");
            }
            let [before, after] = [INNER_RADIUS - 1e-9, INNER_RADIUS + 1e-9].map(|u| spacing.from_foot(u));
            assert!((after - before - 2e-9 * spacing.scale).abs() < 1e-14 * spacing.scale, "one slope on both sides");
            assert!(spacing.parameter(f64::INFINITY) == MAX_SPACING);
        }
    }

    #[test]
    fn no_contracted_point_is_faster_than_the_bound() {
        let mut largest: f64 = 0.0;
        for (origin, through) in points().zip(points().skip(3)) {
            let ray = Ray { origin, direction: (through - origin).normalize() };
            let spacing = Spacing::new(&ray);
            let bound = spacing.max_speed(&PAPER);
            for k in -340..340 {
                let [before, after] = [0.0, 1e-5].map(|h| spacing.point(ray.direction, f64::from(k) * 0.01 + h));
                if before.abs().max_element() > 1.0 && after.abs().max_element() > 1.0 {
                    let moved = (PAPER.contract(after) - PAPER.contract(before)).abs().max_element() / 1e-5;
                    largest = largest.max(moved / bound);
                }
            }
        }
        assert!(largest <= 1.0 + 1e-4 && largest > 0.3, "{largest}");
    }
}
