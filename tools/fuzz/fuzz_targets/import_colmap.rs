//! Any bytes as COLMAP's points, binary and text.
#![no_main]

use libfuzzer_sys::fuzz_target;
use strivec::import::colmap;

fuzz_target!(|bytes: &[u8]| {
    strivec_fuzz::import(bytes, colmap::read_binary);
    strivec_fuzz::import(bytes, colmap::read_text);
});
