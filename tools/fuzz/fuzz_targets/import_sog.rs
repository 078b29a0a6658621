//! Any bytes as a bundle of `import::splats::read_sog`, and, up to the first zero byte, as its description, whose pictures all
//! are the rest: archives have checksums, which hide the decoders from random bytes.
#![no_main]

use libfuzzer_sys::fuzz_target;
use strivec::import::splats;

fuzz_target!(|bytes: &[u8]| {
    strivec_fuzz::import(bytes, splats::read_sog);
    let end = bytes.iter().position(|&byte| byte == 0).unwrap_or(bytes.len());
    let (meta, picture) = bytes.split_at(end);
    let beside = |_: &str| Ok(picture[picture.len().min(1)..].to_vec());
    strivec_fuzz::import(meta, |input, options, visitor| {
        splats::read_sog_meta(input, &beside, options, visitor)
    });
});
