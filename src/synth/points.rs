//! Points on the surface of the scene, uniform by area.

use std::io::{self, Write};

use glam::DVec3;

use super::portable::{srgb, uniform};
use super::scene::SyntheticScene;
use super::thing::Thing;
use strivec_format::color::byte;
use strivec_format::geometry::Ray;

/// A point on the surface.
pub(super) struct SurfacePoint {
    /// The position in the world.
    pub(super) position: DVec3,
    /// The outward unit normal.
    pub(super) normal: DVec3,
    /// The diffuse color, sRGB.
    pub(super) color: [u8; 3],
}

/// `count` points, at the crossings of random lines and solids.
///
/// Lines that are uniform in direction and in position meet any surface uniformly by area (Cauchy and Crofton), so
/// this needs no formula for each shape. Points on or in another solid, such as
/// those between a solid and its support, are left out.
pub(super) fn points(scene: &SyntheticScene, count: usize, seed: u64) -> Vec<SurfacePoint> {
    let mut counter = 0;
    let mut random = || {
        counter += 1;
        2.0 * uniform(seed, counter) - 1.0
    };
    let mut points = Vec::with_capacity(count);
    loop {
        // Uniform in the ball, then by direction; uniform on the disc across that direction.
        let direction = DVec3::new(random(), random(), random());
        let (x, y) = (random(), random());
        if !(1e-4..=1.0).contains(&direction.length_squared()) || x * x + y * y > 1.0 {
            continue;
        }
        let direction = direction.normalize();
        let right = direction.any_orthonormal_vector();
        let origin = scene.radius() * (x * right + y * direction.cross(right));
        let ray = Ray { origin, direction };
        for (i, thing) in scene.things.iter().enumerate() {
            for crossing in thing.solid.spans(&ray).into_iter().flatten().flatten() {
                let position = ray.at(crossing.t);
                let hidden = |(j, other): (usize, &Thing)| j != i && other.solid.depth(position) > -1e-9;
                if scene.things.iter().enumerate().any(hidden) {
                    continue;
                }
                let albedo = thing.texture.albedo(thing.solid.local(position), crossing.face, thing.texture_seed);
                let normal = thing.solid.normal(crossing.face, position);
                points.push(SurfacePoint { position, normal, color: albedo.to_array().map(srgb).map(byte) });
                if points.len() == count {
                    return points;
                }
            }
        }
    }
}

/// A binary little-endian PLY file: `vertex` with float x, y, z, nx, ny, nz and uchar red, green, blue.
pub(super) fn write_ply(points: &[SurfacePoint], out: &mut impl Write) -> io::Result<()> {
    write!(
        out,
        "ply\nformat binary_little_endian 1.0\nelement vertex {}\nproperty float x\nproperty float y\nproperty float z\n\
         property float nx\nproperty float ny\nproperty float nz\n\
         property uchar red\nproperty uchar green\nproperty uchar blue\nend_header\n",
        points.len()
    )?;
    for point in points {
        for vector in [point.position, point.normal] {
            out.write_all(vector.as_vec3().to_array().map(f32::to_le_bytes).as_flattened())?;
        }
        out.write_all(&point.color)?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::SolidMesh;

    #[test]
    fn points_are_on_the_surface_with_outward_normals() {
        let scene = SyntheticScene::new(5);
        for point in points(&scene, 5000, 8) {
            let deepest = scene.things.iter().map(|t| t.solid.depth(point.position)).fold(f64::NEG_INFINITY, f64::max);
            assert!(deepest.abs() < 1e-12, "{deepest}");
            assert!((point.normal.length() - 1.0).abs() < 1e-12);
            let outside = point.position + 1e-7 * point.normal;
            assert!(scene.things.iter().all(|t| t.solid.depth(outside) < 0.0));
        }
    }

    #[test]
    fn share_of_points_is_the_share_of_area() {
        let scene = SyntheticScene::new(5);
        let area = |thing: &Thing| {
            let mut mesh = SolidMesh::default();
            mesh.sweep(&thing.solid);
            let of = |t: &[u32; 3]| {
                let [a, b, c] = t.map(|i| mesh.vertices[i as usize]);
                0.5 * (b - a).cross(c - a).length()
            };
            mesh.triangles.iter().map(of).sum::<f64>()
        };
        // The wall and the bowl are covered by nothing but at their feet.
        let (wall, bowl) = (&scene.things[1], &scene.things[3]);
        let points = points(&scene, 40_000, 8);
        let on = |thing: &Thing| points.iter().filter(|p| thing.solid.depth(p.position).abs() < 1e-9).count() as f64;
        let ratio = (on(wall) / on(bowl)) / (area(wall) / area(bowl));
        assert!((ratio - 1.0).abs() < 0.04, "{ratio}");
    }
}
