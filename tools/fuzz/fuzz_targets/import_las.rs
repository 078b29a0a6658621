//! Any bytes as a LAS file. What `laz` decompresses is left out: it panics on some bytes, which the reader catches and
//! a fuzzer does not.
#![no_main]

use libfuzzer_sys::fuzz_target;
use strivec::import::las;

/// Where the header says which format points have, and what says that they are compressed.
const POINT_FORMAT: usize = 104;
const COMPRESSED: u8 = 0xC0;

fuzz_target!(|bytes: &[u8]| {
    if bytes.get(POINT_FORMAT).is_none_or(|format| format & COMPRESSED == 0) {
        strivec_fuzz::import(bytes, las::read);
    }
});
