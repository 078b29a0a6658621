//! Polygons as triangles, by ear clipping (Meisters, "Polygons Have Ears", 1975).

use glam::{DVec2, DVec3};

use super::Fault;

/// Corners of a polygon.
pub(super) const MAX_CORNERS: usize = 1 << 20;
/// Tests of a corner against a triangle, over all polygons of a file: some seconds.
const MAX_TESTS: u64 = 1 << 30;

/// Cuts the polygons of one file.
pub(super) struct Triangulator {
    tests_left: u64,
    flat: Vec<DVec2>,
    next: Vec<usize>,
    previous: Vec<usize>,
}

impl Default for Triangulator {
    fn default() -> Self {
        Self { tests_left: MAX_TESTS, flat: Vec::new(), next: Vec::new(), previous: Vec::new() }
    }
}

impl Triangulator {
    /// Calls `each` with the corners of each triangle of the polygon of `count` corners, which `at` places. A polygon
    /// that all triangles around its first corner cover, as they do if it is convex, is cut into these; other polygons
    /// lose one ear after the other. Polygons that intersect themselves, and those after the limit of tests of a file,
    /// are cut into some triangles over the same corners.
    ///
    /// # Errors
    ///
    /// If there are more than [`MAX_CORNERS`] corners, and those of `each`.
    pub(super) fn cut(
        &mut self,
        count: usize,
        at: impl Fn(usize) -> DVec3,
        mut each: impl FnMut([usize; 3]) -> Result<(), Fault>,
    ) -> Result<(), Fault> {
        Fault::unless_within("corners of a polygon", MAX_CORNERS as u64, count as u64)?;
        if count <= 3 || !self.flatten(count, at) || self.is_fan() {
            return (2..count).try_for_each(|n| each([0, n - 1, n]));
        }
        self.next.clear();
        self.next.extend((1..count).chain([0]));
        self.previous.clear();
        self.previous.extend([count - 1].into_iter().chain(0..count - 1));
        let (mut corner, mut left, mut refused) = (0, count, 0);
        while left > 3 && self.tests_left > 0 {
            let [a, b, c] = [self.previous[corner], corner, self.next[corner]];
            // After a whole round without an ear the polygon intersects itself.
            if refused < left && !self.is_ear([a, b, c]) {
                (corner, refused) = (c, refused + 1);
                continue;
            }
            each([a, b, c])?;
            (self.next[a], self.previous[c]) = (c, a);
            (corner, left, refused) = (c, left - 1, 0);
        }
        let mut second = self.next[corner];
        for _ in 2..left {
            let third = self.next[second];
            each([corner, second, third])?;
            second = third;
        }
        Ok(())
    }

    /// Projects the corners along the axis nearest to the polygon's normal, counterclockwise. Returns false if there is
    /// no normal.
    fn flatten(&mut self, count: usize, at: impl Fn(usize) -> DVec3) -> bool {
        // Newell's method, relative to a corner to avoid cancellation far from the origin.
        let origin = at(0);
        let mut normal = DVec3::ZERO;
        let mut last = at(count - 1) - origin;
        for n in 0..count {
            let corner = at(n) - origin;
            normal += last.cross(corner);
            last = corner;
        }
        let axis = (0..3).max_by(|&a, &b| normal[a].abs().total_cmp(&normal[b].abs())).unwrap_or(2);
        if !normal.is_finite() || normal[axis] == 0.0 {
            return false;
        }
        let (mut u, mut v) = ((axis + 1) % 3, (axis + 2) % 3);
        if normal[axis] < 0.0 {
            (u, v) = (v, u);
        }
        self.flat.clear();
        self.flat.extend((0..count).map(|n| at(n) - origin).map(|corner| DVec2::new(corner[u], corner[v])));
        true
    }

    /// True if no triangle around the first corner is clockwise.
    fn is_fan(&self) -> bool {
        self.flat.windows(2).skip(1).all(|pair| (pair[0] - self.flat[0]).perp_dot(pair[1] - self.flat[0]) >= 0.0)
    }

