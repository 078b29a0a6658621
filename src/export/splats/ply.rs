//! Splats in the PLY layout of the reference implementation of Kerbl et al.

use std::io::{self, Write};

use glam::{DQuat, DVec3};

use super::harmonics::terms;
use super::{MAX_DEGREE, OPACITY, Splats};

/// Writes `splats` with normals and with harmonics of degree 3, which are 0 where the splats have none: trainers expect as
/// many.
///
/// # Errors
///
/// If `out` fails.
pub fn write_splats(splats: &Splats, mut out: impl Write) -> io::Result<()> {
    let higher = terms(MAX_DEGREE) - 1;
    let numbered = |name: &'static str, count: usize| (0..count).map(move |n| format!("{name}_{n}"));
    let names = ["x", "y", "z", "nx", "ny", "nz"].into_iter().map(str::to_owned);
    let names = names.chain(numbered("f_dc", 3)).chain(numbered("f_rest", 3 * higher));
    let names = names.chain(["opacity".to_owned()]).chain(numbered("scale", 3)).chain(numbered("rot", 4));
    let properties: String = names.map(|name| format!("property float {name}\n")).collect();
    let count = splats.len();
    write!(out, "ply\nformat binary_little_endian 1.0\nelement vertex {count}\n{properties}end_header\n")?;
    let opacity = (OPACITY / (1.0 - OPACITY)).ln();
    for (n, splat) in splats.splats.iter().enumerate() {
        let (&first, rest) = splats.coefficients_of(n).split_first().expect("degree 0 has a term");
        // All terms of red, then of green, then of blue.
        let rest = (0..3).flat_map(|c| (0..higher).map(move |k| rest.get(k).map_or(0.0, |term| term[c])));
        let DQuat { x, y, z, w } = splat.rotation;
        let values = (splat.center.to_array().into_iter())
            .chain((splat.rotation * DVec3::Z).to_array())
            .map(|value| value as f32)
            .chain(first)
            .chain(rest)
            .chain([opacity].into_iter().chain(splat.deviations.map(f64::ln)).chain([w, x, y, z]).map(|v| v as f32));
        let bytes: Vec<u8> = values.flat_map(f32::to_le_bytes).collect();
        out.write_all(&bytes)?;
    }
    Ok(())
}
