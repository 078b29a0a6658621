//! SOG, PlayCanvas's "Spatially Ordered Gaussians", versions 1 and 2: `meta.json` and pictures, of which a pixel is a
//! splat, row by row; bundled in a zip archive, or as files in a folder.
//!
//! Centers have 16 bits in two pictures, between limits, as sign(x) · ln(|x| + 1). Scales are logarithms, colors
//! coefficients of degree 0: indices into a codebook of 256 numbers in version 2, shares between limits in version 1, which
//! has no field `version`. The opacity is the fourth channel of the colors: itself in version 2, before the sigmoid in
//! version 1. Rotations are the three smaller components and, as the fourth channel, 252 plus the number of the largest.
//! Higher harmonics are not read. Source: "The SOG Format" on developer.playcanvas.com, and the readers of
//! `@playcanvas/splat-transform` 2.7.
//!
//! Pictures are lossless WebP, or PNG. Their size is checked before they are decoded. Memory holds 20 bytes for each splat,
//! and one picture of up to 2^24 pixels while it is decoded. Axes are the file's.

use std::io::Cursor;

use glam::DVec3;
use image::{DynamicImage, ImageDecoder, ImageFormat, ImageReader, Limits};
use serde::Deserialize;

use super::super::archive::Archive;
use super::super::{Fault, Input, ReadOptions, Visitor};
use super::{Splat, color_of, report, sigmoid, with_largest};

/// Name of the description.
pub(crate) const META: &str = "meta.json";
/// Bytes of the description; it has a few hundred numbers.
const MAX_META: u64 = 1 << 20;
/// Bytes of a picture file.
const MAX_FILE: u64 = 1 << 28;
/// Pixels of a picture. A few bytes can stand for any number of equal pixels, so the file's size is no bound.
const MAX_PIXELS: u64 = 1 << 24;
/// Numbers of a codebook: one for each value of a byte.
const CODES: usize = 256;
/// The fourth channel of a rotation whose largest component is the first one.
const FIRST_LARGEST: u8 = 252;

/// The used parts of `meta.json`.
#[derive(Deserialize)]
struct Meta {
    version: Option<u64>,
    count: Option<u64>,
    means: Part,
    scales: Part,
    quats: Part,
    sh0: Part,
}

/// A property of all splats.
#[derive(Deserialize)]
struct Part {
    files: Vec<String>,
    /// Version 1: lengths, the first of which is the number of splats.
    #[serde(default)]
    shape: Vec<u64>,
    #[serde(default)]
    mins: Vec<f64>,
    #[serde(default)]
    maxs: Vec<f64>,
    /// Version 2.
    #[serde(default)]
    codebook: Vec<Option<f64>>,
}

/// Gives the bytes of a file by its name.
type Files<'a> = dyn FnMut(&str) -> Result<Vec<u8>, Fault> + 'a;

/// Reads `input`, a bundle.
///
/// # Errors
///
/// If the file breaks the format, and those of `visitor`.
pub fn read(input: &mut Input<'_>, options: &ReadOptions, visitor: &mut dyn Visitor) -> Result<(), Fault> {
    let len = input.len();
    let mut archive = Archive::open(input)?;
    let meta = archive.bytes(META, MAX_META)?;
    read_files(&meta, &mut |name| archive.bytes(name, MAX_FILE), len, options, visitor)
}

/// Reads `input`, a `meta.json`; `beside` returns the bytes of the files that it names.
///
/// # Errors
///
/// If a file breaks the format, and those of `visitor`.
pub fn read_meta(
    input: &mut Input<'_>,
    beside: &dyn Fn(&str) -> Result<Vec<u8>, Fault>,
    options: &ReadOptions,
    visitor: &mut dyn Visitor,
) -> Result<(), Fault> {
    let len = input.len();
    Fault::unless_within("bytes of the description", MAX_META, len)?;
    let mut meta = vec![0; len as usize];
    input.fill(&mut meta, "JSON")?;
    read_files(&meta, &mut |name| beside(name), len, options, visitor)
}

