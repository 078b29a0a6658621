//! Of changed files: a valid scene, which can be written and read again, or an error.
#![no_main]

mod mutation;

use libfuzzer_sys::fuzz_target;
use mutation::Input;
use strivec::container::{EncodeOptions, Encoding, Limits, decode_document, encode_document};

const LIMITS: Limits = Limits { memory: 1 << 26 };

fuzz_target!(|input: Input| {
    let bytes = input.bytes();
    let Ok(document) = decode_document(&bytes, LIMITS) else { return };
    document.scene.check().expect("what opens is valid");
    let options = EncodeOptions { zstd_level: Some(1), ..EncodeOptions::uniform(Encoding::F32) };
    let written = encode_document(&document.scene, &document.extras, &options).expect("what opens can be written");
    let again = decode_document(&written, Limits::default()).expect("what was written can be read");
    assert_eq!(again.scene, document.scene);
});
