//! Pictures (PNG, JPEG, WebP, TIFF, BMP) to pixels: decoding within limits, averaging blocks.

use std::fs::File;
use std::io::{Cursor, Read};
use std::path::Path;

use image::codecs::{bmp::BmpDecoder, png::PngDecoder, tiff::TiffDecoder, webp::WebPDecoder};
use image::metadata::Orientation;
use image::{ColorType, DynamicImage, ImageDecoder, ImageResult, Limits};

use super::decoding_memory::{DecodingMemory, HeldMemory};
use super::jpeg::{self, JpegError, JpegHeader};
use super::picture_format::PictureFormat;
use super::{Error, Pixels, files};

/// The longest edge of a picture that is decoded.
pub(super) const MAX_EDGE: u32 = 16_384;
/// The most bytes that a picture may take in memory.
const MAX_DECODED_BYTES: u64 = 512 << 20;

/// The bytes with which a file begins; enough for the header of nearly every picture.
const HEAD_BYTES: u64 = 256 << 10;

/// A picture's size and orientation, from its header.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct PictureHeader {
    format: PictureFormat,
    /// Columns and rows as stored.
    pub(super) size: [u32; 2],
    /// How to turn the stored picture so that up is up.
    pub(super) orientation: Orientation,
    /// True if the picture has more than 8 bits per channel.
    pub(super) is_deep: bool,
    /// Bytes that decoding takes at its peak, the file included, the resulting pixels not.
    pub(super) decoding_bytes: u64,
}

impl PictureHeader {
    /// The header of a picture of `size` that is upright.
    pub(super) fn upright(size: [u32; 2]) -> Self {
        Self {
            format: PictureFormat::Png,
            size,
            orientation: Orientation::NoTransforms,
            is_deep: false,
            decoding_bytes: 0,
        }
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
    let file_bytes = file.metadata().map_err(Error::read(path))?.len();
    file.take(HEAD_BYTES).read_to_end(&mut head).map_err(Error::read(path))?;
    match EncodedPicture::open(path, &head, file_bytes) {
        Err(_) if head.len() as u64 == HEAD_BYTES => {
            let bytes = files::read(path)?;
            EncodedPicture::open(path, &bytes, file_bytes).map(|picture| picture.header)
        }
        opened => opened.map(|picture| picture.header),
    }
}

/// The format of the picture at `path`, and its columns and rows as stored.
pub fn picture_size(path: &Path) -> Result<(PictureFormat, [u32; 2]), Error> {
    let header = header(path)?;
    Ok((header.format, header.size))
}

/// The colors of the picture at `path`, turned by its orientation if `is_turned`, then made `downscale` times smaller;
/// columns and rows that do not fill a block are dropped.
pub(super) fn load(path: &Path, is_turned: bool, downscale: u32, memory: &DecodingMemory) -> Result<Pixels, Error> {
    let (picture, _held) = decoded(path, is_turned, memory)?;
    Ok(if downscale > 1 || is_deep(picture.color()) {
        Pixels::Premultiplied(averaged(&picture, downscale))
    } else {
        Pixels::Rgba8(rgba8(picture))
    })
}

/// \[height\]\[width\] the colors of a picture of 8 bits.
fn rgba8(picture: DynamicImage) -> Vec<[u8; 4]> {
    match picture {
        DynamicImage::ImageLuma8(gray) => gray.as_raw().iter().map(|&gray| [gray, gray, gray, u8::MAX]).collect(),
        DynamicImage::ImageLumaA8(gray) => {
            gray.as_raw().as_chunks::<2>().0.iter().map(|&[gray, alpha]| [gray, gray, gray, alpha]).collect()
        }
        DynamicImage::ImageRgb8(rgb) => {
            rgb.as_raw().as_chunks::<3>().0.iter().map(|&[r, g, b]| [r, g, b, u8::MAX]).collect()
        }
        other => other.into_rgba8().as_raw().as_chunks::<4>().0.to_vec(),
    }
}

/// True if a color has more than 8 bits per channel.
pub(super) fn is_deep(color: ColorType) -> bool {
    !matches!(color, ColorType::L8 | ColorType::La8 | ColorType::Rgb8 | ColorType::Rgba8)
}

/// The whole picture at `path`, and the memory that is held for it.
pub(super) fn decoded<'a>(
    path: &Path,
    is_turned: bool,
    memory: &'a DecodingMemory,
) -> Result<(DynamicImage, HeldMemory<'a>), Error> {
    let bytes = files::read(path)?;
    let EncodedPicture { header, decoder } = EncodedPicture::open(path, &bytes, bytes.len() as u64)?;
    let held = memory.take(path, header.decoding_bytes)?;
    let mut picture = match decoder {
        Some(decoder) => DynamicImage::from_decoder(decoder).map_err(undecodable(path))?,
        None => jpeg::decode(&bytes).map_err(undecodable_jpeg(path))?,
    };
    if is_turned {
        picture.apply_orientation(header.orientation);
    }
    Ok((picture, held))
}