    /// True if the triangle lies inside the remaining polygon.
    fn is_ear(&mut self, [a, b, c]: [usize; 3]) -> bool {
        let corners = [self.flat[a], self.flat[b], self.flat[c]];
        let turn = |[a, b, c]: [DVec2; 3]| (b - a).perp_dot(c - a);
        let area = turn(corners);
        if area.is_nan() || area < 0.0 {
            return false;
        }
        let mut other = self.next[c];
        while other != a {
            self.tests_left = self.tests_left.saturating_sub(1);
            let at = self.flat[other];
            let [a, b, c] = corners;
            // Equal corners are those of a bridge to a hole.
            let apart = at != a && at != b && at != c;
            if apart && [[a, b, at], [b, c, at], [c, a, at]].into_iter().all(|side| turn(side) >= 0.0) {
                return false;
            }
            other = self.next[other];
        }
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cut(corners: &[DVec3]) -> Vec<[usize; 3]> {
        let mut triangles = Vec::new();
        let each = |triangle| {
            triangles.push(triangle);
            Ok(())
        };
        Triangulator::default().cut(corners.len(), |n| corners[n], each).unwrap();
        triangles
    }

    /// Sum of the triangles' areas, all of which have the sign of the polygon in the plane of x and y.
    fn area(corners: &[DVec3], triangles: &[[usize; 3]]) -> f64 {
        let of = |t: &[usize; 3]| 0.5 * (corners[t[1]] - corners[t[0]]).cross(corners[t[2]] - corners[t[0]]).z;
        triangles.iter().map(|triangle| of(triangle).abs()).sum()
    }

    fn flat(corners: &[[f64; 2]]) -> Vec<DVec3> {
        corners.iter().map(|[x, y]| DVec3::new(*x, *y, 0.0)).collect()
    }

    #[test]
    fn concave_polygons_are_covered_once() {
        // A comb of 40 teeth of width 1 and gaps of width 1, height 5, over a bar of height 1.
        let mut comb = vec![[0.0, 0.0], [80.0, 0.0]];
        for tooth in (0..40).rev() {
            let x = 2.0 * f64::from(tooth);
            comb.extend([[x + 1.0, 1.0], [x + 1.0, 6.0], [x, 6.0], [x, 1.0]]);
        }
        // The last tooth ends at 79, the bar at 80.
        let expected = 40.0 * 5.0 + 79.5;
        for turn in 0..comb.len() {
            let mut corners = flat(&comb);
            corners.rotate_left(turn);
            for reversed in [false, true] {
                if reversed {
                    corners.reverse();
                }
                let triangles = cut(&corners);
                assert_eq!(triangles.len(), corners.len() - 2);
                let found = area(&corners, &triangles);
                assert!((found - expected).abs() < 1e-9, "{turn}: {found}");
            }
        }
    }

    #[test]
    fn polygons_stand_in_space_and_keep_their_fan_if_it_covers_them() {
        let arrow = [[0.0, 0.0], [4.0, -2.0], [1.0, 0.0], [4.0, 2.0]];
        let map = |at: &DVec3| 1e6 * DVec3::ONE + DVec3::new(0.1 * at.x, at.y, at.x);
        let corners: Vec<_> = flat(&arrow).iter().map(map).collect();
        assert_eq!(cut(&corners), [[0, 1, 2], [0, 2, 3]], "from the dent's opposite");
        let mut turned = corners.clone();
        turned.rotate_left(1);
        let triangles = cut(&turned);
        assert!(triangles.iter().all(|t| t.contains(&1) && t.contains(&3)), "{triangles:?}");
        assert_eq!(cut(&flat(&[[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])), [[0, 1, 2], [0, 2, 3]]);
    }

    #[test]
    fn a_hole_behind_a_bridge_stays_open() {
        let ring = [
            [0.0, 0.0],
            [3.0, 0.0],
            [3.0, 3.0],
            [0.0, 3.0],
            [0.0, 0.0],
            [1.0, 1.0],
            [1.0, 2.0],
            [2.0, 2.0],
            [2.0, 1.0],
            [1.0, 1.0],
        ];
        let corners = flat(&ring);
        assert!((area(&corners, &cut(&corners)) - 8.0).abs() < 1e-12);
    }

    #[test]
    fn hostile_polygons_end() {
        let random = strivec_format::random::Random::new(2, "polygon");
        let at = |n: u64| DVec3::new(random.uniform(2 * n), random.uniform(2 * n + 1), 0.0);
        let wild: Vec<_> = (0..2000).map(at).collect();
        assert_eq!(cut(&wild).len(), 1998);
        let huge: Vec<_> = wild.iter().map(|at| f64::MAX * (*at - 0.5)).collect();
        assert_eq!(cut(&huge).len(), 1998);
        assert_eq!(cut(&vec![DVec3::ONE; 5000]).len(), 4998);
        assert!(cut(&[DVec3::ZERO; 2]).is_empty());
        // A million corners with as many dents: the limit of tests ends the search.
        let mut tight = Triangulator { tests_left: 1 << 20, ..Triangulator::default() };
        let zigzag = |n: usize| DVec3::new(n as f64, (n % 2) as f64 + 1e-9 * (n as f64).powi(2), 0.0);
        let mut count = 0;
        let each = |_| {
            count += 1;
            Ok(())
        };
        tight.cut(MAX_CORNERS, zigzag, each).unwrap();
        assert_eq!(count, MAX_CORNERS - 2);
        let error = tight.cut(MAX_CORNERS + 1, zigzag, |_| Ok(())).unwrap_err().to_string();
        assert_eq!(error, "corners of a polygon: at most 1048576 are read, found 1048577");
    }
}
