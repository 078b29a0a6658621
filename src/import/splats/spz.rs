//! SPZ: splats as arrays of quantized numbers in gzip, versions 1 to 3.
//!
//! A header of 16 bytes, then for all splats: centers (24-bit fixed point, or f16 in version 1), opacities, colors,
//! scales, rotations (three bytes, or the smallest three in four bytes in version 3), and harmonics, which are not
//! read. Memory holds 20 bytes for each splat, and grows only as they are inflated; a count that gzip cannot reach in
//! the file's length is refused before. Axes are the file's: right, up, back, if its writer follows the format.

use std::io::Read;

use flate2::bufread::GzDecoder;
use glam::DVec3;
use half::f16;

use super::super::archive::reading;
use super::super::input::bytes_at;
use super::super::{Fault, Input, ReadOptions, Visitor};
use super::{Splat, color_of};

/// First bytes of the header. Version 4 does not compress them.
const MAGIC: &[u8] = b"NGSP";
/// Splats of a file, as in the reference reader.
const MAX_SPLATS: u64 = 10_000_000;
/// Largest ratio of inflated to compressed bytes, which the format of gzip allows.
const MAX_RATIO: u64 = 1032;
/// Scale of colors.
const COLOR_SCALE: f64 = 0.15;

/// Reads `input`.
///
/// # Errors
///
/// If the file breaks the format, and those of `visitor`.
pub fn read(input: &mut Input<'_>, options: &ReadOptions, visitor: &mut dyn Visitor) -> Result<(), Fault> {
    let len = input.len();
    let start = input.peek(8)?;
    if start.starts_with(MAGIC) && start.len() == 8 {
        return Err(unsupported(u32::from_le_bytes(bytes_at(&start, 4))));
    }
    if !start.starts_with(&[0x1f, 0x8b]) {
        return Err(Fault::invalid("byte 0", "it is not gzip, which SPZ of versions 1 to 3 is"));
    }
    let mut inflated = GzDecoder::new(input);
    let header = part(&mut inflated, 16, "the header")?;
    let word = |at: usize| u32::from_le_bytes(bytes_at(&header, at));
    if !header.starts_with(MAGIC) {
        return Err(Fault::malformed("the header", "NGSP", format!("{:02x?}", &header[..4])));
    }
    let (version, count, fraction) = (word(4), word(8), u32::from(header[13]));
    if !(1..=3).contains(&version) {
        return Err(unsupported(version));
    }
    if fraction > 23 {
        return Err(Fault::malformed("the header", "at most 23 bits after the point", fraction));
    }
    Fault::unless_within("splats", MAX_SPLATS, count.into())?;
    let count = count as usize;
    let (center_bytes, rotation_bytes) = (if version == 1 { 6 } else { 9 }, if version == 3 { 4 } else { 3 });
    let bytes = (center_bytes + rotation_bytes + 7) * count;
    if bytes as u64 / MAX_RATIO > len {
        return Err(Fault::invalid("the header", format!("{count} splats do not fit into a file of {len} bytes")));
    }
    let mut array = |width: usize, what: &str| part(&mut inflated, width * count, what);
    let centers = array(center_bytes, "the centers")?;
    let opacities = array(1, "the opacities")?;
    let colors = array(3, "the colors")?;
    let scales = array(3, "the scales")?;
    let rotations = array(rotation_bytes, "the rotations")?;
    let axes = [0, 1, 2];
    for n in 0..count {
        if n % (1 << 16) == 0 {
            visitor.progress((len as f64 * n as f64 / count as f64) as u64, len)?;
        }
        let center = axes.map(|axis| match version {
            1 => f64::from(f16::from_le_bytes(bytes_at(&centers, 6 * n + 2 * axis))),
            _ => {
                let [a, b, c] = bytes_at(&centers, 9 * n + 3 * axis);
                f64::from(i32::from_le_bytes([0, a, b, c]) >> 8) / f64::from(1_u32 << fraction)
            }
        });
        let of = |array: &[u8], axis: usize| f64::from(array[3 * n + axis]);
        let splat = Splat {
            center: DVec3::from_array(center),
            deviations: axes.map(|axis| (of(&scales, axis) / 16.0 - 10.0).exp()),
            rotation: match version {
                3 => smallest_three(u32::from_le_bytes(bytes_at(&rotations, 4 * n))),
                _ => {
                    let [x, y, z] = axes.map(|axis| of(&rotations, axis) / 127.5 - 1.0);
                    [(1.0 - x * x - y * y - z * z).max(0.0).sqrt(), x, y, z]
                }
            },
            opacity: f64::from(opacities[n]) / 255.0,
            color: Some(color_of(axes.map(|axis| (of(&colors, axis) / 255.0 - 0.5) / COLOR_SCALE))),
        };
        splat.pass(options, visitor, || format!("splat {n}"))?;
    }
    Ok(())
}

fn unsupported(version: u32) -> Fault {
    Fault::unsupported(format!("SPZ of version {version}"), "write it as version 2 or 3, or as PLY")
}

