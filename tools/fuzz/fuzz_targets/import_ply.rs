//! Any bytes as a file of `import::ply`.
#![no_main]

use libfuzzer_sys::fuzz_target;
use strivec::import::ply;

fuzz_target!(|bytes: &[u8]| strivec_fuzz::import(bytes, ply::read));
