//! JPEG pictures (ITU-T T.81), as libjpeg decodes them.
//!
//! In: the bytes of a file, which may be truncated, damaged or hostile. Out: gray or RGB samples that are equal to those of
//! libjpeg-turbo with its default settings: the slow integer transform and triangle ("fancy") upsampling. Baseline,
//! extended and progressive pictures of 8 bits are decoded, in any order of scans. A picture ends with its last coefficient:
//! bytes behind it mean nothing, and an end mark is not needed. A picture that lacks a coefficient is an error.

mod bits;
mod color;
mod frame;
mod idct;
mod scan;
mod tables;
mod upsample;

#[cfg(test)]
mod tests;

use image::{DynamicImage, GrayImage, RgbImage};

use frame::Frame;
use scan::Decoding;
use tables::Tables;

/// The bytes with which a JPEG file begins: start of image, and the next marker's first byte.
pub(super) const START: [u8; 3] = [0xff, 0xd8, 0xff];

/// Reasons why a picture is not decoded.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub(super) enum JpegError {
    /// The file ends before the picture does.
    #[error("the JPEG file is truncated")]
    Truncated,
    /// Bytes contradict the standard.
    #[error("the JPEG file is damaged: {0}")]
    Damaged(&'static str),
    /// A part of the standard that cameras do not use.
    #[error("a JPEG file with {what} is not supported; convert it, for example by `{remedy}`")]
    Unsupported {
        /// The part.
        what: &'static str,
        /// A command that writes a supported picture.
        remedy: &'static str,
    },
}

/// What stands before a picture's data.
#[derive(Debug)]
pub(super) struct JpegHeader<'a> {
    frame: Frame,
    /// The EXIF metadata, a TIFF structure.
    pub(super) exif: Option<&'a [u8]>,
}

/// What application segments say of the colors.
#[derive(Clone, Copy, Debug, Default)]
struct Segments {
    is_jfif: bool,
    /// The transform that Adobe's segment names.
    adobe_transform: Option<u8>,
}

impl<'a> JpegHeader<'a> {
    /// The header of the picture in `bytes`, which may end behind it.
    pub(super) fn read(bytes: &'a [u8]) -> Result<Self, JpegError> {
        let mut file = File::new(bytes);
        loop {
            if let Marker::Frame(frame) = file.next_marker()? {
                return Ok(Self { frame, exif: file.exif });
            }
        }
    }

    /// Columns and rows as stored.
    pub(super) fn size(&self) -> [u32; 2] {
        self.frame.size
    }

    /// Bytes of the decoded picture.
    pub(super) fn decoded_bytes(&self) -> u64 {
        let channels = if self.frame.components.len() == 1 { 1 } else { 3 };
        channels * self.frame.size.map(u64::from).iter().product::<u64>()
    }

    /// Bytes that decoding takes besides the decoded picture: samples, and coefficients of a progressive picture.
    pub(super) fn working_bytes(&self) -> u64 {
        let samples = self.frame.components.iter().map(|component| component.padded_samples()).sum::<u64>();
        if self.frame.is_progressive { 3 * samples } else { samples }
    }
}

/// The picture in `bytes`.
///
/// # Errors
///
/// If the picture is incomplete, malformed or of an unsupported kind.
pub(super) fn decode(bytes: &[u8]) -> Result<DynamicImage, JpegError> {
    let mut file = File::new(bytes);
    let mut decoding = None;
    loop {
        match file.next_marker() {
            Ok(Marker::Frame(_)) if decoding.is_some() => return Err(JpegError::Damaged("it has two frames")),
            Ok(Marker::Frame(frame)) => decoding = Some(Decoding::new(frame)),
            Ok(Marker::Scan(header)) => {
                let decoding = decoding.as_mut().ok_or(JpegError::Damaged("a scan comes before the frame"))?;
                file.at += decoding.scan(header, &file.tables, &bytes[file.at..])?;
                if decoding.is_complete() {
                    break;
                }
            }
            Ok(Marker::End) => {
                // A progressive picture may leave details out.
                if !decoding.as_ref().is_some_and(Decoding::has_all_means) {
                    return Err(JpegError::Truncated);
                }
                break;
            }
            Err(error) => return Err(error),
        }
    }
    let decoding = decoding.ok_or(JpegError::Truncated)?;
    let transform = color::Transform::of(decoding.frame(), file.segments);
    let [width, height] = decoding.frame().size;
    let (frame, planes) = decoding.into_planes();
    let samples = color::interleaved(&frame, &planes, transform);
    let picture = if frame.components.len() == 1 {
        GrayImage::from_raw(width, height, samples).map(DynamicImage::ImageLuma8)
    } else {
        RgbImage::from_raw(width, height, samples).map(DynamicImage::ImageRgb8)
    };
    picture.ok_or(JpegError::Damaged("its size is wrong"))
}

