//! Any bytes as a LAS file. Compressed points are left out: `laz` panics on some bytes, which the reader catches, but a
//! fuzzer reports.
#![no_main]

use libfuzzer_sys::fuzz_target;
use strivec::import::las;

/// Offset of the point format in the header, and the bit that marks compressed points.
const POINT_FORMAT: usize = 104;
const COMPRESSED: u8 = 0xC0;

fuzz_target!(|bytes: &[u8]| {
    if bytes.get(POINT_FORMAT).is_none_or(|format| format & COMPRESSED == 0) {
        strivec_fuzz::import(bytes, las::read);
    }
});
