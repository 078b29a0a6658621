//! Untrusted bytes must give a valid scene or an error, in bounded memory.
#![no_main]

use libfuzzer_sys::fuzz_target;
use strivec::container::{Limits, decode_scene_file};

fuzz_target!(|bytes: &[u8]| {
    if let Ok(document) = decode_scene_file(bytes, Limits { memory: 1 << 26 }) {
        document.scene.check().expect("what opens is valid");
    }
});
