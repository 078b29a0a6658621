//! Distances from cameras to a mesh: its triangles, drawn into the photographs.

use std::path::Path;

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use crate::dataset::Photograph;
use crate::geometry;
use strivec_format::geometry::{Aabb, Camera, Projection, Ray};
use strivec_import::{Fault, ImportError, Point, ReadOptions, Visitor};

/// The most triangles of a mesh that is drawn: 36 bytes each.
pub const MAX_TRIANGLES: usize = 20_000_000;
/// Distances count if no neighbor in the picture differs by more than this share: at edges, cameras and mesh may disagree.
const EDGE: f32 = 0.1;

/// Sets the distances of the pixels of `views` that have none yet to where their rays first meet a triangle of the file
/// `path`, which is in the space of the cameras; pixels at edges stay without. Returns the share of pixels that were set, or
/// `None` if the file has more than [`MAX_TRIANGLES`], which changes nothing.
///
/// # Errors
///
/// The errors of [`geometry::read`].
pub fn mesh_distances(path: &Path, views: &mut [Photograph]) -> Result<Option<f64>, ImportError> {
    let mut mesh = FileTriangles::default();
    geometry::read(path, &ReadOptions::default(), &mut mesh)?;
    if mesh.triangles.is_empty() {
        return Ok(Some(0.0));
    }
    if mesh.triangles.len() > MAX_TRIANGLES {
        return Ok(None);
    }
    let counts = views.par_iter_mut().map(|view| {
        let drawn = away_from_edges(&drawn(&mesh.triangles, &view.camera), view.camera.width as usize);
        let known = &mut view.distances;
        known.resize(drawn.len(), 0.0);
        let unknown = known.iter_mut().zip(&drawn).filter(|(known, drawn)| **known == 0.0 && **drawn > 0.0);
        let set = unknown.map(|(known, drawn)| *known = *drawn).count();
        [set, drawn.len()]
    });
    let [set, all] = counts.reduce(|| [0; 2], |a, b| [a[0] + b[0], a[1] + b[1]]);
    Ok(Some(set as f64 / all.max(1) as f64))
}

/// The triangles of a file, as long as they are not too many.
#[derive(Default)]
struct FileTriangles {
    triangles: Vec<[Vec3; 3]>,
}

impl Visitor for FileTriangles {
    fn point(&mut self, _point: Point) -> Result<(), Fault> {
        Ok(())
    }

    fn triangle(&mut self, corners: [Point; 3]) -> Result<(), Fault> {
        if self.triangles.len() <= MAX_TRIANGLES {
            self.triangles.push(corners.map(|corner| corner.position.as_vec3()));
        }
        Ok(())
    }

    fn cell(&mut self, _cell: &Aabb, _color: Option<[u8; 3]>) -> Result<(), Fault> {
        Ok(())
    }
}

/// \[height\]\[width\] the distance along each pixel's ray to the first triangle; infinite if there is none. Triangles that
/// are not wholly before the camera, or in a panorama wider than half of it, are left out.
fn drawn(triangles: &[[Vec3; 3]], camera: &Camera) -> Vec<f32> {
    let rays: Vec<Option<Ray>> = camera.rays(0..camera.height).collect();
    let mut distances = vec![f32::INFINITY; rays.len()];
    let [width, height] = [camera.width, camera.height].map(f64::from);
    let goes_around = camera.lens.projection == Projection::Equirectangular;
    for corners in triangles.iter().map(|triangle| triangle.map(Vec3::as_dvec3)) {
        let [Some(a), Some(b), Some(c)] = corners.map(|corner| camera.project(corner)) else { continue };
        // Pixels whose middles are in the box around the triangle.
        let (low, high) = (a.min(b).min(c) - 0.5, a.max(b).max(c) - 0.5);
        let is_outside = high.x < 0.0 || high.y < 0.0 || low.x > width - 1.0 || low.y > height - 1.0;
        if is_outside || (goes_around && high.x - low.x > 0.5 * width) {
            continue;
        }
        for row in low.y.max(0.0).ceil() as usize..=high.y.min(height - 1.0).floor() as usize {
            for column in low.x.max(0.0).ceil() as usize..=high.x.min(width - 1.0).floor() as usize {
                let pixel = row * camera.width as usize + column;
                if let Some(t) = rays[pixel].and_then(|ray| crossing(&ray, corners)) {
                    distances[pixel] = distances[pixel].min(t as f32);
                }
            }
        }
    }
    distances
}

