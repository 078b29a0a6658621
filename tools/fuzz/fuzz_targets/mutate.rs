//! Changed files must give a valid scene, which can be written and read again, or an error.
#![no_main]

mod mutation;

use libfuzzer_sys::fuzz_target;
use mutation::Input;
use strivec::container::{EncodeOptions, Encoding, Limits, decode_scene_file, encode_scene_file};

const LIMITS: Limits = Limits { memory: 1 << 26 };

fuzz_target!(|input: Input| {
    let bytes = input.bytes();
    let Ok(document) = decode_scene_file(&bytes, LIMITS) else { return };
    document.scene.check().expect("what opens is valid");
    let options = EncodeOptions { zstd_level: Some(1), ..EncodeOptions::uniform(Encoding::F32) };
    let written = encode_scene_file(&document.scene, &document.metadata, &options).expect("what opens can be written");
    let again = decode_scene_file(&written, Limits::default()).expect("what was written can be read");
    assert_eq!(again.scene, document.scene);
});
