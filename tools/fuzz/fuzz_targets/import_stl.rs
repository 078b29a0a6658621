//! Any bytes as a file of `import::stl`.
#![no_main]

use libfuzzer_sys::fuzz_target;
use strivec::import::stl;

fuzz_target!(|bytes: &[u8]| strivec_fuzz::import(bytes, stl::read));
