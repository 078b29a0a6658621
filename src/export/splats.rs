//! 3D Gaussian splats on a surface, in the PLY layout of Kerbl et al., "3D Gaussian Splatting for Real-Time Radiance Field
//! Rendering", 2023.

use std::f64::consts::PI;
use std::io::{self, Write};

use glam::{DQuat, DVec3};

use super::Mesh;

/// Standard deviations along the surface, in edges of a square of a vertex's area.
const SPREAD: f64 = 0.5;
/// Standard deviation across the surface, as a share of that along it.
const FLATNESS: f64 = 0.1;
/// The opacity in the middle of a splat.
const OPACITY: f64 = 0.9;
/// Coefficients of the degrees 1 to 3 of a color, three channels of 15.
const HIGHER_DEGREES: usize = 45;

/// Writes a splat for each vertex of `mesh`, which must have triangles: flat, along the surface, as large as the vertex's
/// part of it, of the vertex's color in all directions. Trainers can start from the file. All numbers have 32 bits, since
/// programs that show splats read no others ([`Mesh::coarse_coordinates`]).
///
/// # Errors
///
/// If `out` fails.
pub fn write_splats(mesh: &Mesh, mut out: impl Write) -> io::Result<()> {
    let numbered = |name: &'static str, count: usize| (0..count).map(move |n| format!("{name}_{n}"));
    let names = ["x", "y", "z", "nx", "ny", "nz"].into_iter().map(str::to_owned);
    let names = names.chain(numbered("f_dc", 3)).chain(numbered("f_rest", HIGHER_DEGREES));
    let names = names.chain(["opacity".to_owned()]).chain(numbered("scale", 3)).chain(numbered("rot", 4));
    let properties: String = names.map(|name| format!("property float {name}\n")).collect();
    let count = mesh.positions.len();
    write!(out, "ply\nformat binary_little_endian 1.0\nelement vertex {count}\n{properties}end_header\n")?;
    // The spherical harmonic of degree 0.
    let harmonic = 0.5 / PI.sqrt();
    let opacity = (OPACITY / (1.0 - OPACITY)).ln();
    for (n, area) in mesh.areas_of_vertices().into_iter().enumerate() {
        let normal = mesh.normals[n];
        let along = (SPREAD * area.sqrt()).max(f64::from(f32::MIN_POSITIVE));
        let scales = [along, along, FLATNESS * along].map(f64::ln);
        let DQuat { x, y, z, w } = DQuat::from_rotation_arc(DVec3::Z, normal);
        let color = mesh.colors[n].map(|value| (f64::from(value) - 0.5) / harmonic);
        let values = (mesh.positions[n].to_array().into_iter())
            .chain(normal.to_array())
            .chain(color)
            .chain([0.0; HIGHER_DEGREES])
            .chain([opacity])
            .chain(scales)
            .chain([w, x, y, z]);
        let bytes: Vec<u8> = values.flat_map(|value| (value as f32).to_le_bytes()).collect();
        out.write_all(&bytes)?;
    }
    Ok(())
}
