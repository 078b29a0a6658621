//! Reading whole files from streams, which may have no end.

use std::io::Read;

use super::error::Error;
use super::table;

/// Bytes that are read before anything is known of a file.
const FIRST_READ: u64 = 16 << 10;

/// The bytes of the scene file that `reader` begins with: its first 16 KiB are checked before more is read, and then no more
/// than one byte beyond the length that it declares. Bytes beyond make the file malformed for [`super::decode`].
///
/// # Errors
///
/// If it begins as no scene file does, if it is longer than any reader's memory, or [`Error::Source`].
pub fn read_all(reader: &mut dyn Read) -> Result<Vec<u8>, Error> {
    let (mut bytes, mut most) = (Vec::new(), FIRST_READ);
    loop {
        let start = bytes.len() as u64;
        let read = (&mut *reader).take(most - start).read_to_end(&mut bytes);
        read.map_err(|e| Error::Source { range: start..most, message: e.to_string() })?;
        if (bytes.len() as u64) < most {
            return Ok(bytes);
        }
        match table::sections(&bytes) {
            Ok(contents) if contents.file_length < most => return Ok(bytes),
            Ok(contents) => {
                contents.check_length()?;
                most = contents.file_length + 1;
            }
            Err(Error::Truncated { missing, .. }) => most = missing.end,
            Err(error) => return Err(error),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FILE: &[u8] = include_bytes!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../fixtures/v1/zstd.strivec"));

    #[test]
    fn a_file_is_read_whole_and_a_stream_without_end_is_not() {
        assert_eq!(read_all(&mut &FILE[..]), Ok(FILE.to_vec()));
        assert_eq!(read_all(&mut &FILE[..20_000]), Ok(FILE[..20_000].to_vec()));
        assert_eq!(read_all(&mut &b"other"[..]), Ok(b"other".to_vec()), "decoding says what is wrong");
        let after = read_all(&mut FILE.chain(std::io::repeat(0))).unwrap();
        assert_eq!(after.len(), FILE.len() + 1);
        assert!(matches!(read_all(&mut std::io::repeat(0)), Err(Error::NotStrivec { .. })));
    }
}
