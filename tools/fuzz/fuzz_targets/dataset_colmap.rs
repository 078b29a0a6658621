//! Any bytes as COLMAP's cameras and images, binary and text: the first four bytes are the length of the cameras.
#![no_main]

use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    let Some((length, rest)) = bytes.split_first_chunk() else { return };
    let length = (u32::from_le_bytes(*length) as usize).min(rest.len());
    let (cameras, images) = rest.split_at(length);
    strivec_fuzz::describe(&[("sparse/cameras.bin", cameras), ("sparse/images.bin", images)]);
    strivec_fuzz::describe(&[("sparse/cameras.txt", cameras), ("sparse/images.txt", images)]);
});
