//! The format of a picture by its first bytes, whatever its name ends with; formats that are not read are named.

/// The formats that are read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PictureFormat {
    /// Portable Network Graphics.
    Png,
    /// JPEG.
    Jpeg,
    /// WebP.
    WebP,
    /// TIFF, BigTIFF included.
    Tiff,
    /// Windows bitmap.
    Bmp,
}

/// The names of all formats that are read.
pub(super) const READ_FORMATS: &str = "PNG, JPEG, WebP, TIFF or BMP";

/// What to do with other formats.
const HEIF: &str = "convert it, for example by `heif-convert IN.heic OUT.jpg`";
const AVIF: &str = "convert it, for example by `avifdec IN.avif OUT.png`";
const JPEG_XL: &str = "convert it, for example by `djxl IN.jxl OUT.png`";
const JPEG_XR: &str = "convert it, for example by `JxrDecApp -i IN.jxr -o OUT.bmp`";
const RAW: &str = "convert it, for example by `darktable-cli IN OUT.jpg`";
const MAGICK: &str = "convert it, for example by `magick IN OUT.png`";
const VIDEO: &str = "take pictures of it, for example by `ffmpeg -i IN OUT_%04d.png`";
const GIT_LFS: &str = "fetch it by `git lfs pull`";
const DOWNLOAD: &str = "download the picture again";

/// Starts of files that are not read: offset, bytes, name with article, remedy.
const OTHERS: [(usize, &[u8], &str, &str); 26] = [
    (0, b"GIF8", "a GIF picture", MAGICK),
    (0, b"\0\0\0\x0cJXL \r\n\x87\n", "a JPEG XL picture", JPEG_XL),
    (0, b"\xff\x0a", "a JPEG XL picture", JPEG_XL),
    (0, b"\0\0\0\x0cjP  \r\n\x87\n", "a JPEG 2000 picture", MAGICK),
    (0, b"\xff\x4f\xff\x51", "a JPEG 2000 picture", MAGICK),
    (0, b"II\xbc\x01", "a JPEG XR picture", JPEG_XR),
    (0, b"FUJIFILMCCD-RAW", "a raw picture of a camera (RAF)", RAW),
    (0, b"IIU\0", "a raw picture of a camera (RW2)", RAW),
    (0, b"IIRO", "a raw picture of a camera (ORF)", RAW),
    (0, b"IIRS", "a raw picture of a camera (ORF)", RAW),
    (0, b"MMOR", "a raw picture of a camera (ORF)", RAW),
    (0, b"FOVb", "a raw picture of a camera (X3F)", RAW),
    (0, b"\0MRM", "a raw picture of a camera (MRW)", RAW),
    (0, b"HEAPCCDR", "a raw picture of a camera (CRW)", RAW),
    (8, b"CR\x02", "a raw picture of a camera (CR2)", RAW),
    (0, b"\x76\x2f\x31\x01", "an OpenEXR picture", MAGICK),
    (0, b"#?R", "a Radiance HDR picture", MAGICK),
    (0, b"8BPS", "a Photoshop document", MAGICK),
    (0, b"qoif", "a QOI picture", MAGICK),
    (0, b"DDS ", "a DirectDraw surface", MAGICK),
    (0, b"\x1aE\xdf\xa3", "a video (Matroska or WebM)", VIDEO),
    (8, b"AVI LIST", "a video (AVI)", VIDEO),
    (0, b"version https://git-lfs", "a pointer of Git LFS to a picture", GIT_LFS),
    (0, b"<!DOCTYPE", "a web page", DOWNLOAD),
    (0, b"<!doctype", "a web page", DOWNLOAD),
    (0, b"<html", "a web page", DOWNLOAD),
];

/// Brands of ISO media files (`ftyp`): start of the brand, name with article, remedy.
const BRANDS: [(&[u8], &str, &str); 9] = [
    (b"avi", "an AVIF picture", AVIF),
    (b"hei", "a HEIC picture", HEIF),
    (b"hev", "a HEIC picture", HEIF),
    (b"mif1", "a HEIF picture", HEIF),
    (b"msf1", "a HEIF picture", HEIF),
    (b"mif2", "a HEIF picture", HEIF),
    (b"crx", "a raw picture of a camera (CR3)", RAW),
    (b"jxl", "a JPEG XL picture", JPEG_XL),
    (b"", "a video (MP4 or QuickTime)", VIDEO),
];

