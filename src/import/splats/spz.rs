//! SPZ (Niantic's format): splats as arrays of quantized numbers, versions 1 to 4.
//!
//! A header, then for all splats: centers (24-bit fixed point, or f16 in version 1), opacities, colors, scales, rotations
//! (three bytes, or the smallest three in four bytes since version 3), and harmonics, which are not read. Versions 1 to 3
//! are one gzip stream with a header of 16 bytes. Version 4 has a header of 32 bytes, extensions, the lengths of the
//! arrays, and one zstd frame for each array. Memory holds 20 bytes for each splat, and grows only as they are
//! decompressed; a count that gzip cannot reach in the file's length is refused before. Axes are the file's: right, up,
//! back, if its writer follows the format.

use std::io::Read;

use flate2::bufread::GzDecoder;
use glam::DVec3;
use half::f16;

use super::super::archive::reading;
use super::super::input::bytes_at;
use super::super::{Fault, Input, ReadOptions, Visitor};
use super::{Splat, color_of, report};

/// First bytes of the header.
const MAGIC: &[u8] = b"NGSP";
/// Splats of a file, as in the reference reader of versions 1 to 3.
const MAX_SPLATS: u64 = 10_000_000;
/// Largest ratio of inflated to compressed bytes, which the format of gzip allows.
const MAX_RATIO: u64 = 1032;
/// Bytes of the header of version 4, and of the lengths of an array: compressed and decompressed, u64 each.
const HEADER_4: usize = 32;
const LENGTHS: u64 = 16;
/// Scale of colors.
const COLOR_SCALE: f64 = 0.15;

/// The arrays that are read, in the order of the file.
const ARRAYS: [&str; 5] = ["the centers", "the opacities", "the colors", "the scales", "the rotations"];

/// Reads `input`.
///
/// # Errors
///
/// If the file breaks the format, and those of `visitor`.
pub fn read(input: &mut Input<'_>, options: &ReadOptions, visitor: &mut dyn Visitor) -> Result<(), Fault> {
    let len = input.len();
    SpzSplats::read(input)?.pass(options, len, visitor)
}

/// The splats of a file.
pub(crate) struct SpzSplats {
    header: SpzHeader,
    arrays: [Vec<u8>; 5],
}

impl SpzSplats {
    /// Decompresses `input`.
    ///
    /// # Errors
    ///
    /// If the file breaks the format.
    pub(crate) fn read(input: &mut Input<'_>) -> Result<Self, Fault> {
        let (header, arrays) = if input.peek(4)? == MAGIC { read_frames(input)? } else { read_gzip(input)? };
        Ok(Self { header, arrays })
    }

    pub(crate) fn count(&self) -> u64 {
        self.header.count as u64
    }

    /// Bytes in memory.
    pub(crate) fn len(&self) -> u64 {
        self.arrays.iter().map(|array| array.len() as u64).sum()
    }

    /// Passes the splats to `visitor`. `bytes` is the length of the file, for progress.
    ///
    /// # Errors
    ///
    /// If a coordinate is not finite, and those of `visitor`.
    pub(crate) fn pass(&self, options: &ReadOptions, bytes: u64, visitor: &mut dyn Visitor) -> Result<(), Fault> {
        let Self { header, arrays } = self;
        for n in 0..header.count {
            report(n as u64, header.count as u64, bytes, visitor)?;
            header.splat(arrays, n).pass(options, visitor, || format!("splat {n}"))?;
        }
        Ok(())
    }
}

/// Versions 1 to 3.
fn read_gzip(input: &mut Input<'_>) -> Result<(SpzHeader, [Vec<u8>; 5]), Fault> {
    let len = input.len();
    if input.peek(2)? != [0x1f, 0x8b] {
        return Err(Fault::broken("byte 0", "it begins with neither NGSP nor the mark of gzip, as SPZ files do"));
    }
    let mut inflated = GzDecoder::new(input);
    let header = SpzHeader::of(&part(&mut inflated, 16, "the header")?, 1..=3)?;
    let widths = header.widths();
    let bytes = widths.iter().sum::<usize>() * header.count;
    if bytes as u64 / MAX_RATIO > len {
        let problem = format!("{} splats do not fit into a file of {len} bytes", header.count);
        return Err(Fault::broken("the header", problem));
    }
    let mut arrays = [const { Vec::new() }; 5];
    for (n, array) in arrays.iter_mut().enumerate() {
        *array = part(&mut inflated, widths[n] * header.count, ARRAYS[n])?;
    }
    Ok((header, arrays))
}

