//! zstd by its C library.

use std::fmt;

use zstd::zstd_safe;

use crate::container::error::{Error, hex};

/// `bytes` as one zstd frame.
pub(in crate::container) fn compress(place: &dyn fmt::Display, bytes: &[u8], level: i32) -> Result<Vec<u8>, Error> {
    zstd::bulk::compress(bytes, level)
        .map_err(|error| Error::Compression { section: place.to_string(), message: error.to_string() })
}

/// The content of the one zstd frame that `bytes` must be, which must have `length` bytes. Allocates no more than
/// that: the caller has checked it.
pub(in crate::container) fn decompress(
    place: &dyn fmt::Display,
    bytes: &[u8],
    length: usize,
) -> Result<Vec<u8>, Error> {
    // The decompressor would also take several frames, and skip frames that hold something else.
    if !bytes.starts_with(&zstd_safe::MAGICNUMBER.to_le_bytes()) {
        return Err(Error::malformed(place, "a zstd frame", hex(&bytes[..bytes.len().min(4)])));
    }
    super::check_window(place, bytes)?;
    let message = zstd_safe::get_error_name;
    let frame = zstd_safe::find_frame_compressed_size(bytes)
        .map_err(|code| Error::malformed(place, "a whole zstd frame", message(code)))?;
    Error::unless_equal(format!("{place} zstd frame length"), bytes.len(), frame)?;
    match zstd_safe::get_frame_content_size(bytes) {
        Ok(Some(content)) => Error::unless_equal(format!("{place} zstd content size"), length as u64, content)?,
        _ => return Err(Error::malformed(place, "a zstd frame that declares its content's size", "no size")),
    }
    let mut content = vec![0; length];
    let written = zstd::bulk::decompress_to_buffer(bytes, &mut content)
        .map_err(|error| Error::malformed(place, "a valid zstd frame", error))?;
    Error::unless_equal(format!("{place} number of decompressed bytes"), length, written)?;
    Ok(content)
}