/// Tags in the first directory of a TIFF file.
const TAG_SUBFILE: u16 = 254;
const TAG_PHOTOMETRIC: u16 = 262;
const TAG_SUB_DIRECTORIES: u16 = 330;
const TAG_DNG_VERSION: u16 = 50_706;
/// Photometric interpretation of a sensor's color filter array.
const FILTER_ARRAY: u32 = 32_803;

impl PictureFormat {
    /// The format of the file that begins with `bytes`; else what the file is instead, and what to do.
    pub(super) fn of(bytes: &[u8]) -> Result<Self, String> {
        let at = |offset: usize, start: &[u8]| bytes.get(offset..).is_some_and(|rest| rest.starts_with(start));
        let other = OTHERS.iter().find(|(offset, start, ..)| at(*offset, start));
        if let Some(&(_, _, name, remedy)) = other {
            return Err(described(name, remedy));
        }
        if at(0, b"\x89PNG\r\n\x1a\n") {
            Ok(Self::Png)
        } else if at(0, &super::jpeg::START) {
            Ok(Self::Jpeg)
        } else if at(0, b"RIFF") && at(8, b"WEBP") {
            Ok(Self::WebP)
        } else if at(0, b"BM") && bytes.get(14..18).is_some_and(|size| matches!(size, [12..=124, 0, 0, 0])) {
            Ok(Self::Bmp)
        } else if at(0, b"II*\0") || at(0, b"MM\0*") {
            raw_camera_file(bytes).map_or(Ok(Self::Tiff), |name| Err(described(name, RAW)))
        } else if at(0, b"II+\0") || at(0, b"MM\0+") {
            Ok(Self::Tiff)
        } else if at(4, b"ftyp") {
            Err(iso_media(bytes))
        } else if bytes.is_empty() {
            Err("an empty file".into())
        } else {
            Err(format!("not a picture; the first bytes are {:02x?}", &bytes[..bytes.len().min(8)]))
        }
    }
}

fn described(name: &str, remedy: &str) -> String {
    format!("{name}; {remedy}")
}

/// What the ISO media file `bytes` is: by its brand, then by those it is compatible with if the brand is a general one.
fn iso_media(bytes: &[u8]) -> String {
    let length = bytes.first_chunk::<4>().map_or(0, |length| u32::from_be_bytes(*length) as usize);
    let listed = bytes.get(8..length.min(bytes.len()).min(256)).unwrap_or_default();
    let brands: Vec<&[u8]> = listed.chunks_exact(4).enumerate().filter(|(n, _)| *n != 1).map(|(_, b)| b).collect();
    let of = |brand: &[u8]| BRANDS.iter().position(|(start, ..)| brand.starts_with(start)).unwrap_or(BRANDS.len() - 1);
    let first = brands.first().map_or(BRANDS.len() - 1, |brand| of(brand));
    // `mif1` and `msf1` leave the coding to the compatible brands.
    let is_general = BRANDS[first].0.starts_with(b"m") || BRANDS[first].0.is_empty();
    let coded = brands.iter().map(|brand| of(brand)).min().filter(|_| is_general);
    let (_, name, remedy) = BRANDS[coded.unwrap_or(first)];
    described(name, remedy)
}

