//! Any bytes as a file of `import::xyz`.
#![no_main]

use libfuzzer_sys::fuzz_target;
use strivec::import::xyz;

fuzz_target!(|bytes: &[u8]| strivec_fuzz::import(bytes, xyz::read));