/// A picture whose header was read, and is within the limits.
struct EncodedPicture<'a> {
    header: PictureHeader,
    /// The decoder; `None` for a JPEG picture.
    decoder: Option<Box<dyn ImageDecoder + 'a>>,
}

impl<'a> EncodedPicture<'a> {
    /// The picture at `path`, a file of `file_bytes` that begins with `bytes`.
    fn open(path: &Path, bytes: &'a [u8], file_bytes: u64) -> Result<Self, Error> {
        let format = PictureFormat::of(bytes);
        let format = format.map_err(|found| Error::PictureFormat { path: path.to_path_buf(), found })?;
        if format == PictureFormat::Jpeg {
            let jpeg = JpegHeader::read(bytes).map_err(undecodable_jpeg(path))?;
            let orientation = jpeg.exif.and_then(Orientation::from_exif_chunk).unwrap_or(Orientation::NoTransforms);
            let header = PictureHeader { format, size: jpeg.size(), orientation, is_deep: false, decoding_bytes: 0 };
            let header = header.within_limits(path, jpeg.decoded_bytes(), jpeg.working_bytes(), file_bytes)?;
            return Ok(Self { header, decoder: None });
        }
        let mut decoder = decoder(format, bytes).map_err(undecodable(path))?;
        let (size, decoded) = (decoder.dimensions(), decoder.total_bytes());
        let pixels = u64::from(size.0) * u64::from(size.1);
        let working = match format {
            // The colors before they are in the order of the picture.
            PictureFormat::WebP => 4 * pixels,
            // A strip may be the whole picture.
            PictureFormat::Tiff => decoded,
            _ => 0,
        };
        let orientation = decoder.orientation().unwrap_or(Orientation::NoTransforms);
        let is_deep = is_deep(decoder.color_type());
        let header = PictureHeader { format, size: size.into(), orientation, is_deep, decoding_bytes: 0 };
        let header = header.within_limits(path, decoded, working, file_bytes)?;
        Ok(Self { header, decoder: Some(decoder) })
    }
}

impl PictureHeader {
    /// The header of the picture at `path`, a file of `file_bytes`, which takes `decoded` bytes, and `working` bytes besides
    /// while it is decoded.
    fn within_limits(mut self, path: &Path, decoded: u64, working: u64, file_bytes: u64) -> Result<Self, Error> {
        let too_large = |what, limit, found| Err(Error::TooLarge { path: path.to_path_buf(), what, limit, found });
        let edge = self.size[0].max(self.size[1]);
        if edge > MAX_EDGE {
            return too_large("pixels along an edge", MAX_EDGE.into(), edge.into());
        }
        if decoded > MAX_DECODED_BYTES {
            return too_large("decoded bytes", MAX_DECODED_BYTES, decoded);
        }
        // A picture is turned by a copy, after it is decoded; a mask becomes gray.
        let copy = if self.orientation == Orientation::NoTransforms { 0 } else { decoded };
        let gray = u64::from(self.size[0]) * u64::from(self.size[1]);
        self.decoding_bytes = file_bytes + decoded + working.max(copy).max(gray);
        Ok(self)
    }
}

/// A decoder of the picture in `bytes` that has read the header. All decoders have one type of reader, for which alone they
/// are compiled.
fn decoder<'a>(format: PictureFormat, bytes: &'a [u8]) -> ImageResult<Box<dyn ImageDecoder + 'a>> {
    let mut limits = Limits::default();
    limits.max_image_width = Some(MAX_EDGE);
    limits.max_image_height = Some(MAX_EDGE);
    limits.max_alloc = Some(MAX_DECODED_BYTES);
    let reader = Cursor::new(bytes);
    let mut decoder: Box<dyn ImageDecoder + 'a> = match format {
        PictureFormat::Png => Box::new(PngDecoder::with_limits(reader, limits.clone())?),
        PictureFormat::WebP => Box::new(WebPDecoder::new(reader)?),
        PictureFormat::Bmp => Box::new(BmpDecoder::new(reader)?),
        PictureFormat::Tiff | PictureFormat::Jpeg => Box::new(TiffDecoder::new(reader)?),
    };
    decoder.set_limits(limits)?;
    Ok(decoder)
}

