//! Any bytes as a photograph: JPEG by the reader of our own, other formats by their decoders.
#![no_main]

use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| strivec_fuzz::photograph(bytes));
