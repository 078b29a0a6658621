//! Pictures (PNG, JPEG, WebP, TIFF) to pixels: decoding within limits, averaging blocks.

use std::fs::File;
use std::io::{Cursor, Read};
use std::path::Path;

use image::metadata::Orientation;
use image::{ColorType, DynamicImage, ImageDecoder, ImageFormat, ImageReader, Limits};

use super::{Error, Pixels, files};

/// The longest edge of a picture that is decoded.
pub(super) const MAX_EDGE: u32 = 16_384;
/// The most bytes that a picture may take in memory.
const MAX_DECODED_BYTES: u64 = 512 << 20;
/// The first bytes of a JPEG file: start of image, and the next marker's first byte.
const JPEG_START: [u8; 3] = [0xff, 0xd8, 0xff];

/// The bytes with which a file begins; enough for the header of nearly every picture.
const HEAD_BYTES: u64 = 256 << 10;

/// A picture's size and orientation, from its header.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct PictureHeader {
    /// Columns and rows as stored.
    pub(super) size: [u32; 2],
    /// How to turn the stored picture so that up is up.
    pub(super) orientation: Orientation,
    /// True if the picture has more than 8 bits per channel.
    pub(super) is_deep: bool,
}

impl PictureHeader {
    /// The header of a picture of `size` that is upright.
    pub(super) fn upright(size: [u32; 2]) -> Self {
        Self { size, orientation: Orientation::NoTransforms, is_deep: false }
    }

    /// Columns and rows once the picture is turned.
    pub(super) fn turned_size(&self) -> [u32; 2] {
        use Orientation::{Rotate90, Rotate90FlipH, Rotate270, Rotate270FlipH};
        let [width, height] = self.size;
        match self.orientation {
            Rotate90 | Rotate270 | Rotate90FlipH | Rotate270FlipH => [height, width],
            _ => [width, height],
        }
    }
}

/// The header of the picture at `path`. Reads the beginning of the file, or all of it if that is not enough.
pub(super) fn header(path: &Path) -> Result<PictureHeader, Error> {
    let mut head = Vec::new();
    let file = File::open(path).map_err(Error::read(path))?;
    file.take(HEAD_BYTES).read_to_end(&mut head).map_err(Error::read(path))?;
    let header = |bytes: &[u8]| {
        let mut decoder = decoder(path, bytes)?;
        let orientation = decoder.orientation().unwrap_or(Orientation::NoTransforms);
        Ok(PictureHeader { size: decoder.dimensions().into(), orientation, is_deep: is_deep(decoder.color_type()) })
    };
    match header(&head) {
        Err(_) if head.len() as u64 == HEAD_BYTES => {
            let bytes = files::read(path)?;
            check_end(path, &bytes).and_then(|()| header(&bytes))
        }
        Err(error) => check_end(path, &head).and(Err(error)),
        found => found,
    }
}

/// The colors of the picture at `path`, turned by its orientation if `is_turned`, then made `downscale` times smaller;
/// columns and rows that do not fill a block are dropped.
pub(super) fn load(path: &Path, is_turned: bool, downscale: u32) -> Result<Pixels, Error> {
    let picture = decoded(path, is_turned)?;
    let (width, downscale) = (picture.width() as usize, downscale as usize);
    Ok(if is_deep(picture.color()) {
        averaged(picture.into_rgba16().as_raw(), width, u64::from(u16::MAX), downscale)
    } else if downscale > 1 {
        averaged(picture.into_rgba8().as_raw(), width, u64::from(u8::MAX), downscale)
    } else {
        Pixels::Rgba8(picture.into_rgba8().as_chunks::<4>().0.to_vec())
    })
}

/// True if a color has more than 8 bits per channel.
fn is_deep(color: ColorType) -> bool {
    !matches!(color, ColorType::L8 | ColorType::La8 | ColorType::Rgb8 | ColorType::Rgba8)
}

/// The whole picture at `path`.
pub(super) fn decoded(path: &Path, is_turned: bool) -> Result<DynamicImage, Error> {
    let bytes = files::read(path)?;
    check_end(path, &bytes)?;
    let mut decoder = decoder(path, &bytes)?;
    let orientation = decoder.orientation().unwrap_or(Orientation::NoTransforms);
    let mut picture = DynamicImage::from_decoder(decoder).map_err(undecodable(path))?;
    if is_turned {
        picture.apply_orientation(orientation);
    }
    Ok(picture)
}

/// Refuses a truncated JPEG file, whose missing part the decoder fills with gray.
fn check_end(path: &Path, bytes: &[u8]) -> Result<(), Error> {
    if bytes.starts_with(&JPEG_START) && is_cut_short(bytes) {
        return Err(Error::Picture { path: path.to_path_buf(), found: "the JPEG file is truncated".into() });
    }
    Ok(())
}

