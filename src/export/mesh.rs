//! Triangle meshes with normals and colors, and what is computed from their triangles alone.

use glam::DVec3;

use super::CoarseCoordinates;
use strivec_format::geometry::Aabb;

/// A triangle mesh. A mesh without triangles is a point cloud.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mesh {
    /// \[vertex\] positions.
    pub positions: Vec<DVec3>,
    /// \[vertex\] unit vectors away from the inside.
    pub normals: Vec<DVec3>,
    /// \[vertex\] sRGB in \[0, 1\].
    pub colors: Vec<[f32; 3]>,
    /// Vertices, counterclockwise seen from outside.
    pub triangles: Vec<[u32; 3]>,
}

/// The area of each triangle times its normal.
fn directed_areas<'a>(positions: &'a [DVec3], triangles: &'a [[u32; 3]]) -> impl Iterator<Item = DVec3> + 'a {
    triangles.iter().map(|triangle| {
        let [a, b, c] = triangle.map(|n| positions[n as usize]);
        0.5 * (b - a).cross(c - a)
    })
}

/// The normal of each vertex: that of its triangles, weighted by their areas.
pub(super) fn normals(positions: &[DVec3], triangles: &[[u32; 3]]) -> Vec<DVec3> {
    let mut normals = vec![DVec3::ZERO; positions.len()];
    for (triangle, area) in triangles.iter().zip(directed_areas(positions, triangles)) {
        triangle.iter().for_each(|&n| normals[n as usize] += area);
    }
    normals.iter_mut().for_each(|normal| *normal = normal.normalize_or(DVec3::Z));
    normals
}

impl Mesh {
    /// The box around the positions.
    pub fn bounds(&self) -> Aabb {
        Aabb::from_points(self.positions.iter().copied())
    }

    /// The positions, if 32 bits hold them too coarsely.
    pub fn coarse_coordinates(&self) -> Option<CoarseCoordinates> {
        CoarseCoordinates::of(&self.bounds())
    }

    /// The area of each vertex: a third of that of its triangles.
    pub(super) fn areas_of_vertices(&self) -> Vec<f64> {
        let mut areas = vec![0.0; self.positions.len()];
        for (triangle, area) in self.triangles.iter().zip(directed_areas(&self.positions, &self.triangles)) {
            triangle.iter().for_each(|&n| areas[n as usize] += area.length() / 3.0);
        }
        areas
    }
}

/// Removes the connected parts of fewer than `min_triangles` triangles, and the vertices that only these have.
pub(super) fn remove_small_parts(positions: &mut Vec<DVec3>, triangles: &mut Vec<[u32; 3]>, min_triangles: u32) {
    let mut parent: Vec<u32> = (0..positions.len() as u32).collect();
    let root = |parent: &mut [u32], mut n: u32| {
        while parent[n as usize] != n {
            parent[n as usize] = parent[parent[n as usize] as usize];
            n = parent[n as usize];
        }
        n
    };
    for &[a, b, c] in &*triangles {
        let first = root(&mut parent, a);
        for other in [b, c] {
            let other = root(&mut parent, other);
            parent[other.max(first) as usize] = other.min(first);
        }
    }
    let roots: Vec<u32> = (0..positions.len() as u32).map(|n| root(&mut parent, n)).collect();
    let mut sizes = vec![0_u32; positions.len()];
    triangles.iter().for_each(|triangle| sizes[roots[triangle[0] as usize] as usize] += 1);
    let is_kept = |n: u32| sizes[roots[n as usize] as usize] >= min_triangles;
    triangles.retain(|triangle| is_kept(triangle[0]));
    let mut renumbered = vec![0; positions.len()];
    let mut count = 0;
    for n in (0..positions.len() as u32).filter(|&n| is_kept(n)) {
        renumbered[n as usize] = count;
        positions[count as usize] = positions[n as usize];
        count += 1;
    }
    positions.truncate(count as usize);
    triangles.iter_mut().flatten().for_each(|n| *n = renumbered[*n as usize]);
}