/// `bytes` is the length of the file, for progress.
fn read_files(
    meta: &[u8],
    files: &mut Files<'_>,
    bytes: u64,
    options: &ReadOptions,
    visitor: &mut dyn Visitor,
) -> Result<(), Fault> {
    let splats = SogSplats::read(meta, files)?;
    for n in 0..splats.count {
        report(n as u64, splats.count as u64, bytes, visitor)?;
        splats.splat(n)?.pass(options, visitor, || format!("splat {n}"))?;
    }
    Ok(())
}

/// Red, green, blue and alpha of the first pixels of a picture.
type Pixels = Vec<[u8; 4]>;

/// The splats of a file.
struct SogSplats {
    count: usize,
    /// Limits of the centers' transformed coordinates.
    means: [[f64; 2]; 3],
    low: Pixels,
    high: Pixels,
    rotations: Pixels,
    scales: Pixels,
    scale_tables: [Table; 3],
    colors: Pixels,
    /// Tables of the coefficients, then of the opacity.
    color_tables: [Table; 4],
}

/// The numbers of the values of a byte.
type Table = [f64; CODES];

impl SogSplats {
    /// Decodes the pictures that `meta` describes.
    fn read(meta: &[u8], files: &mut Files<'_>) -> Result<Self, Fault> {
        let meta: Meta = serde_json::from_slice(meta)
            .map_err(|error| Fault::broken(META, format!("not a description of splats: {error}")))?;
        let first = meta.version.is_none();
        if let Some(version) = meta.version.filter(|&version| version != 2) {
            let what = format!("SOG of version {version}");
            return Err(Fault::unsupported(what, "convert it to version 2, or to PLY"));
        }
        let declared = if first { meta.means.shape.first().copied() } else { meta.count };
        let declared = declared.ok_or_else(|| Fault::broken(META, "it has no number of splats"))?;
        Fault::unless_within("splats", MAX_PIXELS, declared)?;
        let count = declared as usize;
        let means = limits::<3>(&meta.means, "means")?;
        let scale_tables =
            if first { lerped(limits(&meta.scales, "scales")?) } else { [codebook(&meta.scales, "scales")?; 3] };
        let color_tables = if first {
            let [red, green, blue, opacity] = lerped(limits::<4>(&meta.sh0, "sh0")?);
            [red, green, blue, opacity.map(sigmoid)]
        } else {
            let coefficients = codebook(&meta.sh0, "sh0")?;
            [coefficients, coefficients, coefficients, std::array::from_fn(|n| n as f64 / 255.0)]
        };
        let mut pixels = |part: &Part, file: usize, what: &str| {
            let name = part.files.get(file).ok_or_else(|| Fault::broken(META, format!("{what} has no file {file}")))?;
            pixels_of(&files(name)?, name, count)
        };
        Ok(Self {
            count,
            means,
            low: pixels(&meta.means, 0, "means")?,
            high: pixels(&meta.means, 1, "means")?,
            rotations: pixels(&meta.quats, 0, "quats")?,
            scales: pixels(&meta.scales, 0, "scales")?,
            scale_tables,
            colors: pixels(&meta.sh0, 0, "sh0")?,
            color_tables,
        })
    }

