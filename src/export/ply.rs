//! Binary PLY: meshes and point clouds.

use std::io::{self, Write};

use super::Mesh;
use strivec_format::color::byte;

/// Writes `mesh` as a binary little-endian PLY file: `vertex` with float `x y z nx ny nz` and uchar `red green blue`
/// (sRGB), and `face` with `vertex_indices`, if there are triangles.
///
/// # Errors
///
/// If `out` fails.
pub fn write_ply(mesh: &Mesh, mut out: impl Write) -> io::Result<()> {
    let Mesh { positions, normals, colors, triangles } = mesh;
    let properties = ["x", "y", "z", "nx", "ny", "nz"].map(|name| format!("property float {name}\n")).concat();
    let channels = ["red", "green", "blue"].map(|name| format!("property uchar {name}\n")).concat();
    write!(out, "ply\nformat binary_little_endian 1.0\nelement vertex {}\n{properties}{channels}", positions.len())?;
    if !triangles.is_empty() {
        write!(out, "element face {}\nproperty list uchar int vertex_indices\n", triangles.len())?;
    }
    writeln!(out, "end_header")?;
    for ((position, normal), color) in positions.iter().zip(normals).zip(colors) {
        for vector in [position, normal] {
            out.write_all(vector.as_vec3().to_array().map(f32::to_le_bytes).as_flattened())?;
        }
        out.write_all(&color.map(|value| byte(value.into())))?;
    }
    for triangle in triangles {
        out.write_all(&[3])?;
        out.write_all(triangle.map(u32::to_le_bytes).as_flattened())?;
    }
    Ok(())
}
