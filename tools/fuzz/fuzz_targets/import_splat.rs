//! Any bytes as a file of `import::splats::read_records`.
#![no_main]

use libfuzzer_sys::fuzz_target;
use strivec::import::splats;

fuzz_target!(|bytes: &[u8]| strivec_fuzz::import(bytes, splats::read_records));