/// Version 4.
fn read_frames(input: &mut Input<'_>) -> Result<(SpzHeader, [Vec<u8>; 5]), Fault> {
    let bytes: [u8; HEADER_4] = input.array("an SPZ header")?;
    let header = SpzHeader::of(&bytes, 4..=4)?;
    let (count, lengths_at) = (u64::from(bytes[15]), u32::from_le_bytes(bytes_at(&bytes, 16)));
    if count < ARRAYS.len() as u64 || u64::from(lengths_at) < HEADER_4 as u64 {
        let found = format!("{count} at byte {lengths_at}");
        return Err(Fault::malformed("the header", "at least 5 arrays after byte 31", found));
    }
    input.go_to(lengths_at.into())?;
    input.expect_left(LENGTHS * count, "the lengths of the arrays")?;
    let mut lengths = Vec::new();
    for _ in 0..count {
        let of_array: [u8; LENGTHS as usize] = input.array("the lengths of an array")?;
        lengths.push([0, 8].map(|at| u64::from_le_bytes(bytes_at(&of_array, at))));
    }
    let widths = header.widths();
    let mut arrays = [const { Vec::new() }; 5];
    for (n, array) in arrays.iter_mut().enumerate() {
        let ([compressed, length], bytes) = (lengths[n], widths[n] * header.count);
        if length != bytes as u64 {
            return Err(Fault::malformed(ARRAYS[n], format!("{bytes} bytes"), format!("{length} bytes")));
        }
        input.expect_left(compressed, ARRAYS[n])?;
        let end = input.offset() + compressed;
        // An empty array has no frame.
        if bytes > 0 {
            let mut frame = zstd::stream::read::Decoder::with_buffer((&mut *input).take(compressed))?;
            *array = part(&mut frame, bytes, ARRAYS[n])?;
        }
        input.go_to(end)?;
    }
    Ok((header, arrays))
}

struct SpzHeader {
    version: u32,
    count: usize,
    /// Bits of a coordinate after the point.
    fraction: u32,
}

impl SpzHeader {
    /// The header in `bytes`, of at least 16 bytes.
    fn of(bytes: &[u8], versions: std::ops::RangeInclusive<u32>) -> Result<Self, Fault> {
        if !bytes.starts_with(MAGIC) {
            return Err(Fault::malformed("the header", "NGSP", format!("{:02x?}", &bytes[..4])));
        }
        let [version, count] = [4, 8].map(|at| u32::from_le_bytes(bytes_at(bytes, at)));
        if !versions.contains(&version) {
            let what = format!("SPZ of version {version}");
            return Err(Fault::unsupported(what, "write it as version 3 or 4, or as PLY"));
        }
        let fraction = u32::from(bytes[13]);
        if fraction > 23 {
            return Err(Fault::malformed("the header", "at most 23 bits after the point", fraction));
        }
        Fault::unless_within("splats", MAX_SPLATS, count.into())?;
        Ok(Self { version, count: count as usize, fraction })
    }

    /// Bytes of a splat in each array.
    fn widths(&self) -> [usize; 5] {
        let (center, rotation) = (if self.version == 1 { 6 } else { 9 }, if self.version >= 3 { 4 } else { 3 });
        [center, 1, 3, 3, rotation]
    }

    /// Splat `n`.
    fn splat(&self, arrays: &[Vec<u8>; 5], n: usize) -> Splat {
        let [centers, opacities, colors, scales, rotations] = arrays;
        let axes = [0, 1, 2];
        let center = axes.map(|axis| match self.version {
            1 => f64::from(f16::from_le_bytes(bytes_at(centers, 6 * n + 2 * axis))),
            _ => {
                let [a, b, c] = bytes_at(centers, 9 * n + 3 * axis);
                f64::from(i32::from_le_bytes([0, a, b, c]) >> 8) / f64::from(1_u32 << self.fraction)
            }
        });
        let of = |array: &[u8], axis: usize| f64::from(array[3 * n + axis]);
        Splat {
            center: DVec3::from_array(center),
            deviations: axes.map(|axis| (of(scales, axis) / 16.0 - 10.0).exp()),
            rotation: if self.version >= 3 {
                smallest_three(u32::from_le_bytes(bytes_at(rotations, 4 * n)))
            } else {
                let [x, y, z] = axes.map(|axis| of(rotations, axis) / 127.5 - 1.0);
                [(1.0 - x * x - y * y - z * z).max(0.0).sqrt(), x, y, z]
            },
            opacity: f64::from(opacities[n]) / 255.0,
            color: Some(color_of(axes.map(|axis| (of(colors, axis) / 255.0 - 0.5) / COLOR_SCALE))),
        }
    }
}