/// Converts an error of the JPEG picture at `path`, for `map_err`.
fn undecodable_jpeg(path: &Path) -> impl FnOnce(JpegError) -> Error + use<> {
    let path = path.to_path_buf();
    move |error| Error::Picture { path, found: error.to_string() }
}

/// Converts an error of decoding `path`, for `map_err`. The bytes are already read, so the file is at fault, not the
/// system.
fn undecodable(path: &Path) -> impl FnOnce(image::ImageError) -> Error + use<> {
    let path = path.to_path_buf();
    move |error| Error::Picture { path, found: error.to_string() }
}

/// Averages blocks of `factor` x `factor` pixels as premultiplied colors. No copy of the whole picture is made.
fn averaged(picture: &DynamicImage, factor: u32) -> Vec<[f32; 4]> {
    let [columns, rows] = [picture.width() / factor, picture.height() / factor];
    let mut pixels = Vec::with_capacity(columns as usize * rows as usize);
    let width = columns * factor;
    for row in 0..rows {
        let band = picture.crop_imm(0, row * factor, width, factor);
        if is_deep(picture.color()) {
            average_band(band.into_rgba16().as_raw(), u64::from(u16::MAX), factor as usize, &mut pixels);
        } else {
            average_band(band.into_rgba8().as_raw(), u64::from(u8::MAX), factor as usize, &mut pixels);
        }
    }
    pixels
}

/// Averages the blocks of `rgba` (\[`factor`\]\[width\]\[4\], straight alpha, 0 to `max`) as premultiplied colors and adds
/// them to `pixels`. Sums are exact: a block of 2²⁸ 16-bit pixels stays below 2⁶⁰.
fn average_band<T: Copy + Into<u64>>(rgba: &[T], max: u64, factor: usize, pixels: &mut Vec<[f32; 4]>) {
    let width = rgba.len() / (4 * factor);
    for column in 0..width / factor {
        let mut color = [0_u64; 3];
        let mut alpha = 0_u64;
        for row in rgba.chunks_exact(4 * width) {
            for pixel in row[4 * column * factor..][..4 * factor].as_chunks::<4>().0 {
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn block_is_averaged_premultiplied_and_the_last_column_dropped() {
        // One opaque red and one transparent green pixel (its color must not count), then a column beyond the block.
        let rgba: [u8; 24] = [255, 0, 0, 255, 0, 255, 0, 0, 9, 9, 9, 9, 255, 0, 0, 255, 0, 255, 0, 0, 9, 9, 9, 9];
        let picture = DynamicImage::ImageRgba8(image::RgbaImage::from_raw(3, 2, rgba.to_vec()).unwrap());
        let pixels = Pixels::Premultiplied(averaged(&picture, 2));
        assert_eq!(pixels, Pixels::Premultiplied(vec![[0.5, 0.0, 0.0, 0.5]]));
        assert_eq!(pixels.colors([0.0, 0.0, 1.0]), [[0.5, 0.0, 0.5]]);
    }

    #[test]
    fn full_size_opaque_colors_are_the_file_s() {
        let rgba: [u16; 8] = [1, 2, 65_535, 65_535, 40_000, 0, 7, 65_535];
        let picture = DynamicImage::ImageRgba16(image::ImageBuffer::from_raw(2, 1, rgba.to_vec()).unwrap());
        let expected = [[1, 2, 65_535], [40_000, 0, 7]].map(|p| p.map(|v| (f64::from(v) / 65_535.0) as f32));
        assert_eq!(Pixels::Premultiplied(averaged(&picture, 1)).colors([1.0; 3]), expected);
    }

    #[test]
    fn gray_and_transparent_8_bit_pictures_keep_their_numbers() {
        let gray = DynamicImage::ImageLumaA8(image::ImageBuffer::from_raw(2, 1, vec![7, 255, 9, 0]).unwrap());
        assert_eq!(rgba8(gray), [[7, 7, 7, 255], [9, 9, 9, 0]]);
        let gray = DynamicImage::ImageLuma8(image::ImageBuffer::from_raw(2, 1, vec![7, 9]).unwrap());
        assert_eq!(rgba8(gray), [[7, 7, 7, 255], [9, 9, 9, 255]]);
        let color = DynamicImage::ImageRgb8(image::ImageBuffer::from_raw(1, 1, vec![7, 8, 9]).unwrap());
        assert_eq!(rgba8(color), [[7, 8, 9, 255]]);
    }
}
