//! zstd in Rust, for browsers, where C does not go: reading alone. It refuses what the C library refuses, but for a few
//! redundant bits of compressed blocks, which it does not look at.

use std::fmt;
use std::io::Read as _;

use ::ruzstd::decoding::{BlockDecodingStrategy, FrameDecoder};

use crate::container::error::{Error, hex};

/// The first bytes of a frame.
const MAGIC: [u8; 4] = [0x28, 0xb5, 0x2f, 0xfd];

/// Always an error: nothing is written in browsers.
#[cfg(target_arch = "wasm32")]
pub(in crate::container) fn compress(place: &dyn fmt::Display, _: &[u8], _: i32) -> Result<Vec<u8>, Error> {
    let message = "zstd is only read in browsers; leave bodies stored".to_owned();
    Err(Error::Compression { section: place.to_string(), message })
}

/// The content of the one zstd frame that `bytes` must be, which must have `length` bytes. Memory stays in proportion to
/// that, whatever the frame holds: the caller has checked it.
pub(in crate::container) fn decompress(
    place: &dyn fmt::Display,
    bytes: &[u8],
    length: usize,
) -> Result<Vec<u8>, Error> {
    let invalid = |error: &dyn fmt::Display| Error::malformed(place, "a valid zstd frame", error);
    let Some(frame) = bytes.strip_prefix(&MAGIC) else {
        return Err(Error::malformed(place, "a zstd frame", hex(&bytes[..bytes.len().min(4)])));
    };
    super::check_window(place, bytes)?;
    let Some((header, mut blocks)) = ZstdFrameHeader::read(frame) else {
        return Err(Error::malformed(place, "a whole zstd frame", "a damaged header"));
    };
    match header.content {
        Some(content) => Error::unless_equal(format!("{place} zstd content size"), length as u64, content)?,
        None => return Err(Error::malformed(place, "a zstd frame that declares its content's size", "no size")),
    }

    let mut decoder = FrameDecoder::new();
    decoder.set_max_window_size(u64::MAX);
    decoder.reset(header.of_one_window(length).as_slice()).map_err(|e| invalid(&e))?;
    while !decoder.is_finished() {
        decoder.decode_blocks(&mut blocks, BlockDecodingStrategy::UptoBlocks(1)).map_err(|e| invalid(&e))?;
        // The window is as long as the content, so nothing can be taken from it before the end unless there is more.
        if !decoder.is_finished() && decoder.can_collect() > 0 {
            return Err(invalid(&"more content than it declares"));
        }
    }
    Error::unless_equal(format!("{place} number of decompressed bytes"), length, decoder.can_collect())?;
    let mut content = vec![0; length];
    decoder.read_exact(&mut content).map_err(|e| invalid(&e))?;
    if header.has_checksum && decoder.get_checksum_from_data() != decoder.get_calculated_checksum() {
        return Err(invalid(&"a checksum of other content"));
    }
    Error::unless_equal(format!("{place} zstd frame length"), bytes.len(), bytes.len() - blocks.len())?;
    Ok(content)
}

/// The contents of a frame's header (RFC 8878, section 3.1.1.1), and nothing of its window.
struct ZstdFrameHeader {
    /// Bytes of the content, where they are declared.
    content: Option<u64>,
    has_checksum: bool,
}

impl ZstdFrameHeader {
    /// Reads the header that `frame` has after its magic number; what follows it. `None` where it is cut short, from the
    /// future, or needs a dictionary.
    fn read(frame: &[u8]) -> Option<(Self, &[u8])> {
        let (&descriptor, mut rest) = frame.split_first()?;
        let is_one_segment = descriptor & 0x20 != 0;
        if descriptor & 0x08 != 0 {
            return None;
        }
        if !is_one_segment {
            rest = rest.split_first()?.1;
        }
        let (dictionary, after) = rest.split_at_checked([0, 1, 2, 4][usize::from(descriptor & 3)])?;
        if dictionary.iter().any(|&byte| byte != 0) {
            return None;
        }
        let size = match descriptor >> 6 {
            0 => usize::from(is_one_segment),
            flag => 1 << flag,
        };
        let (size, rest) = after.split_at_checked(size)?;
        let mut number = [0; 8];
        number[..size.len()].copy_from_slice(size);
        let offset = if size.len() == 2 { 256 } else { 0 };
        let content = (!size.is_empty()).then(|| u64::from_le_bytes(number).wrapping_add(offset));
        Some((Self { content, has_checksum: descriptor & 4 != 0 }, rest))
    }

