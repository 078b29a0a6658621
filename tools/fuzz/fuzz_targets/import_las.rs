//! Any bytes as a file of `prior::import::las`.
#![no_main]

use libfuzzer_sys::fuzz_target;
use strivec::prior::import::las;

fuzz_target!(|bytes: &[u8]| strivec_fuzz::import(bytes, las::read));
