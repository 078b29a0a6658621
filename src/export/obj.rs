//! Wavefront OBJ meshes with colors of vertices.

use std::io::{self, Write};

use super::Mesh;

/// Writes `mesh` as a Wavefront OBJ file: `v x y z r g b` with sRGB colors in \[0, 1\], as MeshLab, Blender and trimesh read
/// them, `vn`, and `f` of both. Positions have the digits of 32 bits; if these are too few ([`Mesh::coarse_coordinates`]),
/// those of 64.
///
/// # Errors
///
/// If `out` fails.
pub fn write_obj(mesh: &Mesh, mut out: impl Write) -> io::Result<()> {
    let is_wide = mesh.coarse_coordinates().is_some();
    for (position, [r, g, b]) in mesh.positions.iter().zip(&mesh.colors) {
        // The shortest texts that read back as the numbers.
        if is_wide {
            write!(out, "v {} {} {}", position.x, position.y, position.z)?;
        } else {
            let position = position.as_vec3();
            write!(out, "v {} {} {}", position.x, position.y, position.z)?;
        }
        writeln!(out, " {r:.4} {g:.4} {b:.4}")?;
    }
    for normal in &mesh.normals {
        writeln!(out, "vn {:.4} {:.4} {:.4}", normal.x, normal.y, normal.z)?;
    }
    for [a, b, c] in mesh.triangles.iter().map(|triangle| triangle.map(|n| n + 1)) {
        writeln!(out, "f {a}//{a} {b}//{b} {c}//{c}")?;
    }
    Ok(())
}