    /// The header, magic number included, of the same frame with a window of its `length` bytes: a declared window could
    /// take more memory than the content ever fills.
    fn of_one_window(&self, length: usize) -> Vec<u8> {
        let descriptor = 0xe0 | u8::from(self.has_checksum) << 2;
        [&MAGIC[..], &[descriptor], &(length as u64).to_le_bytes()].concat()
    }
}

#[cfg(test)]
mod tests {
    use super::super::libzstd;
    use super::*;

    /// Content that compresses into blocks of every type.
    fn content(length: usize) -> Vec<u8> {
        let value = |n: usize| match n / 50_000 % 3 {
            0 => (n.wrapping_mul(2_654_435_761) >> 13) as u8,
            1 => 7,
            _ => (n % 251) as u8 & (n / 251) as u8,
        };
        (0..length).map(value).collect()
    }

    fn frame(content: &[u8], level: i32, with_checksum: bool, window_log: Option<u32>) -> Vec<u8> {
        let mut compressor = zstd::bulk::Compressor::new(level).unwrap();
        compressor.include_checksum(with_checksum).unwrap();
        if let Some(log) = window_log {
            compressor.set_parameter(zstd::zstd_safe::CParameter::WindowLog(log)).unwrap();
        }
        compressor.compress(content).unwrap()
    }

    /// What both decoders make of `bytes`, which must be the same.
    fn both(bytes: &[u8], length: usize) -> Option<Vec<u8>> {
        let [own, other] = [decompress(&"X", bytes, length), libzstd::decompress(&"X", bytes, length)];
        match (&own, &other) {
            (Ok(own), Ok(other)) => assert!(own == other, "contents differ"),
            (Err(_), Err(_)) => {}
            _ => panic!("{:?} and {:?}", own.map(|c| c.len()), other.map(|c| c.len())),
        }
        own.ok()
    }

    #[test]
    fn frames_of_the_c_library_are_read_as_it_reads_them() {
        for length in [0, 1, 255, 256, 1000, 65_791, 131_072, 131_073, 400_000] {
            let content = content(length);
            for (level, with_checksum, window_log) in
                [(1, false, None), (3, true, None), (19, false, None), (3, true, Some(12)), (-5, true, Some(17))]
            {
                let bytes = frame(&content, level, with_checksum, window_log);
                assert_eq!(both(&bytes, length).as_ref(), Some(&content), "{length} bytes, level {level}");
                assert_eq!(both(&bytes, length + 1), None);
                assert_eq!(both(&[&bytes[..], &[0]].concat(), length), None);
                assert_eq!(both(&[&bytes[..], &bytes[..]].concat(), length), None);
                assert_eq!(both(&bytes[..bytes.len() - 1], length), None);
            }
        }
    }

    #[test]
    fn damage_is_refused() {
        let content = content(3000);
        let bytes = frame(&content, 3, true, None);
        for cut in 0..bytes.len() {
            assert_eq!(both(&bytes[..cut], content.len()), None, "cut at {cut}");
        }
        let mut redundant = 0;
        for at in 0..bytes.len() {
            for bit in 0..8 {
                let mut damaged = bytes.clone();
                damaged[at] ^= 1 << bit;
                let [own, other] = [decompress, libzstd::decompress].map(|read| read(&"X", &damaged, content.len()));
                assert!(own.is_ok() || other.is_err(), "byte {at}, bit {bit}: {own:?}");
                assert!(own.is_err() || own.as_ref() == Ok(&content), "byte {at}, bit {bit}: other content");
                redundant += usize::from(own.is_ok());
            }
        }
        assert!(redundant < 64, "{redundant} bits of {} change nothing", 8 * bytes.len());
        let undeclared = zstd::stream::encode_all(&content[..], 3).unwrap();
        assert_eq!(both(&undeclared, content.len()), None);
        let skippable = [0x50, 0x2a, 0x4d, 0x18, 0, 0, 0, 0];
        assert_eq!(both(&[&skippable, &bytes[..]].concat(), content.len()), None);
    }

    /// Blocks of one repeated byte, 128 KiB each, in a frame that declares 100 bytes.
    #[test]
    fn a_frame_of_more_than_it_declares_is_refused_before_it_is_held() {
        let block = [(131_072_u32 << 3 | 1 << 1).to_le_bytes()[..3].to_vec(), vec![0]].concat();
        for declared in [[0x20, 100].as_slice(), &[0x40, 21 << 3, 0, 0]] {
            let blocks = block.repeat(100_000);
            let length = if declared.len() == 2 { 100 } else { 256 };
            assert_eq!(both(&[&MAGIC, declared, &blocks].concat(), length), None);
        }
    }
}
