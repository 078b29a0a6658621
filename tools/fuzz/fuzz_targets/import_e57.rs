//! Any bytes as a file of `prior::import::e57`.
#![no_main]

use libfuzzer_sys::fuzz_target;
use strivec::prior::import::e57;

fuzz_target!(|bytes: &[u8]| strivec_fuzz::import(bytes, e57::read));