/// The next `bytes` inflated bytes.
fn part(inflated: &mut impl Read, bytes: usize, what: &str) -> Result<Vec<u8>, Fault> {
    let mut part = Vec::new();
    inflated.take(bytes as u64).read_to_end(&mut part).map_err(|error| reading(what, error))?;
    if part.len() == bytes {
        return Ok(part);
    }
    Err(Fault::malformed(what, format!("{bytes} bytes"), format!("{} bytes", part.len())))
}

/// The quaternion w, x, y, z of three components of ten bits, a sign and a magnitude up to √½ each, without the
/// largest one, which the highest two bits number as x, y, z, w.
fn smallest_three(mut bits: u32) -> [f64; 4] {
    let largest = (bits >> 30) as usize;
    let (mut found, mut squares) = ([0.0; 4], 0.0);
    for component in (0..4).rev().filter(|&component| component != largest) {
        let magnitude = std::f64::consts::FRAC_1_SQRT_2 * f64::from(bits & 511) / 511.0;
        found[component] = if bits & 512 == 0 { magnitude } else { -magnitude };
        squares += magnitude * magnitude;
        bits >>= 10;
    }
    found[largest] = (1.0_f64 - squares).max(0.0).sqrt();
    let [x, y, z, w] = found;
    [w, x, y, z]
}

#[cfg(test)]
mod tests {
    use std::io::Write;

    use super::*;
    use crate::import::testing::seen_with;

    fn gzip(bytes: &[u8]) -> Vec<u8> {
        let mut encoder = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::default());
        encoder.write_all(bytes).unwrap();
        encoder.finish().unwrap()
    }

    /// Two splats: at (1, -2, 0.5), opaque, scales e^-2, e^-1, e^-10, a quarter turn about x; and a transparent one.
    fn file(version: u32) -> Vec<u8> {
        let mut bytes = b"NGSP".to_vec();
        bytes.extend([version, 2].iter().flat_map(|v| v.to_le_bytes()));
        bytes.extend([0, 12, 0, 0]);
        for value in [1.0, -2.0, 0.5, 0.0, 0.0, 0.0] {
            match version {
                1 => bytes.extend(f16::from_f64(value).to_le_bytes()),
                _ => bytes.extend(&((value * 4096.0) as i32).to_le_bytes()[..3]),
            }
        }
        bytes.extend([255, 5]);
        bytes.extend([128, 255, 0, 0, 0, 0]);
        bytes.extend([128, 144, 0, 0, 0, 0]);
        match version {
            // x is √½, and w the largest.
            3 => bytes.extend([(3_u32 << 30 | 511 << 20).to_le_bytes(), [0; 4]].concat()),
            _ => bytes.extend([218, 128, 128, 128, 128, 128]),
        }
        bytes
    }

    #[test]
    fn all_versions_hold_the_same_splats() {
        for version in [1, 2, 3] {
            let seen = seen_with(&gzip(&file(version)), &ReadOptions::default(), read).unwrap();
            let [(center, axes)] = seen.splats[..] else { panic!("{version}: {seen:?}") };
            assert_eq!(center.position.to_array(), [1.0, -2.0, 0.5], "{version}");
            assert_eq!(center.color, Some([128, 255, 0]), "{version}");
            let [a, b] = [2.0 * (-2.0_f64).exp(), 2.0 * (-1.0_f64).exp()];
            let expected = [DVec3::X * a, DVec3::Z * b, DVec3::ZERO];
            assert!(axes.iter().zip(expected).all(|(axis, e)| axis.distance(e) < 0.02), "{version}: {axes:?}");
            assert_eq!(seen.left_out.len(), 1);
        }
    }

    #[test]
    fn hostile_files_are_named() {
        let fault = |bytes: &[u8]| seen_with(bytes, &ReadOptions::default(), read).unwrap_err().to_string();
        let changed = |at: usize, to: u32| {
            let mut bytes = file(2);
            bytes[at..at + 4].copy_from_slice(&to.to_le_bytes());
            gzip(&bytes)
        };
        let message = "SPZ of version 4 is not supported: write it as version 2 or 3, or as PLY";
        assert_eq!(fault(&[b"NGSP", &4_u32.to_le_bytes()[..], &[0; 24]].concat()), message);
        assert_eq!(fault(b"NGSP"), "byte 0: it is not gzip, which SPZ of versions 1 to 3 is");
        assert_eq!(fault(&changed(0, 0)), "the header: expected NGSP, found [00, 00, 00, 00]");
        assert_eq!(fault(&changed(4, 4)), message);
        assert_eq!(fault(&changed(8, u32::MAX)), "splats: at most 10000000 are read, found 4294967295");
        assert_eq!(fault(&changed(8, 3)), "the colors: expected 9 bytes, found 8 bytes");
        let many = changed(8, 9_999_999);
        let message = format!("the header: 9999999 splats do not fit into a file of {} bytes", many.len());
        assert_eq!(fault(&many), message);
        assert_eq!(fault(&changed(12, 0xff00)), "the header: expected at most 23 bits after the point, found 255");
        let mut short = gzip(&file(2));
        short.truncate(30);
        assert!(fault(&short).starts_with("the "), "{}", fault(&short));
        for at in 0..short.len() {
            let mut damaged = gzip(&file(3));
            damaged[at] ^= 0x55;
            let _ = seen_with(&damaged, &ReadOptions::default(), read);
        }
    }
}
