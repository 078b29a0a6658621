//! Wavefront OBJ meshes with colors of vertices.

use std::io::{self, Write};

use super::Mesh;

/// Writes `mesh` as a Wavefront OBJ file: `v x y z r g b` with sRGB colors in \[0, 1\], as MeshLab, Blender and trimesh read
/// them, `vn`, and `f` of both.
///
/// # Errors
///
/// If `out` fails.
pub fn write_obj(mesh: &Mesh, mut out: impl Write) -> io::Result<()> {
    for (position, [r, g, b]) in mesh.positions.iter().zip(&mesh.colors) {
        let [x, y, z] = position.as_vec3().to_array();
        writeln!(out, "v {x} {y} {z} {r:.4} {g:.4} {b:.4}")?;
    }
    for normal in &mesh.normals {
        writeln!(out, "vn {:.4} {:.4} {:.4}", normal.x, normal.y, normal.z)?;
    }
    for [a, b, c] in mesh.triangles.iter().map(|triangle| triangle.map(|n| n + 1)) {
        writeln!(out, "f {a}//{a} {b}//{b} {c}//{c}")?;
    }
    Ok(())
}
