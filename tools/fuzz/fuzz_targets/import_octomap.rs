//! Any bytes as a file of `import::octomap`.
#![no_main]

use libfuzzer_sys::fuzz_target;
use strivec::import::octomap;

fuzz_target!(|bytes: &[u8]| strivec_fuzz::import(bytes, octomap::read));