/// The next `bytes` decompressed bytes.
fn part(decompressed: &mut impl Read, bytes: usize, what: &str) -> Result<Vec<u8>, Fault> {
    let mut part = Vec::new();
    decompressed.take(bytes as u64).read_to_end(&mut part).map_err(|error| reading(what, error))?;
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
    use crate::testing::seen_with;

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
            3 | 4 => bytes.extend([(3_u32 << 30 | 511 << 20).to_le_bytes(), [0; 4]].concat()),
            _ => bytes.extend([218, 128, 128, 128, 128, 128]),
        }
        bytes
    }

    /// A file of version 4: a header, an extension, the lengths, and a frame for each array.
    fn frames() -> Vec<u8> {
        let whole = file(4);
        let mut arrays = Vec::new();
        let mut at = 16;
        for width in [9, 1, 3, 3, 4] {
            arrays.push(zstd::bulk::compress(&whole[at..at + 2 * width], 3).unwrap());
            at += 2 * width;
        }
        let mut bytes = whole[..16].to_vec();
        (bytes[14], bytes[15]) = (2, 5);
        bytes.extend(44_u32.to_le_bytes());
        // The rest of the header, and an extension of four bytes.
        bytes.extend([0; 12]);
        bytes.extend([1, 0, 1, 0, 4, 0, 0, 0, 9, 9, 9, 9]);
        for (array, width) in arrays.iter().zip([9, 1, 3, 3, 4]) {
            bytes.extend([array.len() as u64, 2 * width].iter().flat_map(|v| v.to_le_bytes()));
        }
        [bytes, arrays.concat()].concat()
    }

    #[test]
    fn all_versions_hold_the_same_splats() {
        for version in [1, 2, 3, 4] {
            let bytes = if version == 4 { frames() } else { gzip(&file(version)) };
            let seen = seen_with(&bytes, &ReadOptions::default(), read).unwrap();
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
        let message = "byte 0: it begins with neither NGSP nor the mark of gzip, as SPZ files do";
        assert_eq!(fault(b"PK"), message);
        assert_eq!(fault(b"NGSP"), "byte 0: expected 32 bytes of an SPZ header, found 4 bytes");
        let message = "SPZ of version 5 is not supported: write it as version 3 or 4, or as PLY";
        assert_eq!(fault(&changed(0, 0)), "the header: expected NGSP, found [00, 00, 00, 00]");
        assert_eq!(fault(&changed(4, 5)), message);
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

    #[test]
    fn hostile_frames_are_named() {
        let fault = |at: usize, to: u8| {
            let mut bytes = frames();
            bytes[at] = to;
            seen_with(&bytes, &ReadOptions::default(), read).unwrap_err().to_string()
        };
        assert_eq!(fault(4, 5), "SPZ of version 5 is not supported: write it as version 3 or 4, or as PLY");
        assert_eq!(fault(10, 255), "splats: at most 10000000 are read, found 16711682");
        assert_eq!(fault(8, 3), "the centers: expected 27 bytes, found 18 bytes");
        assert_eq!(fault(15, 4), "the header: expected at least 5 arrays after byte 31, found 4 at byte 44");
        assert_eq!(fault(16, 31), "the header: expected at least 5 arrays after byte 31, found 5 at byte 31");
        assert_eq!(
            fault(15, 255).split(", found").next().unwrap(),
            "byte 44: expected 4080 bytes of the lengths of the arrays"
        );
        assert!(fault(18, 255).starts_with("byte 16711724: expected an offset inside the file"));
        assert!(fault(50, 255).starts_with("byte 124: expected "), "{}", fault(50, 255));
        assert_eq!(fault(44, 0), "the centers: it ends early");
        for at in 0..frames().len() {
            let mut damaged = frames();
            damaged[at] ^= 0x55;
            let _ = seen_with(&damaged, &ReadOptions::default(), read);
            let _ = seen_with(&damaged[..at], &ReadOptions::default(), read);
        }
    }
}
