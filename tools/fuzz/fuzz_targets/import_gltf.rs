//! Any bytes as a glTF or GLB file that finds nothing beside it.
#![no_main]

use libfuzzer_sys::fuzz_target;
use strivec::import::{Fault, gltf};

fuzz_target!(|bytes: &[u8]| {
    let beside = |name: &str| Err(Fault::malformed(name, "a file", "none"));
    strivec_fuzz::import(bytes, |input, options, visitor| gltf::read(input, &beside, options, visitor));
});
