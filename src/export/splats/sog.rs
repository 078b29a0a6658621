//! Splats as SOG, PlayCanvas's "Spatially Ordered Gaussians", version 2, bundled: a zip archive of `meta.json` and lossless
//! WebP pictures, of which a pixel is a splat.
//!
//! Centers have 16 bits on each axis; scales, colors and harmonics are indices into codebooks; harmonics of degrees 1 to 3 are
//! a palette. Splats are in the order of their Morton codes, along which the pictures change slowly. Source: "The SOG Format"
//! on developer.playcanvas.com. Axes are those of PLY.

use std::f64::consts::SQRT_2;
use std::io::{self, Cursor, Seek, Write};

use glam::{DVec3, UVec3};
use image::ExtendedColorType;
use image::codecs::webp::WebPEncoder;
use serde_json::{Value, json};
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, DateTime, ZipWriter};

use super::super::Error;
use super::codebook::Codebook;
use super::harmonics::terms;
use super::palette::Palette;
use super::{MAX_SPLATS, OPACITY, Splat, Splats, largest_component};
use strivec_format::geometry::{Aabb, morton};

/// Bits of a splat's cell on an axis.
const ORDER_BITS: u32 = 10;
/// Columns and rows are multiples of this, as in files of PlayCanvas.
const MULTIPLE: usize = 4;
/// Entries of the palette in a row of its picture.
const ENTRIES_OF_ROW: usize = 64;
/// The fourth channel of a rotation whose largest component is the first one.
const FIRST_LARGEST: u8 = 252;

/// Writes `splats` with the harmonics that they have.
///
/// # Errors
///
/// If there are too many splats, and if `out` fails.
pub fn write_sog(splats: &Splats, out: impl Write + Seek) -> Result<(), Error> {
    Error::unless_within("splats", MAX_SPLATS, splats.len() as u64)?;
    let order = order(&splats.splats);
    let mut archive = SogArchive { zip: ZipWriter::new(out), width: width(order.len()) };
    let of_splats = |pixel: &dyn Fn(&Splat) -> [u8; 4]| -> Vec<[u8; 4]> {
        order.iter().map(|&n| pixel(&splats.splats[n])).collect()
    };

    let logarithms = |splat: &Splat| splat.center.to_array().map(|value| value.abs().ln_1p().copysign(value));
    let bounds = Aabb::from_points(splats.splats.iter().map(|splat| DVec3::from_array(logarithms(splat))));
    let (mins, size) = (bounds.min.to_array(), bounds.size().to_array());
    let mean = |splat: &Splat, part: usize| {
        let logarithms = logarithms(splat);
        let [x, y, z] = [0, 1, 2].map(|axis| {
            let share = if size[axis] > 0.0 { (logarithms[axis] - mins[axis]) / size[axis] } else { 0.0 };
            ((share * f64::from(u16::MAX)).round() as u16).to_le_bytes()[part]
        });
        [x, y, z, u8::MAX]
    };
    archive.add("means_l.webp", of_splats(&|splat| mean(splat, 0)))?;
    archive.add("means_u.webp", of_splats(&|splat| mean(splat, 1)))?;
    archive.add("quats.webp", of_splats(&rotation))?;

    let scales = Codebook::of(splats.splats.iter().flat_map(|splat| splat.deviations.map(f64::ln)).collect());
    let scale = |splat: &Splat| {
        let [a, b, c] = splat.deviations.map(|value| scales.index(value.ln()));
        [a, b, c, u8::MAX]
    };
    archive.add("scales.webp", of_splats(&scale))?;

    let first = |n: usize| splats.coefficients_of(n)[0].map(f64::from);
    let colors = Codebook::of((0..splats.len()).flat_map(first).collect());
    let opacity = (255.0 * OPACITY).round() as u8;
    let color = |&n: &usize| {
        let [r, g, b] = first(n).map(|value| colors.index(value));
        [r, g, b, opacity]
    };
    archive.add("sh0.webp", order.iter().map(color).collect())?;

    let mut meta = json!({
        "version": 2,
        "asset": {"generator": concat!("strivec ", env!("CARGO_PKG_VERSION"))},
        "count": splats.len(),
        "means": {"mins": mins, "maxs": bounds.max.to_array(), "files": ["means_l.webp", "means_u.webp"]},
        "scales": {"codebook": &scales.numbers[..], "files": ["scales.webp"]},
        "quats": {"files": ["quats.webp"]},
        "sh0": {"codebook": &colors.numbers[..], "files": ["sh0.webp"]},
    });
    if splats.degree > 0 {
        meta["shN"] = archive.add_harmonics(splats, &order)?;
    }
    archive.finish(&meta)
}

