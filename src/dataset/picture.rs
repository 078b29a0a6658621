//! PNG and JPEG pictures to pixels: decoding within limits, averaging blocks.

use std::fs::File;
use std::io::{Cursor, Read};
use std::path::Path;

use image::{ColorType, DynamicImage, ImageDecoder, ImageFormat, ImageReader, Limits};

use super::{Error, Pixels};

/// The longest edge of a picture that is decoded.
pub(super) const MAX_EDGE: u32 = 16_384;
/// The most bytes that a picture may take in memory.
const MAX_DECODED_BYTES: u64 = 512 << 20;
/// The first bytes of a JPEG file: start of image, and the next marker's first byte.
const JPEG_START: [u8; 3] = [0xff, 0xd8, 0xff];
/// The most bytes that a file of a dataset may have.
const MAX_FILE_BYTES: u64 = 512 << 20;

/// The bytes of a regular file of at most [`MAX_FILE_BYTES`].
pub(super) fn read_file(path: &Path) -> Result<Vec<u8>, Error> {
    read_at_most(path, MAX_FILE_BYTES)
}

/// The bytes of a regular file of at most `limit`.
pub(super) fn read_at_most(path: &Path, limit: u64) -> Result<Vec<u8>, Error> {
    let file = File::open(path).map_err(Error::read(path))?;
    let mut bytes = Vec::new();
    // A device or a pipe has no length to check beforehand, so the read itself is bounded.
    file.take(limit + 1).read_to_end(&mut bytes).map_err(Error::read(path))?;
    let found = bytes.len() as u64;
    if found > limit {
        return Err(Error::TooLarge { path: path.to_path_buf(), what: "bytes", limit, found });
    }
    Ok(bytes)
}

/// Columns and rows of the picture at `path`, from its header.
pub(super) fn size(path: &Path) -> Result<[u32; 2], Error> {
    let bytes = read_file(path)?;
    let (width, height) = decoder(path, &bytes)?.dimensions();
    Ok([width, height])
}

/// The colors of the picture at `path`, of `size` (columns and rows) divided by `downscale`, rounded down. `size` comes
/// from the file `like`; a picture of another size is an error.
pub(super) fn load(path: &Path, size: [u32; 2], like: &Path, downscale: u32) -> Result<Pixels, Error> {
    let bytes = read_file(path)?;
    let decoder = decoder(path, &bytes)?;
    let found: [u32; 2] = decoder.dimensions().into();
    if found != size {
        return Err(Error::PictureSize { path: path.to_path_buf(), expected: size, like: like.to_path_buf(), found });
    }
    let deep = matches!(decoder.color_type(), ColorType::L16 | ColorType::La16 | ColorType::Rgb16 | ColorType::Rgba16);
    let picture = DynamicImage::from_decoder(decoder).map_err(undecodable(path))?;
    let (width, downscale) = (size[0] as usize, downscale as usize);
    Ok(if deep {
        averaged(picture.into_rgba16().as_raw(), width, u64::from(u16::MAX), downscale)
    } else if downscale > 1 {
        averaged(picture.into_rgba8().as_raw(), width, u64::from(u8::MAX), downscale)
    } else {
        Pixels::Rgba8(picture.into_rgba8().as_chunks::<4>().0.to_vec())
    })
}

/// The format by the first bytes of a file, regardless of its extension.
fn format(path: &Path, bytes: &[u8]) -> Result<ImageFormat, Error> {
    let undecodable = |found: String| Error::Picture { path: path.to_path_buf(), found };
    if bytes.starts_with(b"\x89PNG\r\n\x1a\n") {
        Ok(ImageFormat::Png)
    } else if bytes.starts_with(&JPEG_START) {
        // The decoder fills the missing part of a truncated file with gray.
        if is_cut_short(bytes) { Err(undecodable("the JPEG file is truncated".into())) } else { Ok(ImageFormat::Jpeg) }
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
