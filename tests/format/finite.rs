//! Every number of every section of a file, made NaN or infinite: named by the reader, never rendered.

use strivec_format::container::{Error, Limits, SceneFile, decode_scene_file, encode_scene_file};
use strivec_format::model::Sky;

use super::roundtrip::f32;
use super::scenes::{metadata, two_scales};
use super::surgery::{File, Part, name};

/// `count` floats of `size` bytes from byte `first` on.
fn run(first: usize, count: usize, size: usize) -> Vec<(usize, usize)> {
    (0..count).map(|n| (first + n * size, size)).collect()
}

/// Offsets of the floats of a section, and their sizes in bytes, as in the tables of the specification; bodies begin at
/// byte 64, SCALE's at 128.
fn floats(part: &Part) -> Vec<(usize, usize)> {
    let end = part.payload.len();
    let body = || run(64, (end - 64) / 4, 4);
    let is = |kind: &str| part.kind == name(kind);
    match () {
        () if is("FRAME") => [run(0, 11, 8), run(88, 3, 4)].concat(),
        // Those behind the record are the sky's.
        () if is("RULES") => [run(8, 12, 8), run(104, (end - 104) / 4, 4)].concat(),
        () if is("OCCUPANCY") => run(0, 6, 8),
        () if is("QUALITY") => [run(0, 3, 8), run(32, 2, 8)].concat(),
        () if is("VIEWS") => [run(0, 12, 8), run(105, 21, 8)].concat(),
        () if is("DECODER") => body(),
        () if is("PREFIX") => [run(0, 2, 8), body()].concat(),
        () if is("PROBES") => [run(0, 3, 8), run(64, 16, 8), run(64 + 144, 16, 8)].concat(),
        () if is("CAMERAS") => [run(64, 11, 8), run(64 + 104, 11, 8)].concat(),
        () if is("SCALE") => [run(8, 3, 8), run(64, 6, 8), run(128 + 4, 6, 8)].concat(),
        () if is("MATRIX") => body(),
        () if is("DENSITY") || is("APPEARANCE") => body(),
        // Those of scale 0 are cells.
        () if is("PLACEMENT") && part.scale == 1 => run(0, end / 8, 8),
        () => Vec::new(),
    }
}

fn read(file: &File) -> Result<SceneFile, Error> {
    decode_scene_file(&file.bytes(), Limits::default())
}

#[test]
fn no_number_of_a_file_may_be_nan_or_infinite() {
    let mut scene = two_scales();
    scene.rules.sky = Some(Sky::gray(1));
    let file = File::of(&encode_scene_file(&scene, &metadata(), &f32()).unwrap());
    assert!(read(&file).is_ok());
    let mut tried = 0;
    for (index, part) in file.sections.iter().enumerate() {
        let kind = String::from_utf8_lossy(&part.kind);
        for (at, size) in floats(part) {
            for value in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
                // A PSNR may be infinite: there is no error.
                if part.kind == name("QUALITY") && value == f64::INFINITY {
                    continue;
                }
                let mut changed = file.clone();
                let bytes =
                    if size == 8 { value.to_le_bytes().to_vec() } else { (value as f32).to_le_bytes().to_vec() };
                changed.sections[index].patch(at, &bytes);
                let error = match read(&changed) {
                    Err(error) => Some(error),
                    Ok(mut file) => file.metadata.skipped.pop().map(|skipped| skipped.error),
                };
                let error = error.unwrap_or_else(|| panic!("{kind}: {value} at {at} is read"));
                assert!(!error.to_string().contains('\n'), "{error}");
                tried += 1;
            }
        }
    }
    assert!(tried > 1000, "{tried}");
}
