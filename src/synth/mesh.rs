//! The solids' surfaces as triangles: closed, outward (counterclockwise seen from outside), vertices on the surfaces.
//!
//! Every solid is swept around its z axis: a profile of rings, each with a vertex in every one of a fan of directions.

use std::io::{self, Write};

use glam::{DVec2, DVec3};

use super::portable::{angle, cos_sin};
use super::scene::SyntheticScene;
use super::solid::{About, Solid};

/// The largest distance of a round surface from its triangles.
const SAGITTA: f64 = 2e-4;

/// The triangles of all solids; solids share no vertices.
#[derive(Default)]
pub(super) struct SolidMesh {
    /// Positions in the world.
    pub(super) vertices: Vec<DVec3>,
    pub(super) triangles: Vec<[u32; 3]>,
}

/// A ring of the profile: its height, and its distance from the axis, or `None` if it follows the box.
struct Ring {
    radius: Option<f64>,
    z: f64,
}

impl SolidMesh {
    /// All solids of `scene`, in order.
    pub(super) fn of_scene(scene: &SyntheticScene) -> Self {
        let mut mesh = Self::default();
        for thing in &scene.things {
            mesh.sweep(&thing.solid);
        }
        mesh
    }

    /// Adds one solid.
    pub(super) fn sweep(&mut self, solid: &Solid) {
        let directions = directions(solid);
        let (rings, closed) = profile(solid);
        let count = directions.len() as u32;
        // The first index of each ring and its number of vertices: a ring on the axis is a single vertex.
        let mut first = Vec::with_capacity(rings.len());
        for ring in &rings {
            first.push(self.vertices.len() as u32);
            if ring.radius == Some(0.0) {
                self.vertices.push(solid.world(DVec3::new(0.0, 0.0, ring.z)));
                continue;
            }
            for &direction in &directions {
                let radius = ring.radius.unwrap_or_else(|| to_box(solid, direction));
                self.vertices.push(solid.world((radius * direction).extend(ring.z)));
            }
        }
        let pairs = if closed { rings.len() } else { rings.len() - 1 };
        for lower in 0..pairs {
            let upper = (lower + 1) % rings.len();
            for j in 0..count {
                let next = (j + 1) % count;
                let (a, b) = (first[lower], first[upper]);
                if rings[lower].radius == Some(0.0) {
                    self.triangles.push([a, b + next, b + j]);
                } else if rings[upper].radius == Some(0.0) {
                    self.triangles.push([a + j, a + next, b]);
                } else {
                    self.triangles.push([a + j, a + next, b + next]);
                    self.triangles.push([a + j, b + next, b + j]);
                }
            }
        }
    }

    /// A binary little-endian PLY file: `vertex` with float x, y, z; `face` with uchar, int `vertex_indices`.
    pub(super) fn write_ply(&self, out: &mut impl Write) -> io::Result<()> {
        write!(
            out,
            "ply\nformat binary_little_endian 1.0\nelement vertex {}\nproperty float x\nproperty float y\n\
             property float z\nelement face {}\nproperty list uchar int vertex_indices\nend_header\n",
            self.vertices.len(),
            self.triangles.len()
        )?;
        for vertex in &self.vertices {
            out.write_all(vertex.as_vec3().to_array().map(f32::to_le_bytes).as_flattened())?;
        }
        for triangle in &self.triangles {
            out.write_all(&[3])?;
            out.write_all(triangle.map(u32::to_le_bytes).as_flattened())?;
        }
        Ok(())
    }

    /// A Wavefront OBJ file: `v` and `f` lines.
    pub(super) fn write_obj(&self, out: &mut impl Write) -> io::Result<()> {
        for v in &self.vertices {
            writeln!(out, "v {} {} {}", v.x, v.y, v.z)?;
        }
        for [a, b, c] in self.triangles.iter().map(|t| t.map(|index| index + 1)) {
            writeln!(out, "f {a} {b} {c}")?;
        }
        Ok(())
    }
}

/// Unit directions around the axis, counterclockwise: evenly spaced if the solid is round, and to the corners if a
/// box is visible.
fn directions(solid: &Solid) -> Vec<DVec2> {
    let mut directions = Vec::new();
    let shows_box = solid.round.is_none_or(|round| round.outer.is_infinite());
    if let Some(round) = solid.round {
        let radius = if shows_box { round.inner } else { round.outer };
        // sagitta = r (1 − cos(π/n)) ≈ r π² / 2n²
        let needed = std::f64::consts::PI * (radius / (2.0 * SAGITTA)).sqrt();
        let count = 4 * (needed / 4.0).ceil() as u32;
        directions.extend((0..count).map(|i| DVec2::from(cos_sin(f64::from(i) / f64::from(count)))));
    }
    if shows_box {
        let (min, max) = (solid.bounds.min.truncate(), solid.bounds.max.truncate());
        let corners = [max, DVec2::new(min.x, max.y), min, DVec2::new(max.x, min.y)];
        directions.extend(corners.map(DVec2::normalize));
        directions.sort_by(|a, b| angle(a.x, a.y).total_cmp(&angle(b.x, b.y)));
    }
    directions
}

/// The distance from the axis to the box's side along the unit vector `direction`.
fn to_box(solid: &Solid, direction: DVec2) -> f64 {
    let along = |axis: usize| {
        let d = direction[axis];
        if d > 0.0 { solid.bounds.max[axis] / d } else { solid.bounds.min[axis] / d }
    };
    // A zero component divides to ±∞; the other axis then decides.
    along(0).abs().min(along(1).abs())
}

