//! Any bytes as a file of `import::obj`.
#![no_main]

use libfuzzer_sys::fuzz_target;
use strivec::import::obj;

fuzz_target!(|bytes: &[u8]| strivec_fuzz::import(bytes, obj::read));