/// A marker at which a reader acts.
enum Marker<'a> {
    Frame(Frame),
    /// The segment of a scan, behind which its data begin.
    Scan(&'a [u8]),
    /// The end mark.
    End,
}

/// A file up to the place that was read.
struct File<'a> {
    bytes: &'a [u8],
    /// The next byte.
    at: usize,
    tables: Tables,
    segments: Segments,
    exif: Option<&'a [u8]>,
}

impl<'a> File<'a> {
    fn new(bytes: &'a [u8]) -> Self {
        Self { bytes, at: 0, tables: Tables::default(), segments: Segments::default(), exif: None }
    }

    /// The next marker at which a reader acts. Tables and metadata before it are read.
    fn next_marker(&mut self) -> Result<Marker<'a>, JpegError> {
        loop {
            let marker = self.marker()?;
            match marker {
                0xd9 => return Ok(Marker::End),
                // Start of image, restarts that a scan left, and a marker without meaning have no segment.
                0xd8 | 0xd0..=0xd7 | 0x01 => {}
                0xc4 => self.segment()?.huffman()?,
                0xdb => self.segment()?.quantization()?,
                0xdd => self.segment()?.restart_interval()?,
                0xc0..=0xcf => {
                    let segment = self.segment_bytes()?;
                    return Ok(Marker::Frame(Frame::parse(marker, segment)?));
                }
                0xda => return Ok(Marker::Scan(self.segment_bytes()?)),
                0xdc => return Err(frame::UNKNOWN_HEIGHT),
                0xf7 => return Err(frame::JPEG_LS),
                0xde | 0xdf => return Err(frame::HIERARCHICAL),
                0xe0 | 0xe1 | 0xee => self.metadata(marker)?,
                _ => {
                    self.segment_bytes()?;
                }
            }
        }
    }

    /// The next marker's second byte; bytes before the marker are skipped.
    fn marker(&mut self) -> Result<u8, JpegError> {
        let rest = &self.bytes[self.at..];
        let found = rest.windows(2).position(|pair| pair[0] == 0xff && !matches!(pair[1], 0x00 | 0xff));
        let found = found.ok_or(JpegError::Truncated)?;
        self.at += found + 2;
        Ok(rest[found + 1])
    }

    /// The bytes of the segment that begins here, without its length.
    fn segment_bytes(&mut self) -> Result<&'a [u8], JpegError> {
        let rest = &self.bytes[self.at..];
        let (length, _) = rest.split_first_chunk::<2>().ok_or(JpegError::Truncated)?;
        let length = usize::from(u16::from_be_bytes(*length));
        if length < 2 {
            return Err(JpegError::Damaged("a segment has a length below 2"));
        }
        let segment = rest.get(2..length).ok_or(JpegError::Truncated)?;
        self.at += length;
        Ok(segment)
    }

    /// The segment that begins here, and the tables that it changes.
    fn segment(&mut self) -> Result<tables::Segment<'a, '_>, JpegError> {
        let bytes = self.segment_bytes()?;
        Ok(tables::Segment::new(bytes, &mut self.tables))
    }

    /// Reads an application's segment.
    fn metadata(&mut self, marker: u8) -> Result<(), JpegError> {
        let segment = self.segment_bytes()?;
        match marker {
            0xe0 if segment.starts_with(b"JFIF\0") => self.segments.is_jfif = true,
            0xe1 if self.exif.is_none() => self.exif = segment.strip_prefix(b"Exif\0\0"),
            0xee if segment.starts_with(b"Adobe") => {
                self.segments.adobe_transform = segment.get(11).copied().or(self.segments.adobe_transform);
            }
            _ => {}
        }
        Ok(())
    }
}
