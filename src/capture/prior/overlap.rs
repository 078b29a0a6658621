//! The intersection test of convex bodies with axis-aligned boxes, by separating axes (Gottschalk, Lin and Manocha,
//! "OBBTree", SIGGRAPH 1996; for triangles Akenine-Möller, "Fast 3D Triangle-Box Overlap Testing", 2001).

use glam::{DAffine3, DVec3};

use strivec_format::geometry::Aabb;

/// A triangle, which may be degenerate: a segment or a point.
#[derive(Clone, Copy, Debug)]
pub(super) struct Triangle {
    /// Corners.
    pub(super) corners: [DVec3; 3],
}

/// The image of a box under an affine map.
#[derive(Clone, Copy, Debug)]
pub(super) struct Parallelepiped {
    corners: [DVec3; 8],
    edges: [DVec3; 3],
}

/// A convex body that [`meets`] a box or does not.
pub(super) trait Convex {
    /// Corners of the body.
    fn corners(&self) -> &[DVec3];

    /// The smallest axis-aligned box that contains it.
    fn bounds(&self) -> Aabb {
        Aabb::from_points(self.corners().iter().copied())
    }

    /// Calls `test` with candidates for separating axes, apart from the box's own. Returns true at the first for which
    /// `test` holds.
    fn any_axis(&self, test: impl FnMut(DVec3) -> bool) -> bool;
}

impl Convex for Triangle {
    fn corners(&self) -> &[DVec3] {
        &self.corners
    }

    #[inline]
    fn any_axis(&self, mut test: impl FnMut(DVec3) -> bool) -> bool {
        let [a, b, c] = self.corners;
        let edges = [b - a, c - b, a - c];
        test(edges[0].cross(edges[1])) || edges.into_iter().any(|edge| across(edge).into_iter().any(&mut test))
    }
}

impl Parallelepiped {
    /// The image of `body` under `map`.
    pub(super) fn image(body: &Aabb, map: &DAffine3) -> Self {
        let size = body.size();
        let edges = [0, 1, 2].map(|a| map.matrix3.col(a) * size[a]);
        let first = map.transform_point3(body.min);
        let corner = |n: usize| (0..3).filter(|a| n >> a & 1 == 1).fold(first, |corner, a| corner + edges[a]);
        Self { corners: [0, 1, 2, 3, 4, 5, 6, 7].map(corner), edges }
    }
}

impl Convex for Parallelepiped {
    fn corners(&self) -> &[DVec3] {
        &self.corners
    }

    fn any_axis(&self, mut test: impl FnMut(DVec3) -> bool) -> bool {
        let [u, v, w] = self.edges;
        let normals = [u.cross(v), v.cross(w), w.cross(u)];
        normals.into_iter().any(&mut test) || self.edges.into_iter().any(|edge| across(edge).into_iter().any(&mut test))
    }
}

/// The convex hull of a center plus and minus each of three vectors, which may be 0.
#[derive(Clone, Copy, Debug)]
pub(super) struct Octahedron {
    corners: [DVec3; 6],
    axes: [DVec3; 3],
}

impl Octahedron {
    /// The octahedron of `center` and `axes`.
    pub(super) fn new(center: DVec3, axes: [DVec3; 3]) -> Self {
        let [a, b, c] = axes;
        Self { corners: [a, -a, b, -b, c, -c].map(|offset| center + offset), axes }
    }
}

impl Convex for Octahedron {
    fn corners(&self) -> &[DVec3] {
        &self.corners
    }

    fn any_axis(&self, mut test: impl FnMut(DVec3) -> bool) -> bool {
        let [a, b, c] = self.axes;
        let edges = [a - b, a + b, b - c, b + c, c - a, c + a];
        let normals = [(a - b).cross(a - c), (a - b).cross(a + c), (a + b).cross(a - c), (a + b).cross(a + c)];
        // A flat one needs the normal of its plane.
        let planes = [a.cross(b), b.cross(c), c.cross(a)];
        normals.into_iter().chain(planes).any(&mut test)
            || edges.into_iter().chain(self.axes).any(|edge| across(edge).into_iter().any(&mut test))
    }
}

/// The cross products of the box's axes with `edge`.
fn across(edge: DVec3) -> [DVec3; 3] {
    [DVec3::new(0.0, -edge.z, edge.y), DVec3::new(edge.z, 0.0, -edge.x), DVec3::new(-edge.y, edge.x, 0.0)]
}

