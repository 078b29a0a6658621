//! Any bytes as `transforms.json`, of a dataset without pictures and as a split of Blender's layout.
#![no_main]

use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    strivec_fuzz::describe(&[("transforms.json", bytes)]);
    strivec_fuzz::describe(&[("transforms_train.json", bytes)]);
});
