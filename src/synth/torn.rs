//! Meshes like those of scanners: small triangles, with holes.

use std::collections::HashMap;

use super::mesh::SolidMesh;
use super::portable::{hash, uniform};
use glam::DVec3;

impl SolidMesh {
    /// Splits edges longer than `longest` in the middle until there are none. A closed mesh stays closed, because the
    /// decision to split an edge depends on the edge alone, so its two triangles agree.
    pub(super) fn refine(&mut self, longest: f64) {
        loop {
            let mut middles = HashMap::new();
            let mut refined = Vec::with_capacity(self.triangles.len());
            for &[a, b, c] in &self.triangles {
                let mut middle = |from: u32, to: u32| {
                    let [p, q] = [from, to].map(|index| self.vertices[index as usize]);
                    (p.distance_squared(q) > longest * longest).then(|| {
                        *middles.entry((from.min(to), from.max(to))).or_insert_with(|| {
                            self.vertices.push(0.5 * (p + q));
                            self.vertices.len() as u32 - 1
                        })
                    })
                };
                match [middle(a, b), middle(b, c), middle(c, a)] {
                    [None, None, None] => refined.push([a, b, c]),
                    [Some(ab), Some(bc), Some(ca)] => {
                        refined.extend([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]);
                    }
                    [Some(ab), None, None] => refined.extend([[a, ab, c], [ab, b, c]]),
                    [None, Some(bc), None] => refined.extend([[b, bc, a], [bc, c, a]]),
                    [None, None, Some(ca)] => refined.extend([[c, ca, b], [ca, a, b]]),
                    [Some(ab), Some(bc), None] => refined.extend([[ab, b, bc], [a, ab, bc], [a, bc, c]]),
                    [None, Some(bc), Some(ca)] => refined.extend([[bc, c, ca], [b, bc, ca], [b, ca, a]]),
                    [Some(ab), None, Some(ca)] => refined.extend([[ca, a, ab], [c, ca, ab], [c, ab, b]]),
                }
            }
            self.triangles = refined;
            if middles.is_empty() {
                return;
            }
        }
    }

    /// Removes the triangles in balls around random points of the surface, of radii from `radii[0]` to `radii[1]`,
    /// until `share` of its area is removed, and then vertices of no triangle. Returns the removed share and, for each
    /// remaining vertex, its previous index.
    pub(super) fn tear(&mut self, share: f64, radii: [f64; 2], seed: u64) -> (f64, Vec<u32>) {
        let corners = |triangle: &[u32; 3]| triangle.map(|index| self.vertices[index as usize]);
        let mut below = 0.0;
        // [triangle] the area of all triangles up to this one.
        let areas: Vec<f64> = (self.triangles.iter())
            .map(|triangle| {
                let [a, b, c] = corners(triangle);
                below += 0.5 * (b - a).cross(c - a).length();
                below
            })
            .collect();
        let centers: Vec<DVec3> = self.triangles.iter().map(|t| corners(t).into_iter().sum::<DVec3>() / 3.0).collect();
        let mut kept = vec![true; self.triangles.len()];
        let (mut gone, mut patch) = (0.0, 0);
        while gone < share * below {
            let stream = hash(seed, patch);
            patch += 1;
            let chosen = areas.partition_point(|&area| area <= below * uniform(stream, 0));
            // The middle of a small triangle is as random as any other point of it.
            let Some(&center) = centers.get(chosen) else { continue };
            let radius = radii[0] + (radii[1] - radii[0]) * uniform(stream, 1);
            for (i, kept) in kept.iter_mut().enumerate() {
                if *kept && centers[i].distance_squared(center) < radius * radius {
                    *kept = false;
                    gone += areas[i] - if i > 0 { areas[i - 1] } else { 0.0 };
                }
            }
        }
        let mut kept = kept.into_iter();
        self.triangles.retain(|_| kept.next() == Some(true));
        (gone / below, self.remove_unused_vertices())
    }

