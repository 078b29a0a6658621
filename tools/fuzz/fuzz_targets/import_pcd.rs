//! Any bytes as a file of `import::pcd`.
#![no_main]

use libfuzzer_sys::fuzz_target;
use strivec::import::pcd;

fuzz_target!(|bytes: &[u8]| strivec_fuzz::import(bytes, pcd::read));
