//! Any bytes as a file of `import::arrays`.
#![no_main]

use libfuzzer_sys::fuzz_target;
use strivec::import::arrays;

fuzz_target!(|bytes: &[u8]| strivec_fuzz::import(bytes, arrays::read));
