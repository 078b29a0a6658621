//! Colors, opacities and depths as the bytes of PNG files, and colors as those of JPEG files.

use std::io::Cursor;

use image::codecs::jpeg::JpegEncoder;
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder};

use super::Error;
use strivec_format::color::byte;

/// `value` in \[0, 1\] as a whole number from 0 to `full`, half rounded up. Values outside are clamped; NaN is 0.
fn quantized(value: f64, full: f64) -> f64 {
    (value.clamp(0.0, 1.0) * full + 0.5).floor()
}

/// A color as 8-bit sRGB.
pub(super) fn color_bytes(color: [f32; 3]) -> [u8; 3] {
    color.map(|v| byte(f64::from(v)))
}

/// An 8-bit sRGB PNG of `colors` of `size` (columns, rows).
///
/// # Errors
///
/// [`Error::Size`] if the number of colors differs from `size`; [`Error::Empty`] if there are none.
pub fn color_png(size: [u32; 2], colors: &[[f32; 3]]) -> Result<Vec<u8>, Error> {
    let bytes: Vec<u8> = colors.iter().flat_map(|&color| color_bytes(color)).collect();
    encoded(size, colors.len(), &bytes, ExtendedColorType::Rgb8)
}

/// A JPEG of `colors` of `size` (columns, rows) and of `quality` from 1 to 100, for pictures like photographs.
///
/// # Errors
///
/// The errors of [`color_png`].
pub fn color_jpeg(size: [u32; 2], colors: &[[f32; 3]], quality: u8) -> Result<Vec<u8>, Error> {
    Error::unless_size(size, colors.len())?;
    if colors.is_empty() {
        return Err(Error::Empty);
    }
    let bytes: Vec<u8> = colors.iter().flat_map(|&color| color_bytes(color)).collect();
    let mut jpeg = Vec::new();
    JpegEncoder::new_with_quality(&mut jpeg, quality).encode(&bytes, size[0], size[1], ExtendedColorType::Rgb8)?;
    Ok(jpeg)
}

/// An 8-bit gray PNG of `opacities` in \[0, 1\] of `size` (columns, rows).
///
/// # Errors
///
/// The errors of [`color_png`].
pub fn opacity_png(size: [u32; 2], opacities: &[f32]) -> Result<Vec<u8>, Error> {
    let bytes: Vec<u8> = opacities.iter().map(|&v| byte(f64::from(v))).collect();
    encoded(size, opacities.len(), &bytes, ExtendedColorType::L8)
}

/// The gray values of depths in 16-bit pictures.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum DepthCode {
    /// A value v stands for the depth v·`unit`, up to 65535·`unit`.
    Linear {
        /// Positive.
        unit: f64,
    },
    /// A value v above 0 stands for the depth `scale`·(65535/v − 1): near depths have small steps, and far ones any
    /// value.
    Reciprocal {
        /// The depth of half the largest value; positive.
        scale: f64,
    },
}

impl DepthCode {
    /// The value of `depth`, from 0 to 1, and 0 for nothing: a depth of 0 or less.
    fn share(self, depth: f64) -> f64 {
        match self {
            Self::Linear { unit } => depth / unit / f64::from(u16::MAX),
            Self::Reciprocal { scale } if depth > 0.0 => {
                // However far, it is something.
                (scale / (scale + depth)).max(1.0 / f64::from(u16::MAX))
            }
            Self::Reciprocal { .. } => 0.0,
        }
    }
}

/// A 16-bit gray PNG of `depths` of `size` (columns, rows) as values of `code`.
///
/// # Errors
///
/// The errors of [`color_png`].
pub fn depth_png(size: [u32; 2], depths: &[f64], code: DepthCode) -> Result<Vec<u8>, Error> {
    let full = f64::from(u16::MAX);
    // The encoder takes 16-bit samples in the machine's byte order.
    let bytes: Vec<u8> =
        depths.iter().flat_map(|&depth| (quantized(code.share(depth), full) as u16).to_ne_bytes()).collect();
    encoded(size, depths.len(), &bytes, ExtendedColorType::L16)
}

fn encoded(size: [u32; 2], pixels: usize, bytes: &[u8], color: ExtendedColorType) -> Result<Vec<u8>, Error> {
    Error::unless_size(size, pixels)?;
    if pixels == 0 {
        return Err(Error::Empty);
    }
    let mut png = Cursor::new(Vec::new());
    PngEncoder::new_with_quality(&mut png, CompressionType::Default, FilterType::Adaptive)
        .write_image(bytes, size[0], size[1], color)?;
    Ok(png.into_inner())
}
