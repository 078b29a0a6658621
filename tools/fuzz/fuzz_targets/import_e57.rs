//! Any bytes as the pages of an E57 file, whose checksums are made right.
#![no_main]

use libfuzzer_sys::fuzz_target;
use strivec::import::e57;

/// Bytes of a page, of which the last four are a checksum of the others.
const PAGE: usize = 1024;

fuzz_target!(|bytes: &[u8]| {
    let mut bytes = bytes.to_vec();
    for page in bytes.chunks_exact_mut(PAGE) {
        let (payload, checksum) = page.split_at_mut(PAGE - 4);
        checksum.copy_from_slice(&crc32c::crc32c(payload).to_be_bytes());
    }
    strivec_fuzz::import(&bytes, e57::read);
});
