//! Masks: pictures that are black where a photograph does not count.

use std::path::Path;

use super::decoding_memory::DecodingMemory;
use super::picture_format::PictureFormat;
use super::{Error, LoadOptions, picture};

/// The darkest value that is not black in a JPEG file, whose black has noise, of 255.
const LOSSY_BLACK: u16 = 128;

/// \[height\]\[width\] true where the mask at `path` is not black, made `downscale` times smaller: a block counts if all
/// of it does. The mask must have the `size` (columns and rows) of its photograph.
pub(super) fn load(
    path: &Path,
    is_turned: bool,
    size: [u32; 2],
    downscale: u32,
    memory: &DecodingMemory,
) -> Result<Vec<bool>, Error> {
    let (found, counting) = counting(path, is_turned, memory)?;
    if found != size {
        let like = path.to_path_buf();
        return Err(Error::PictureSize { path: path.to_path_buf(), expected: size, like, found });
    }
    let [width, columns, rows] = [size[0], size[0] / downscale, size[1] / downscale].map(|n| n as usize);
    let factor = downscale as usize;
    let counts = |row: usize, column: usize| {
        (row * factor..(row + 1) * factor).all(|y| counting[y * width + column * factor..][..factor].iter().all(|&v| v))
    };
    Ok((0..rows).flat_map(|row| (0..columns).map(move |column| (row, column))).map(|(r, c)| counts(r, c)).collect())
}

/// True if the mask at `path` is black alone.
pub(super) fn is_black(path: &Path) -> Result<bool, Error> {
    let memory = DecodingMemory::new(LoadOptions::MAX_MEMORY);
    Ok(!counting(path, false, &memory)?.1.contains(&true))
}

/// Columns and rows, and whether each pixel is not black: in all bits that the mask has.
fn counting(path: &Path, is_turned: bool, memory: &DecodingMemory) -> Result<([u32; 2], Vec<bool>), Error> {
    let (mask, _held) = picture::decoded(path, is_turned, memory)?;
    let size = [mask.width(), mask.height()];
    let (format, _) = picture::picture_size(path)?;
    let least = if format == PictureFormat::Jpeg { LOSSY_BLACK } else { 1 };
    let counting = if picture::is_deep(mask.color()) {
        mask.into_luma16().into_raw().into_iter().map(|value| value > 0).collect()
    } else {
        mask.into_luma8().into_raw().into_iter().map(|value| u16::from(value) >= least).collect()
    };
    Ok((size, counting))
}

#[cfg(test)]
mod tests {
    use image::{DynamicImage, ImageBuffer, Luma};

    use super::*;

    #[test]
    fn black_is_zero_in_all_bits_and_dark_in_jpeg() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        let memory = DecodingMemory::new(1 << 20);
        let load = |path: &Path, size, downscale| load(path, false, size, downscale, &memory);
        let deep = ImageBuffer::from_fn(4, 2, |x, _| Luma([u16::from(x > 1)]));
        DynamicImage::ImageLuma16(deep).save(path("deep.png")).unwrap();
        let half = [false, false, true, true, false, false, true, true];
        assert_eq!(load(&path("deep.png"), [4, 2], 1).unwrap(), half);
        assert_eq!(load(&path("deep.png"), [4, 2], 2).unwrap(), [false, true]);
        let noisy = ImageBuffer::from_fn(16, 8, |x, _| Luma([if x < 8 { 20_u8 } else { 235 }]));
        DynamicImage::ImageLuma8(noisy).save(path("noisy.jpg")).unwrap();
        let mask = load(&path("noisy.jpg"), [16, 8], 1).unwrap();
        assert!((0..128).all(|n| mask[n] == (n % 16 >= 8)), "{mask:?}");
        DynamicImage::ImageLuma8(ImageBuffer::new(4, 2)).save(path("black.png")).unwrap();
        assert!(is_black(&path("black.png")).unwrap() && !is_black(&path("deep.png")).unwrap());
        let message = load(&path("deep.png"), [2, 2], 1).unwrap_err().to_string();
        assert!(message.contains("must be 2x2") && message.contains("found 4x2"), "{message}");
    }
}
