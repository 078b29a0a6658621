//! Arbitrary scenes and options: a written scene reads back exactly if its numbers are stored exactly, else within a step of
//! the coarsest grid, and is written again as the same bytes.
#![no_main]

use arbitrary::{Arbitrary, Unstructured};
use libfuzzer_sys::fuzz_target;
use strivec::container::{ArrayOptions, EncodeOptions, Encoding, FactorOptions, Filter, Limits, decode, decode_scene_file, encode};
use strivec::model::Scene;

#[derive(Debug, Arbitrary)]
struct RenderSettings {
    file: u8,
    encoding: u8,
    filter: u8,
    networks: u8,
    chunk_tensors: u8,
    level: u8,
    /// Values that overwrite numbers, and the stride between them.
    stride: u8,
    numbers: Vec<f32>,
}

const FILES: [&[u8]; 6] = [
    include_bytes!("../../../fixtures/v1/smallest.strivec"),
    include_bytes!("../../../fixtures/v1/everything.strivec"),
    include_bytes!("../../../fixtures/v1/f32.strivec"),
    include_bytes!("../../../fixtures/v1/explicit.strivec"),
    include_bytes!("../../../fixtures/v1/vm.strivec"),
    include_bytes!("../../../fixtures/v1/vm-ragged-f32.strivec"),
];

fn encoding(choice: u8) -> Encoding {
    [Encoding::F32, Encoding::F16, Encoding::Grid(16), Encoding::Grid(8), Encoding::Grid(6), Encoding::Grid(5), Encoding::Grid(4), Encoding::Grid(3)]
        [choice as usize % 8]
}

fn filter(choice: u8, encoding: Encoding) -> Filter {
    match (choice % 2, encoding) {
        (0, _) | (_, Encoding::Grid(_)) => Filter::None,
        _ => Filter::Planes,
    }
}

/// Overwrites the scene's factors.
fn change(scene: &mut Scene, stride: u8, numbers: &[f32]) {
    let mut at = 0;
    for scale in &mut scene.scales {
        for block in scale.factors.blocks_mut() {
            for value in block.values.iter_mut().step_by(1 + stride as usize) {
                if let Some(&number) = numbers.get(at % numbers.len().max(1)) {
                    *value = number;
                }
                at += 1;
            }
        }
    }
}

fuzz_target!(|bytes: &[u8]| {
    let Ok(choice) = RenderSettings::arbitrary(&mut Unstructured::new(bytes)) else { return };
    let mut scene = decode(FILES[choice.file as usize % FILES.len()]).expect("a valid vector");
    change(&mut scene, choice.stride, &choice.numbers);
    let of_factors = encoding(choice.encoding);
    let networks = [Encoding::F32, Encoding::F16, Encoding::Grid(8)][choice.networks as usize % 3];
    let factors =
        vec![FactorOptions { array: ArrayOptions { encoding: of_factors, filter: filter(choice.filter, of_factors) }, steps: None }];
    let options = EncodeOptions {
        density: factors.clone(),
        appearance: factors,
        networks: ArrayOptions { encoding: networks, filter: filter(choice.filter, networks) },
        chunk_tensors: 1 + choice.chunk_tensors as usize,
        zstd_level: (choice.level > 0).then(|| 1 + i32::from(choice.level % 3)),
        ..EncodeOptions::default()
    };
    // Numbers that are not finite or too large for the encoding are refused.
    let Ok(written) = encode(&scene, &options) else { return };
    let read = decode_scene_file(&written, Limits::default()).expect("what was written can be read").scene;
    if of_factors == Encoding::F32 && networks == Encoding::F32 {
        assert_eq!(read, scene);
        assert_eq!(encode(&read, &options).expect("and written again"), written);
    }
    for (n, (before, after)) in scene.scales.iter().zip(&read.scales).enumerate() {
        for (before, after) in before.factors.blocks().zip(after.factors.blocks()) {
            let (form, before, after) = (before.form, &before.values, &after.values);
            let lost = before.iter().zip(after).map(|(b, a)| (f64::from(*b) - f64::from(*a)).abs()).fold(0.0, f64::max);
            let largest = before.iter().fold(0f64, |m, v| m.max(f64::from(v.abs())));
            // A step of the coarsest grid is below a third of the largest number, and an eighth of an octave to spare;
            // the smallest step is 2^-24.
            assert!(lost <= 0.25 * largest + 6e-8, "{form:?} of scale {n}: {lost} lost, {largest} at most there");
        }
    }
});
