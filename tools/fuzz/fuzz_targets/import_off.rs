//! Any bytes as a file of `import::off`.
#![no_main]

use libfuzzer_sys::fuzz_target;
use strivec::import::off;

fuzz_target!(|bytes: &[u8]| strivec_fuzz::import(bytes, off::read));
