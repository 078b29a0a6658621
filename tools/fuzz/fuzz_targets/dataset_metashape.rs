//! Any bytes as Metashape's `cameras.xml`.
#![no_main]

use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| strivec_fuzz::describe(&[("cameras.xml", bytes)]));