/// The numbers of `splats` in the order of their Morton codes.
fn order(splats: &[Splat]) -> Vec<usize> {
    let bounds = Aabb::from_points(splats.iter().map(|splat| splat.center));
    let cells = f64::from((1 << ORDER_BITS) - 1);
    let code = |splat: &Splat| {
        let cell: UVec3 = ((splat.center - bounds.min) / bounds.size().max_element() * cells).as_uvec3();
        morton::encode(cell, 1, ORDER_BITS) as u32
    };
    let codes: Vec<u32> = splats.iter().map(code).collect();
    let mut order: Vec<usize> = (0..splats.len()).collect();
    order.sort_by_key(|&n| codes[n]);
    order
}

/// Columns of a picture of `count` pixels.
fn width(count: usize) -> usize {
    ((count as f64).sqrt().ceil() as usize).next_multiple_of(MULTIPLE)
}

/// Three components of a rotation and, as the fourth channel, the number of the largest one.
fn rotation(splat: &Splat) -> [u8; 4] {
    let [x, y, z, w] = splat.rotation.to_array();
    let quaternion = [w, x, y, z];
    let largest = largest_component(quaternion);
    // The opposite quaternion is the same rotation.
    let scale = SQRT_2.copysign(quaternion[largest]);
    let others = (0..4).filter(|&n| n != largest);
    let mut pixel = [FIRST_LARGEST + largest as u8; 4];
    for (channel, n) in pixel.iter_mut().zip(others) {
        *channel = (255.0 * (0.5 + 0.5 * (scale * quaternion[n]).clamp(-1.0, 1.0))).round() as u8;
    }
    pixel
}

/// The archive with its pictures so far.
struct SogArchive<W: Write + Seek> {
    zip: ZipWriter<W>,
    /// Columns of a picture of splats.
    width: usize,
}

impl<W: Write + Seek> SogArchive<W> {
    /// Adds a picture of splats.
    fn add(&mut self, name: &str, pixels: Vec<[u8; 4]>) -> Result<(), Error> {
        self.add_picture(name, self.width, pixels)
    }

    fn add_picture(&mut self, name: &str, width: usize, mut pixels: Vec<[u8; 4]>) -> Result<(), Error> {
        let height = pixels.len().div_ceil(width).next_multiple_of(MULTIPLE);
        pixels.resize(width * height, [0; 4]);
        let mut file = Cursor::new(Vec::new());
        WebPEncoder::new_lossless(&mut file)
            .encode(pixels.as_flattened(), width as u32, height as u32, ExtendedColorType::Rgba8)
            .map_err(io::Error::other)?;
        self.add_file(name, file.get_ref())
    }

    /// Adds a file as it is: pictures are compressed.
    fn add_file(&mut self, name: &str, bytes: &[u8]) -> Result<(), Error> {
        let options = SimpleFileOptions::default()
            .compression_method(CompressionMethod::Stored)
            .last_modified_time(DateTime::default());
        self.zip.start_file(name, options).map_err(io::Error::from)?;
        Ok(self.zip.write_all(bytes)?)
    }

    /// Adds the palette of the harmonics of degrees 1 and more. Returns its description.
    fn add_harmonics(&mut self, splats: &Splats, order: &[usize]) -> Result<Value, Error> {
        let rest = terms(splats.degree) - 1;
        let rows: Vec<f32> =
            order.iter().flat_map(|&n| splats.coefficients_of(n)[1..].as_flattened()).copied().collect();
        let palette = Palette::of(&rows, 3 * rest);
        let codebook = Codebook::of(palette.entries.iter().flatten().map(|&value| f64::from(value)).collect());
        let index = |value: f32| codebook.index(f64::from(value));
        let pixels = palette.entries.iter().flat_map(|entry| entry.as_chunks::<3>().0);
        let pixels = pixels.map(|&[r, g, b]| [index(r), index(g), index(b), u8::MAX]);
        self.add_picture("shN_centroids.webp", ENTRIES_OF_ROW * rest, pixels.collect())?;
        let label = |label: &u16| {
            let [low, high] = label.to_le_bytes();
            [low, high, 0, u8::MAX]
        };
        self.add("shN_labels.webp", palette.labels.iter().map(label).collect())?;
        Ok(json!({
            "count": palette.entries.len(),
            "bands": splats.degree,
            "codebook": &codebook.numbers[..],
            "files": ["shN_centroids.webp", "shN_labels.webp"],
        }))
    }

    fn finish(mut self, meta: &Value) -> Result<(), Error> {
        self.add_file("meta.json", meta.to_string().as_bytes())?;
        self.zip.finish().map_err(io::Error::from)?;
        Ok(())
    }
}
