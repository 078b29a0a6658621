//! Any bytes as a glTF or GLB file without separate buffers.
#![no_main]

use libfuzzer_sys::fuzz_target;
use strivec::import::{Fault, gltf};

fuzz_target!(|bytes: &[u8]| {
    let beside = |name: &str| Err(Fault::broken(name, "there is no file"));
    strivec_fuzz::import(bytes, |input, options, visitor| gltf::read(input, &beside, options, visitor));
});
