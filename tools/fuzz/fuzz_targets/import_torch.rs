//! Any bytes as a file of `import::torch`.
#![no_main]

use libfuzzer_sys::fuzz_target;
use strivec::checkpoints::torch;

fuzz_target!(|bytes: &[u8]| strivec_fuzz::import(bytes, torch::read));