/// The format by the first bytes of a file, regardless of its extension.
fn format(path: &Path, bytes: &[u8]) -> Result<ImageFormat, Error> {
    let undecodable = |found: String| Error::Picture { path: path.to_path_buf(), found };
    if bytes.starts_with(b"\x89PNG\r\n\x1a\n") {
        Ok(ImageFormat::Png)
    } else if bytes.starts_with(&JPEG_START) {
        Ok(ImageFormat::Jpeg)
    } else if bytes.starts_with(b"RIFF") && bytes.get(8..12) == Some(b"WEBP") {
        Ok(ImageFormat::WebP)
    } else if bytes.starts_with(b"II*\0") || bytes.starts_with(b"MM\0*") {
        Ok(ImageFormat::Tiff)
    } else {
        Err(undecodable(format!("the first bytes are {:02x?}", &bytes[..bytes.len().min(8)])))
    }
}

/// True if no end of image follows the last start of a scan of a JPEG file. Neither marker can be part of a scan's
/// data, in which a zero byte follows each 0xff.
fn is_cut_short(jpeg: &[u8]) -> bool {
    let last = |marker: [u8; 2]| jpeg.windows(2).rposition(|bytes| bytes == marker);
    let Some(end) = last([0xff, 0xd9]) else { return true };
    jpeg[end..].windows(2).any(|bytes| bytes == [0xff, 0xda])
}

/// A decoder of the picture in `bytes` that has read the header and stays within the limits.
fn decoder<'a>(path: &Path, bytes: &'a [u8]) -> Result<impl ImageDecoder + use<'a>, Error> {
    let mut limits = Limits::default();
    limits.max_image_width = Some(MAX_EDGE);
    limits.max_image_height = Some(MAX_EDGE);
    limits.max_alloc = Some(MAX_DECODED_BYTES);
    let mut reader = ImageReader::with_format(Cursor::new(bytes), format(path, bytes)?);
    reader.limits(limits);
    let decoder = reader.into_decoder().map_err(undecodable(path))?;
    let found = decoder.total_bytes();
    if found > MAX_DECODED_BYTES {
        let path = path.to_path_buf();
        return Err(Error::TooLarge { path, what: "decoded bytes", limit: MAX_DECODED_BYTES, found });
    }
    Ok(decoder)
}

/// Converts an error of decoding `path`, for `map_err`. The bytes are already read, so the file is at fault, not the
/// system.
fn undecodable(path: &Path) -> impl FnOnce(image::ImageError) -> Error + use<> {
    let path = path.to_path_buf();
    move |error| Error::Picture { path, found: error.to_string() }
}

/// Averages blocks of `rgba` (\[height\]\[width\]\[4\], straight alpha, 0 to `max`) as premultiplied colors. Sums are
/// exact: a block of 2²⁸ 16-bit pixels stays below 2⁶⁰.
fn averaged<T: Copy + Into<u64>>(rgba: &[T], width: usize, max: u64, factor: usize) -> Pixels {
    let rows = rgba.len() / (4 * width) / factor;
    let columns = width / factor;
    let mut pixels = Vec::with_capacity(rows * columns);
    for row in 0..rows {
        for column in 0..columns {
            let mut color = [0_u64; 3];
            let mut alpha = 0_u64;
            for y in row * factor..(row + 1) * factor {
                let start = 4 * (y * width + column * factor);
                for pixel in rgba[start..start + 4 * factor].as_chunks::<4>().0 {
                    let a = pixel[3].into();
                    alpha += a;
                    for (sum, &channel) in color.iter_mut().zip(pixel) {
                        *sum += channel.into() * a;
                    }
                }
            }
            let count = (factor * factor) as u64;
            let [r, g, b] = color.map(|sum| (sum as f64 / (count * max * max) as f64) as f32);
            pixels.push([r, g, b, (alpha as f64 / (count * max) as f64) as f32]);
        }
    }
    Pixels::Premultiplied(pixels)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn block_is_averaged_premultiplied_and_the_last_column_dropped() {
        // One opaque red and one transparent green pixel (its color must not count), then a column beyond the block.
        let rgba: [u8; 24] = [255, 0, 0, 255, 0, 255, 0, 0, 9, 9, 9, 9, 255, 0, 0, 255, 0, 255, 0, 0, 9, 9, 9, 9];
        let pixels = averaged(&rgba, 3, 255, 2);
        assert_eq!(pixels, Pixels::Premultiplied(vec![[0.5, 0.0, 0.0, 0.5]]));
        assert_eq!(pixels.colors([0.0, 0.0, 1.0]), [[0.5, 0.0, 0.5]]);
    }

    #[test]
    fn full_size_opaque_colors_are_the_file_s() {
        let rgba: [u16; 8] = [1, 2, 65_535, 65_535, 40_000, 0, 7, 65_535];
        let expected = [[1, 2, 65_535], [40_000, 0, 7]].map(|p| p.map(|v| (f64::from(v) / 65_535.0) as f32));
        assert_eq!(averaged(&rgba, 2, 65_535, 1).colors([1.0; 3]), expected);
    }
}
