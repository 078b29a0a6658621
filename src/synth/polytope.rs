//! Convex polyhedra: boxes, cut by planes.

use glam::{DMat3, DVec2, DVec3};

use strivec_format::geometry::Aabb;

/// A convex polyhedron as its faces, each a convex polygon; empty if there are no faces.
pub(super) struct Polytope {
    faces: Vec<Vec<DVec3>>,
}

impl Polytope {
    /// The box `bounds` under x ↦ rotation · (x − origin).
    pub(super) fn of_box(bounds: &Aabb, rotation: DMat3, origin: DVec3) -> Self {
        let corner = |index: usize| {
            let pick = |axis: usize| if index >> axis & 1 == 0 { bounds.min[axis] } else { bounds.max[axis] };
            rotation * (DVec3::new(pick(0), pick(1), pick(2)) - origin)
        };
        let faces = [[0, 1, 3, 2], [4, 5, 7, 6], [0, 1, 5, 4], [2, 3, 7, 6], [0, 2, 6, 4], [1, 3, 7, 5]];
        Self { faces: faces.map(|face| face.map(corner).to_vec()).to_vec() }
    }

    /// Keeps the points with sign · p\[axis\] ≤ sign · limit.
    pub(super) fn cut(&mut self, axis: usize, sign: f64, limit: f64) {
        let beyond = |p: &DVec3| sign * (p[axis] - limit);
        if self.corners().all(|p| beyond(p) <= 0.0) {
            return;
        }
        let mut rim = Vec::new();
        for face in &mut self.faces {
            let mut kept = Vec::with_capacity(face.len() + 1);
            for (i, &p) in face.iter().enumerate() {
                let q = face[(i + 1) % face.len()];
                let (at_p, at_q) = (beyond(&p), beyond(&q));
                if at_p <= 0.0 {
                    kept.push(p);
                }
                if (at_p <= 0.0) != (at_q <= 0.0) {
                    let mut crossing = p + (q - p) * (at_p / (at_p - at_q));
                    crossing[axis] = limit;
                    kept.push(crossing);
                    rim.push(crossing);
                }
            }
            *face = kept;
        }
        self.faces.retain(|face| !face.is_empty());
        if rim.len() > 2 {
            // The cut is a convex polygon: its corners by angle around a point within.
            let middle = rim.iter().sum::<DVec3>() / rim.len() as f64;
            let flat = |p: &DVec3| DVec2::new((p - middle)[(axis + 1) % 3], (p - middle)[(axis + 2) % 3]);
            rim.sort_by(|a, b| {
                let angle = |p| super::portable::angle(flat(p).x, flat(p).y);
                angle(a).total_cmp(&angle(b))
            });
            self.faces.push(rim);
        }
    }

    /// True if no point is left.
    pub(super) fn is_empty(&self) -> bool {
        self.faces.is_empty()
    }

    /// The corners, each repeated for every face that meets there.
    pub(super) fn corners(&self) -> impl Iterator<Item = &DVec3> {
        self.faces.iter().flatten()
    }

    /// The triangles of all faces, each face as a fan.
    pub(super) fn triangles(&self) -> impl Iterator<Item = [DVec3; 3]> {
        self.faces.iter().flat_map(|face| face.windows(2).skip(1).map(|pair| [face[0], pair[0], pair[1]]))
    }
}
