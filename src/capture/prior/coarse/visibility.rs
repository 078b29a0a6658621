//! The number of views that see each vertex.

use glam::DVec3;
use rayon::prelude::*;

use super::grid::{CoarseGrid, Scalar};
use strivec_format::geometry::{Camera, Contraction};

/// \[vertex\]: the number of cameras whose frustum between the distances `near` and `far` contains it or, from `near` on,
/// its place before `contraction`: vertices on the border of contracted space are infinitely far away. DVGO counts the
/// views whose rays touch a vertex, which is the same up to a pixel at the edges of the pictures.
pub(super) fn count_views<T: Scalar>(
    grid: &CoarseGrid<T>,
    cameras: &[Camera],
    [near, far]: [f64; 2],
    contraction: Option<Contraction>,
) -> Vec<u32> {
    let row = grid.vertices.x as usize;
    let rows = grid.vertices.y as usize;
    let far = if contraction.is_some() { f64::INFINITY } else { far };
    let mut counts = vec![0; grid.values.len()];
    counts.par_chunks_mut(row).enumerate().for_each(|(line, counts)| {
        for camera in cameras {
            // Along a row, the point in the camera's axes changes by a constant step.
            let camera_from_world = camera.world_from_camera.transpose();
            let first = grid.position(0, line % rows, line / rows);
            let mut at = camera_from_world * (first - camera.position);
            let step = camera_from_world.x_axis * grid.voxel;
            for (x, count) in counts.iter_mut().enumerate() {
                if let Some(contraction) = contraction {
                    let vertex = first + DVec3::X * (x as f64 * grid.voxel);
                    at = camera_from_world * (contraction.expand(vertex) - camera.position);
                }
                let depth = -at.z;
                let column = camera.principal[0] * depth + camera.focal[0] * at.x;
                let row = camera.principal[1] * depth - camera.focal[1] * at.y;
                let distance = at.length_squared();
                let seen = depth > 0.0
                    && (0.0..=f64::from(camera.width) * depth).contains(&column)
                    && (0.0..=f64::from(camera.height) * depth).contains(&row)
                    && (near * near..=far * far).contains(&distance);
                *count += u32::from(seen);
                at += step;
            }
        }
    });
    counts
}

#[cfg(test)]
mod tests {
    use glam::UVec3;

    use super::*;

    #[test]
    fn a_vertex_counts_where_its_projection_lies_in_the_picture_and_in_range() {
        let camera = Camera::looking_at([10, 6], 8.0, DVec3::new(0.0, -4.0, 0.0), DVec3::ZERO, DVec3::Z);
        let grid = CoarseGrid::<f32> {
            origin: DVec3::splat(-3.0),
            voxel: 0.75,
            vertices: UVec3::splat(9),
            values: vec![[0.0; 4]; 729],
        };
        let counts = count_views(&grid, &[camera, camera], [2.0, 5.0], None);
        for (n, &count) in counts.iter().enumerate() {
            let point = grid.position(n % 9, n / 9 % 9, n / 81);
            let offset = point - camera.position;
            let in_camera = camera.world_from_camera.transpose() * offset;
            let (u, v) = (5.0 + 8.0 * in_camera.x / -in_camera.z, 3.0 - 8.0 * in_camera.y / -in_camera.z);
            let ahead = in_camera.z < 0.0 && (0.0..=10.0).contains(&u) && (0.0..=6.0).contains(&v);
            let expected = if ahead && (2.0..=5.0).contains(&offset.length()) { 2 } else { 0 };
            assert_eq!(count, expected, "vertex {n} at {point}");
        }
        assert!(counts.contains(&0) && counts.contains(&2));
    }
}