/// The name of the raw camera file that begins with `bytes`, if the TIFF file is one: DNG by its version, others by a sensor's
/// colors, or by a small picture before the directories of the true one.
fn raw_camera_file(bytes: &[u8]) -> Option<&'static str> {
    let is_little = bytes.starts_with(b"II");
    let short = |at: usize| {
        let bytes = *bytes.get(at..)?.first_chunk::<2>()?;
        Some(if is_little { u16::from_le_bytes(bytes) } else { u16::from_be_bytes(bytes) })
    };
    let long = |at: usize| {
        let bytes = *bytes.get(at..)?.first_chunk::<4>()?;
        Some(if is_little { u32::from_le_bytes(bytes) } else { u32::from_be_bytes(bytes) })
    };
    let directory = long(4)? as usize;
    let count = usize::from(short(directory)?);
    let entry = |n: usize| directory.checked_add(2 + 12 * n);
    let find = |tag: u16| (0..count).filter_map(entry).find(|&at| short(at) == Some(tag));
    let number = |tag: u16| {
        let at = find(tag)?;
        if short(at + 2)? == 3 { short(at + 8).map(u32::from) } else { long(at + 8) }
    };
    let is_preview = number(TAG_SUBFILE).is_some_and(|kind| kind & 1 == 1);
    if find(TAG_DNG_VERSION).is_some() {
        Some("a raw picture of a camera (DNG)")
    } else if number(TAG_PHOTOMETRIC) == Some(FILTER_ARRAY) || (is_preview && find(TAG_SUB_DIRECTORIES).is_some()) {
        Some("a raw picture of a camera (such as NEF or ARW)")
    } else {
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A little-endian TIFF file of one directory with `entries`: tags with long values.
    fn tiff(entries: &[(u16, u32)]) -> Vec<u8> {
        let mut bytes = b"II*\0\x08\0\0\0".to_vec();
        bytes.extend((entries.len() as u16).to_le_bytes());
        for &(tag, value) in entries {
            bytes.extend([tag.to_le_bytes(), 4_u16.to_le_bytes()].as_flattened());
            bytes.extend([1_u32.to_le_bytes(), value.to_le_bytes()].as_flattened());
        }
        bytes
    }

    #[test]
    fn formats_are_known_by_their_bytes() {
        let bitmap = [&b"BM"[..], &[0; 12], &[40, 0, 0, 0]].concat();
        for (bytes, format) in [
            (b"\x89PNG\r\n\x1a\n\0\0".to_vec(), PictureFormat::Png),
            (b"\xff\xd8\xff\xe0".to_vec(), PictureFormat::Jpeg),
            (b"RIFF\0\0\0\0WEBPVP8 ".to_vec(), PictureFormat::WebP),
            (tiff(&[(TAG_SUBFILE, 0), (TAG_PHOTOMETRIC, 2)]), PictureFormat::Tiff),
            (tiff(&[(TAG_SUB_DIRECTORIES, 99)]), PictureFormat::Tiff),
            (b"MM\0*".to_vec(), PictureFormat::Tiff),
            (bitmap, PictureFormat::Bmp),
        ] {
            assert_eq!(PictureFormat::of(&bytes), Ok(format), "{bytes:x?}");
        }
    }

    #[test]
    fn other_formats_are_named_with_a_command() {
        for (bytes, parts) in [
            (b"\0\0\0\x18ftypheic\0\0\0\0mif1heic".to_vec(), ["a HEIC picture", "heif-convert"]),
            (b"\0\0\0\x1cftypmif1\0\0\0\0mif1heicmiaf".to_vec(), ["a HEIC picture", "heif-convert"]),
            (b"\0\0\0\x1cftypmif1\0\0\0\0mif1avifmiaf".to_vec(), ["an AVIF picture", "avifdec"]),
            (b"\0\0\0\x1cftypavif\0\0\0\0avifmif1miaf".to_vec(), ["an AVIF picture", "avifdec"]),
            (b"\0\0\0\x14ftypmif1\0\0\0\0mif1".to_vec(), ["a HEIF picture", "heif-convert"]),
            (b"\0\0\0\x18ftypcrx \0\0\0\x01crx isom".to_vec(), ["(CR3)", "darktable-cli"]),
            (b"\0\0\0\x18ftypisom\0\0\0\x01mp42isom".to_vec(), ["a video", "ffmpeg"]),
            (b"ftyp".repeat(2), ["a video", "ffmpeg"]),
            (b"\xff\x0a\0\0".to_vec(), ["a JPEG XL picture", "djxl"]),
            (b"\0\0\0\x0cJXL \r\n\x87\n".to_vec(), ["a JPEG XL picture", "djxl"]),
            (b"\0\0\0\x0cjP  \r\n\x87\n".to_vec(), ["a JPEG 2000 picture", "magick"]),
            (b"II*\0\x10\0\0\0CR\x02\0".to_vec(), ["(CR2)", "darktable-cli"]),
            (tiff(&[(TAG_DNG_VERSION, 0x0401)]), ["(DNG)", "darktable-cli"]),
            (tiff(&[(TAG_SUBFILE, 1), (TAG_SUB_DIRECTORIES, 99)]), ["NEF", "darktable-cli"]),
            (tiff(&[(TAG_PHOTOMETRIC, FILTER_ARRAY)]), ["NEF", "darktable-cli"]),
            (b"GIF89a".to_vec(), ["a GIF picture", "magick"]),
            (b"<!DOCTYPE html>".to_vec(), ["a web page", "download"]),
            (b"version https://git-lfs.github.com/spec/v1".to_vec(), ["Git LFS", "git lfs pull"]),
            (b"".to_vec(), ["an empty file", ""]),
            (b"no picture".to_vec(), ["the first bytes are [6e", ""]),
        ] {
            let message = PictureFormat::of(&bytes).unwrap_err();
            assert!(parts.iter().all(|part| message.contains(part)), "{message}");
        }
    }
}