/// The rings, from below outwards and up, and true if the last is joined to the first.
fn profile(solid: &Solid) -> (Vec<Ring>, bool) {
    let (low, high) = (solid.bounds.min.z, solid.bounds.max.z);
    let at = |radius, z| Ring { radius: Some(radius), z };
    let side = |radius: Option<f64>| [Ring { radius, z: low }, Ring { radius, z: high }];
    let Some(round) = solid.round else {
        return ([at(0.0, low)].into_iter().chain(side(None)).chain([at(0.0, high)]).collect(), false);
    };
    let steps = (directions(solid).len() / 4) as u32;
    // From the lowest point of a sphere upwards, `quarters` of a turn.
    let arc = |radius: f64, quarters: u32| {
        (0..=quarters * steps).map(move |i| {
            let (cos, sin) = cos_sin(0.25 * f64::from(i) / f64::from(steps));
            // The ends are exact: the poles are single vertices.
            if i == 0 || i == 2 * steps { at(0.0, -radius * cos) } else { at(radius * sin, -radius * cos) }
        })
    };
    let outer = round.outer.is_finite().then_some(round.outer);
    match (round.about, round.inner > 0.0) {
        (About::Point, false) => (arc(round.outer, 2).collect(), false),
        (About::Point, true) => {
            let inside: Vec<Ring> = arc(round.inner, 1).collect();
            (arc(round.outer, 1).chain(inside.into_iter().rev()).collect(), false)
        }
        (About::Axis, false) => ([at(0.0, low)].into_iter().chain(side(outer)).chain([at(0.0, high)]).collect(), false),
        (About::Axis, true) => {
            let inside = [at(round.inner, high), at(round.inner, low)];
            (side(outer).into_iter().chain(inside).collect(), true)
        }
    }
}

#[cfg(test)]
mod tests {
    use std::collections::HashSet;

    use super::*;
    use crate::pictures::orbit;
    use strivec_format::geometry::Ray;

    fn each_solid(mut check: impl FnMut(&Solid, &SolidMesh)) {
        for thing in &SyntheticScene::new(0).things {
            let mut mesh = SolidMesh::default();
            mesh.sweep(&thing.solid);
            check(&thing.solid, &mesh);
        }
    }

    #[test]
    fn every_solid_is_closed_and_its_vertices_are_on_its_surface() {
        each_solid(|solid, mesh| {
            for &vertex in &mesh.vertices {
                assert!(solid.depth(vertex).abs() < 1e-14, "{vertex} of {solid:?}");
            }
            let mut edges = HashSet::new();
            for [a, b, c] in &mesh.triangles {
                for edge in [(a, b), (b, c), (c, a)] {
                    assert!(edges.insert(edge), "an edge is used twice in one direction");
                }
            }
            assert!(edges.iter().all(|&(a, b)| edges.contains(&(b, a))), "an edge has one side only");
        });
    }

    #[test]
    fn triangles_face_outwards_and_stay_near_the_surface() {
        each_solid(|solid, mesh| {
            for triangle in &mesh.triangles {
                let [a, b, c] = triangle.map(|i| mesh.vertices[i as usize]);
                let middle = (a + b + c) / 3.0;
                assert!(solid.depth(middle).abs() < 3.0 * SAGITTA, "{} at {middle}", solid.depth(middle));
                let normal = (b - a).cross(c - a).normalize();
                let outside = solid.depth(middle + 1e-3 * normal);
                let inside = solid.depth(middle - 1e-3 * normal);
                assert!(outside < inside, "{outside} {inside} at {middle} of {solid:?}");
            }
        });
    }

    /// The nearest intersection of `ray` with the mesh, by Möller and Trumbore's test of every triangle.
    fn nearest(mesh: &SolidMesh, ray: &Ray) -> Option<f64> {
        let distance = |triangle: &[u32; 3]| {
            let [a, b, c] = triangle.map(|i| mesh.vertices[i as usize]);
            let (e, f) = (b - a, c - a);
            let p = ray.direction.cross(f);
            let determinant = e.dot(p);
            let s = ray.origin - a;
            let q = s.cross(e);
            let (u, v) = (s.dot(p) / determinant, ray.direction.dot(q) / determinant);
            // Rays arrive at front faces only.
            (determinant > 0.0 && u >= 0.0 && v >= 0.0 && u + v <= 1.0).then(|| f.dot(q) / determinant)
        };
        mesh.triangles.iter().filter_map(distance).filter(|t| *t > 0.0).min_by(f64::total_cmp)
    }

    #[test]
    fn rays_meet_the_mesh_where_they_meet_the_solids() {
        let scene = SyntheticScene::new(0);
        let mesh = SolidMesh::of_scene(&scene);
        let (mut met, mut differ) = (0, 0);
        for camera in orbit(6, [20, 20], 4) {
            for ray in camera.rays(0..20).flatten() {
                let exact = scene.hit(&ray, 0.0);
                let found = nearest(&mesh, &ray);
                met += u32::from(exact.is_some());
                let same = match (&exact, found) {
                    (Some(hit), Some(t)) => {
                        let cosine = -ray.direction.dot(hit.thing.solid.normal(hit.face, ray.at(hit.t)));
                        (hit.t - t).abs() < 2.0 * SAGITTA / cosine.max(0.05)
                    }
                    (exact, found) => exact.is_none() && found.is_none(),
                };
                differ += u32::from(!same);
            }
        }
        // Only rays that graze a silhouette may differ.
        assert!(met > 500 && differ * 200 < met, "{differ} of {met} differ");
    }
}
