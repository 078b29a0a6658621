//! Splats as SPZ, Niantic's format: a gzip stream of a header and of arrays of quantized numbers.
//!
//! Version 3, which readers of this format have in common: version 4 is no gzip stream, and version 2 has rotations of fewer
//! bits. SPZ has axes right, up, back where PLY has right, down, front: y and z change their signs, as other programs
//! convert.

use std::f64::consts::{FRAC_1_SQRT_2, SQRT_2};
use std::io::Write;

use flate2::Compression;
use flate2::write::GzEncoder;

use super::super::Error;
use super::harmonics::{degrees_and_orders, terms};
use super::{MAX_SPLATS, OPACITY, Splats, largest_component};

const VERSION: u32 = 3;
/// Bits of a coordinate without its sign.
const COORDINATE_BITS: i32 = 23;
/// Steps of a coordinate in a mean standard deviation of the splats, at least.
const STEPS: f64 = 16.0;
/// Scale of the colors' coefficients.
const COLOR_SCALE: f64 = 0.15;
/// Signs of an axis after half a turn about x.
const SIGNS: [f64; 3] = [1.0, -1.0, -1.0];

/// Writes `splats` with the harmonics that they have.
///
/// # Errors
///
/// If there are too many splats, a coordinate is too large for the format, and if `out` fails.
pub fn write_spz(splats: &Splats, out: impl Write) -> Result<(), Error> {
    Error::unless_within("splats", MAX_SPLATS, splats.len() as u64)?;
    let all = &splats.splats;
    let fraction = fraction_bits(splats)?;
    let limit = f64::from(COORDINATE_BITS).exp2() - 1.0;
    let mut out = GzEncoder::new(out, Compression::best());
    out.write_all(b"NGSP")?;
    out.write_all([VERSION, splats.len() as u32].map(u32::to_le_bytes).as_flattened())?;
    out.write_all(&[splats.degree as u8, fraction as u8, 0, 0])?;
    for splat in all {
        for (value, sign) in splat.center.to_array().into_iter().zip(SIGNS) {
            let steps = (sign * value * f64::from(fraction).exp2()).round().clamp(-limit, limit) as i32;
            out.write_all(&steps.to_le_bytes()[..3])?;
        }
    }
    out.write_all(&vec![byte(255.0 * OPACITY); all.len()])?;
    for n in 0..all.len() {
        let first = splats.coefficients_of(n)[0];
        out.write_all(&first.map(|value| byte((COLOR_SCALE * f64::from(value) + 0.5) * 255.0)))?;
    }
    for splat in all {
        out.write_all(&splat.deviations.map(|value| byte(16.0 * (value.ln() + 10.0))))?;
    }
    for splat in all {
        let [x, y, z, w] = splat.rotation.to_array();
        out.write_all(&smallest_three([SIGNS[0] * x, SIGNS[1] * y, SIGNS[2] * z, w]).to_le_bytes())?;
    }
    // Half a turn about x changes the sign of a term whose polynomial is odd in y and z together.
    let signs: Vec<f64> = degrees_and_orders(splats.degree)
        .map(|(l, m)| if (l + m + i32::from(m < 0)) % 2 == 0 { 1.0 } else { -1.0 })
        .collect();
    let mut bytes = Vec::with_capacity(3 * terms(splats.degree));
    for n in 0..all.len() {
        bytes.clear();
        for (term, sign) in splats.coefficients_of(n).iter().zip(&signs).skip(1) {
            bytes.extend(term.map(|value| byte(128.0 + 128.0 * sign * f64::from(value))));
        }
        out.write_all(&bytes)?;
    }
    out.finish()?;
    Ok(())
}

/// `value` as a byte, rounded and clamped.
fn byte(value: f64) -> u8 {
    value.round().clamp(0.0, 255.0) as u8
}

/// Bits of a coordinate after the point: as few as give the splats their shape, as more do not compress, and no more than
/// leave room for the largest coordinate.
fn fraction_bits(splats: &Splats) -> Result<i32, Error> {
    let largest = splats.splats.iter().map(|splat| splat.center.abs().max_element()).fold(0.0, f64::max);
    let mean = splats.splats.iter().map(|splat| splat.deviations[0]).sum::<f64>() / splats.len().max(1) as f64;
    let room = COORDINATE_BITS - (largest.max(1.0).log2().floor() as i32 + 1);
    if room < 0 {
        let limit = f64::from(COORDINATE_BITS).exp2();
        return Err(Error::TooFar { format: "SPZ", limit, found: largest });
    }
    Ok(((STEPS / mean).log2().ceil() as i32).clamp(0, room))
}

/// The unit quaternion x, y, z, w without its largest component, whose number the highest two bits are: a sign and nine bits
/// of magnitude up to √½ for each of the others.
fn smallest_three(quaternion: [f64; 4]) -> u32 {
    let largest = largest_component(quaternion);
    let mut bits = largest as u32;
    for (_, value) in quaternion.into_iter().enumerate().filter(|(n, _)| *n != largest) {
        // The opposite quaternion is the same rotation.
        let is_negative = (value < 0.0) != (quaternion[largest] < 0.0);
        let magnitude = (511.0 * (value.abs().min(FRAC_1_SQRT_2) * SQRT_2)).round() as u32;
        bits = bits << 10 | u32::from(is_negative) << 9 | magnitude;
    }
    bits
}