/// The distance along `ray` to a triangle, from either side (Möller and Trumbore, 1997).
fn crossing(ray: &Ray, [a, b, c]: [DVec3; 3]) -> Option<f64> {
    let (ab, ac) = (b - a, c - a);
    let across = ray.direction.cross(ac);
    let volume = ab.dot(across);
    let from = ray.origin - a;
    let around = from.cross(ab);
    let (u, v, t) = (from.dot(across) / volume, ray.direction.dot(around) / volume, ac.dot(around) / volume);
    // A degenerate triangle has no volume: nothing compares with NaN.
    (u >= 0.0 && v >= 0.0 && u + v <= 1.0 && t > 0.0 && t.is_finite()).then_some(t)
}

/// `distances` of pictures of `width` columns, 0 where there is none or a neighbor is much nearer or farther.
fn away_from_edges(distances: &[f32], width: usize) -> Vec<f32> {
    let near = |n: usize, other: usize| {
        let (here, there) = (distances[n], distances[other]);
        (here - there).abs() <= EDGE * here.min(there)
    };
    let is_inside = |n: usize| {
        let (column, last) = (n % width, distances.len() - width);
        distances[n].is_finite()
            && (column == 0 || near(n, n - 1))
            && (column + 1 == width || near(n, n + 1))
            && (n < width || near(n, n - width))
            && (n >= last || near(n, n + width))
    };
    (0..distances.len()).map(|n| if is_inside(n) { distances[n] } else { 0.0 }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dataset::Pixels;

    /// A view from 4 units above the square \[−1, 1\]² at height 0, over one of 8 units at height −2.
    fn seen() -> (tempfile::TempDir, Photograph) {
        let folder = tempfile::tempdir().unwrap();
        let square = |half: f64, z: f64| {
            [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]]
                .map(|[x, y]| format!("v {} {} {z}\n", half * x, half * y))
        };
        let text =
            [square(1.0, 0.0).concat(), square(4.0, -2.0).concat()].concat() + "f 1 2 3\nf 1 3 4\nf 5 6 7\nf 5 7 8\n";
        std::fs::write(folder.path().join("mesh.obj"), text).unwrap();
        let camera = Camera::looking_at([40, 40], 40.0, DVec3::new(0.0, 0.0, 4.0), DVec3::ZERO, DVec3::Y);
        (folder, Photograph::new("a", camera, Pixels::opaque(vec![[0.0; 3]; 1600])))
    }

    #[test]
    fn rays_end_at_the_first_triangle_but_at_edges() {
        let (folder, view) = seen();
        let mut views = [view];
        views[0].distances = vec![0.0; 1600];
        views[0].distances[20 * 40 + 20] = 1.5;
        let share = mesh_distances(&folder.path().join("mesh.obj"), &mut views).unwrap().unwrap();
        let Photograph { camera, distances, .. } = &views[0];
        assert_eq!(distances[20 * 40 + 20], 1.5, "what is known stays");
        let mut edges = 0;
        for (n, ray) in camera.rays(0..40).map(Option::unwrap).enumerate().filter(|(n, _)| *n != 20 * 40 + 20) {
            let to_plane = |z: f64| (z - 4.0) / ray.direction.z;
            let at = ray.at(to_plane(0.0)).truncate().abs().max_element();
            let expected = if at < 1.0 { to_plane(0.0) } else { to_plane(-2.0) };
            // A pixel of the picture is 0.1 units of the upper square.
            if (at - 1.0).abs() > 0.15 {
                assert!((f64::from(distances[n]) - expected).abs() < 1e-5, "{n}: {} {expected}", distances[n]);
            }
            edges += usize::from(distances[n] == 0.0);
        }
        assert!((60..200).contains(&edges), "{edges}");
        assert!((share - (1599 - edges) as f64 / 1600.0).abs() < 1e-9, "{share}");
    }

    #[test]
    fn files_of_points_change_nothing() {
        let (folder, view) = seen();
        let path = folder.path().join("points.xyz");
        std::fs::write(&path, "0 0 0\n1 1 0\n").unwrap();
        let mut views = [view];
        assert_eq!(mesh_distances(&path, &mut views).unwrap(), Some(0.0));
        assert!(views[0].distances.is_empty());
    }
}
