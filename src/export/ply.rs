//! Binary PLY: meshes and point clouds.

use std::io::{self, Write};

use glam::DVec3;

use super::Mesh;
use strivec_format::color::byte;

/// Writes `mesh` as a binary little-endian PLY file: `vertex` with float `x y z nx ny nz` and uchar `red green blue`
/// (sRGB), and `face` with `vertex_indices`, if there are triangles. If 32 bits are too few for the positions
/// ([`Mesh::coarse_coordinates`]), `x y z` are double.
///
/// # Errors
///
/// If `out` fails.
pub fn write_ply(mesh: &Mesh, mut out: impl Write) -> io::Result<()> {
    let Mesh { positions, normals, colors, triangles } = mesh;
    let is_wide = mesh.coarse_coordinates().is_some();
    write!(out, "ply\nformat binary_little_endian 1.0\nelement vertex {}\n", positions.len())?;
    for (kind, names) in [
        (if is_wide { "double" } else { "float" }, ["x", "y", "z"]),
        ("float", ["nx", "ny", "nz"]),
        ("uchar", ["red", "green", "blue"]),
    ] {
        names.iter().try_for_each(|name| writeln!(out, "property {kind} {name}"))?;
    }
    if !triangles.is_empty() {
        write!(out, "element face {}\nproperty list uchar int vertex_indices\n", triangles.len())?;
    }
    writeln!(out, "end_header")?;
    let narrow = |vector: &DVec3| vector.as_vec3().to_array().map(f32::to_le_bytes);
    for ((position, normal), color) in positions.iter().zip(normals).zip(colors) {
        if is_wide {
            out.write_all(position.to_array().map(f64::to_le_bytes).as_flattened())?;
        } else {
            out.write_all(narrow(position).as_flattened())?;
        }
        out.write_all(narrow(normal).as_flattened())?;
        out.write_all(&color.map(|value| byte(value.into())))?;
    }
    for triangle in triangles {
        out.write_all(&[3])?;
        out.write_all(triangle.map(u32::to_le_bytes).as_flattened())?;
    }
    Ok(())
}