/// True if `body` and the closed box `cell` intersect. Touching counts; a caller for which it has to count within
/// rounding grows the box.
pub(super) fn meets(body: &impl Convex, cell: &Aabb) -> bool {
    let bounds = body.bounds();
    if !(bounds.min.cmple(cell.max).all() && cell.min.cmple(bounds.max).all()) {
        return false;
    }
    let (center, half) = (cell.center(), 0.5 * cell.size());
    !body.any_axis(|axis| {
        // Zero directions of degenerate bodies separate nothing: all numbers here are 0 then.
        let reach = half.dot(axis.abs());
        let along = body.corners().iter().map(|&p| (p - center).dot(axis));
        let (least, most) = along.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, m), d| (l.min(d), m.max(d)));
        least > reach || most < -reach
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const UNIT: Aabb = Aabb { min: DVec3::ZERO, max: DVec3::ONE };

    fn triangle(corners: [[f64; 3]; 3]) -> Triangle {
        Triangle { corners: corners.map(DVec3::from) }
    }

    #[test]
    fn triangles_whose_bounds_meet_the_box_may_still_miss_it() {
        // Cuts off the corner (1, 1, 1) at distance 0.05 and passes by it at 0.05.
        let across_the_corner =
            |d: f64| triangle([[d, 1.5, 1.5], [1.5, d, 1.5], [1.5, 1.5, d]].map(|c| c.map(|v| v - 0.5)));
        assert!(meets(&across_the_corner(1.0), &UNIT));
        assert!(!meets(&triangle([[2.9, 0.1, 0.5], [0.1, 2.9, 0.5], [2.9, 2.9, 0.5]]), &UNIT), "beside an edge");
        assert!(meets(&triangle([[1.9, 0.0, 0.5], [0.0, 1.9, 0.5], [2.0, 2.0, 0.5]]), &UNIT));
    }

    #[test]
    fn degenerate_triangles_are_segments_and_points() {
        assert!(meets(&triangle([[0.5; 3]; 3]), &UNIT));
        assert!(!meets(&triangle([[1.5, 0.5, 0.5]; 3]), &UNIT));
        let segment = |from: [f64; 3], to: [f64; 3]| triangle([from, to, from]);
        assert!(meets(&segment([-1.0, 0.5, 0.5], [2.0, 0.5, 0.5]), &UNIT));
        assert!(!meets(&segment([0.5, -0.6, 0.5], [-0.6, 0.5, 0.5]), &UNIT), "past an edge of the box");
    }

    #[test]
    fn a_face_that_touches_counts() {
        assert!(meets(&triangle([[1.0, 0.2, 0.2], [1.0, 0.8, 0.2], [1.0, 0.2, 0.8]]), &UNIT));
    }

    #[test]
    fn agrees_with_dense_sampling() {
        let random = strivec_format::random::Random::new(1, "overlap");
        let mut next = 0_u64;
        let mut point = |from: f64, to: f64| {
            next += 3;
            let of = |n: u64| from + (to - from) * random.uniform(next + n);
            DVec3::new(of(0), of(1), of(2))
        };
        let (mut hits, mut thin) = (0, 0);
        for _ in 0..3000 {
            let body = Triangle { corners: [point(-1.0, 2.0), point(-1.0, 2.0), point(-1.0, 2.0)] };
            let [a, b, c] = body.corners;
            let sampled = (0..=60).any(|i| {
                (0..=60 - i).any(|j| {
                    let (u, v) = (f64::from(i) / 60.0, f64::from(j) / 60.0);
                    UNIT.contains(a + u * (b - a) + v * (c - a))
                })
            });
            let exact = meets(&body, &UNIT);
            assert!(exact || !sampled, "{body:?}");
            hits += u32::from(exact);
            thin += u32::from(exact && !sampled);
        }
        assert!(hits > 600 && thin * 20 < hits, "{thin} of {hits}");
    }

    #[test]
    fn turned_boxes_meet_by_their_volume() {
        let turned = |at: f64| {
            let map = DAffine3::from_translation(DVec3::new(at, at, 0.5))
                * DAffine3::from_rotation_z(std::f64::consts::FRAC_PI_4);
            Parallelepiped::image(&Aabb { min: DVec3::splat(-0.5), max: DVec3::splat(0.5) }, &map)
        };
        // Along the diagonal the turned square reaches half an edge towards the corner.
        let corner = |d: f64| 1.0 + d / 2.0_f64.sqrt();
        assert!(meets(&turned(corner(0.49)), &UNIT));
        assert!(!meets(&turned(corner(0.51)), &UNIT), "its bounds meet, it does not");
        assert!(meets(&turned(0.5), &Aabb { min: DVec3::splat(0.49), max: DVec3::splat(0.51) }), "inside");
    }
}