    /// Keeps the triangles for whose center and outward normal, of any length, `keeps` holds, and their vertices.
    pub(super) fn keep(&mut self, keeps: impl Fn(DVec3, DVec3) -> bool) {
        let vertices = &self.vertices;
        self.triangles.retain(|triangle| {
            let [a, b, c] = triangle.map(|index| vertices[index as usize]);
            keeps((a + b + c) / 3.0, (b - a).cross(c - a))
        });
        self.remove_unused_vertices();
    }

    /// Removes vertices of no triangle. Returns the previous index of each remaining vertex.
    fn remove_unused_vertices(&mut self) -> Vec<u32> {
        let mut used = vec![false; self.vertices.len()];
        self.triangles.as_flattened().iter().for_each(|&index| used[index as usize] = true);
        let was: Vec<u32> = (0..used.len() as u32).filter(|&index| used[index as usize]).collect();
        let mut now = vec![0; used.len()];
        was.iter().zip(0..).for_each(|(&old, new)| now[old as usize] = new);
        self.vertices = was.iter().map(|&old| self.vertices[old as usize]).collect();
        self.triangles.as_flattened_mut().iter_mut().for_each(|index| *index = now[*index as usize]);
        was
    }
}

#[cfg(test)]
mod tests {
    use std::collections::HashSet;

    use super::*;
    use crate::scene::SyntheticScene;

    fn area(mesh: &SolidMesh) -> f64 {
        let of = |triangle: &[u32; 3]| {
            let [a, b, c] = triangle.map(|index| mesh.vertices[index as usize]);
            0.5 * (b - a).cross(c - a).length()
        };
        mesh.triangles.iter().map(of).sum()
    }

    /// The first solids of the scene: a cylinder, a block with a hole, a rod.
    fn some() -> SolidMesh {
        let mut mesh = SolidMesh::default();
        SyntheticScene::new(0).things[..3].iter().for_each(|thing| mesh.sweep(&thing.solid));
        mesh
    }

    #[test]
    fn refined_meshes_are_closed_of_short_edges_and_of_the_same_area() {
        let mut mesh = some();
        let before = area(&mesh);
        mesh.refine(0.05);
        let mut edges = HashSet::new();
        for &[a, b, c] in &mesh.triangles {
            for (from, to) in [(a, b), (b, c), (c, a)] {
                let [p, q] = [from, to].map(|index| mesh.vertices[index as usize]);
                assert!(p.distance(q) <= 0.05, "{p} {q}");
                assert!(edges.insert((from, to)), "an edge is used twice in one direction");
            }
        }
        assert!(edges.iter().all(|&(a, b)| edges.contains(&(b, a))), "an edge has one side only");
        assert!((area(&mesh) / before - 1.0).abs() < 1e-9);
    }

    #[test]
    fn torn_meshes_lack_about_the_share_of_area_in_patches() {
        let mut mesh = some();
        mesh.refine(0.05);
        let whole = SolidMesh { vertices: mesh.vertices.clone(), triangles: mesh.triangles.clone() };
        let (gone, was) = mesh.tear(0.1, [0.05, 0.15], 3);
        assert!((0.1..0.12).contains(&gone), "{gone}");
        assert!((area(&mesh) / area(&whole) - (1.0 - gone)).abs() < 1e-9);
        assert_eq!(was.len(), mesh.vertices.len());
        assert!(was.iter().zip(&mesh.vertices).all(|(&was, &vertex)| whole.vertices[was as usize] == vertex));
        // Most of the remaining surface is far from every hole: few triangles border on one.
        let edges: HashSet<_> = mesh.triangles.iter().flat_map(|&[a, b, c]| [(a, b), (b, c), (c, a)]).collect();
        let open = edges.iter().filter(|&&(a, b)| !edges.contains(&(b, a))).count();
        assert!(open > 100 && 10 * open < edges.len(), "{open} of {}", edges.len());
    }
}