    /// Splat `n`.
    fn splat(&self, n: usize) -> Result<Splat, Fault> {
        let axes = [0, 1, 2];
        let center = axes.map(|axis| {
            let share = f64::from(u16::from_le_bytes([self.low[n][axis], self.high[n][axis]])) / f64::from(u16::MAX);
            let [min, max] = self.means[axis];
            let logarithm = min + (max - min) * share;
            logarithm.abs().exp_m1().copysign(logarithm)
        });
        let [a, b, c, largest] = self.rotations[n];
        if largest < FIRST_LARGEST {
            return Err(Fault::malformed(format!("the rotation of splat {n}"), "an alpha of 252 to 255", largest));
        }
        let component = |byte: u8| (f64::from(byte) / 127.5 - 1.0) * std::f64::consts::FRAC_1_SQRT_2;
        let color = |channel: usize| self.color_tables[channel][usize::from(self.colors[n][channel])];
        Ok(Splat {
            center: DVec3::from_array(center),
            deviations: axes.map(|axis| self.scale_tables[axis][usize::from(self.scales[n][axis])].exp()),
            rotation: with_largest(usize::from(largest - FIRST_LARGEST), [a, b, c].map(component)),
            opacity: color(3),
            color: Some(color_of(axes.map(color))),
        })
    }
}

/// The smallest and the largest number of each channel of `part`.
fn limits<const N: usize>(part: &Part, what: &str) -> Result<[[f64; 2]; N], Fault> {
    for (name, numbers) in [("mins", &part.mins), ("maxs", &part.maxs)] {
        if numbers.len() < N {
            return Err(Fault::malformed(META, format!("{N} numbers in {name} of {what}"), numbers.len()));
        }
    }
    Ok(std::array::from_fn(|channel| [part.mins[channel], part.maxs[channel]]))
}

/// Tables of shares between limits.
fn lerped<const N: usize>(limits: [[f64; 2]; N]) -> [Table; N] {
    limits.map(|[min, max]| std::array::from_fn(|n| min + (max - min) * n as f64 / 255.0))
}

/// The codebook of `part`. Early writers left its first number out, which PlayCanvas's engine extrapolates.
fn codebook(part: &Part, what: &str) -> Result<Table, Fault> {
    let found = &part.codebook;
    let numbers: Vec<f64> = found.iter().flatten().copied().collect();
    let missing = found.first() == Some(&None);
    let mut table = [0.0; CODES];
    if found.len() != CODES || numbers.len() + usize::from(missing) != CODES {
        return Err(Fault::malformed(META, format!("{CODES} numbers in the codebook of {what}"), numbers.len()));
    }
    table[usize::from(missing)..].copy_from_slice(&numbers);
    if missing {
        table[0] = table[1] + (table[1] - table[CODES - 1]) / 255.0;
    }
    Ok(table)
}

/// The first `count` pixels of the picture `name`.
fn pixels_of(bytes: &[u8], name: &str, count: usize) -> Result<Pixels, Fault> {
    let undecodable = |error: image::ImageError| Fault::broken(name, format!("it cannot be decoded: {error}"));
    // Only this kind of WebP is lossless without further chunks.
    let format = if bytes.starts_with(b"RIFF") && bytes.get(8..16) == Some(b"WEBPVP8L") {
        ImageFormat::WebP
    } else if bytes.starts_with(b"\x89PNG\r\n\x1a\n") {
        ImageFormat::Png
    } else {
        let found = format!("{:02x?}", &bytes[..bytes.len().min(16)]);
        return Err(Fault::malformed(name, "the first bytes of lossless WebP or of PNG", found));
    };
    let mut reader = ImageReader::with_format(Cursor::new(bytes), format);
    let mut limits = Limits::default();
    limits.max_alloc = Some(16 * MAX_PIXELS);
    reader.limits(limits);
    let decoder = reader.into_decoder().map_err(undecodable)?;
    let (width, height) = decoder.dimensions();
    let found = u64::from(width) * u64::from(height);
    Fault::unless_within(&format!("{name}: pixels"), MAX_PIXELS, found)?;
    if found < count as u64 {
        return Err(Fault::malformed(
            name,
            format!("a pixel for each of {count} splats"),
            format!("{width} x {height}"),
        ));
    }
    let picture = DynamicImage::from_decoder(decoder).map_err(undecodable)?.into_rgba8();
    Ok(picture.as_raw().as_chunks::<4>().0[..count].to_vec())
}
