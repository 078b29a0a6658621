//! Written scenes are read back unchanged.

use glam::{DVec3, UVec3};
use half::f16;
use strivec_format::container::{
    ArrayOptions, Codec, EncodeOptions, Encoding, FactorOptions, Filter, GRID_BITS, Limits, Metadata, SectionKind,
    decode, decode_scene_file, encode, encode_scene_file, sections, step,
};
use strivec_format::geometry::Lattice;
use strivec_format::model::{Aggregation, Coverage, DecoderMode, Placement, Reduction, Scene, Sky, UpAxis};

use super::scenes::{Numbers, scale, smallest, two_scales};
use super::surgery::{File, Part};

/// Factors as they are, plainly stored, in two chunks of the coarse scale.
pub(crate) fn f32() -> EncodeOptions {
    plain(Encoding::F32)
}

pub(crate) fn f16() -> EncodeOptions {
    plain(Encoding::F16)
}

pub(crate) fn plain(encoding: Encoding) -> EncodeOptions {
    let factors = vec![FactorOptions { array: ArrayOptions { encoding, filter: Filter::None }, steps: None }];
    EncodeOptions {
        density: factors.clone(),
        appearance: factors,
        chunk_tensors: 2,
        zstd_level: None,
        ..EncodeOptions::default()
    }
}

/// All factors and weights as bits: distinguishes 0 from −0.
fn bits(scene: &Scene) -> Vec<u32> {
    let scales = scene.scales.iter();
    let of_scales = scales
        .flat_map(|s| [&s.factors.density[0].values, &s.factors.appearance[0].values, &s.appearance_matrix.weights]);
    let of_layers = scene.decoder.layers.iter().flat_map(|l| [&l.weights, &l.bias]);
    let of_sky = scene.rules.sky.iter().map(|sky| &sky.coefficients);
    of_scales.chain(of_layers).chain(of_sky).flatten().map(|v| v.to_bits()).collect()
}

fn same(a: &Scene, b: &Scene) -> bool {
    a == b && bits(a) == bits(b)
}

fn comes_back(scene: &Scene) -> bool {
    same(&decode(&encode(scene, &f32()).unwrap()).unwrap(), scene)
}

#[test]
fn the_comparison_sees_the_sign_of_zero_and_the_last_bit() {
    let scene = two_scales();
    let mut sign = scene.clone();
    sign.scales[0].factors.density[0].values[3] = 0.0;
    let mut last_bit = scene.clone();
    let value = &mut last_bit.scales[1].factors.appearance[0].values[0];
    *value = f32::from_bits(value.to_bits() ^ 1);
    assert!(same(&scene, &scene.clone()) && !same(&scene, &sign) && !same(&scene, &last_bit));
}

#[test]
fn f32_scenes_come_back_bit_for_bit() {
    assert!(comes_back(&two_scales()));
    assert!(comes_back(&smallest()));
    let mut without_occupancy = two_scales();
    without_occupancy.occupancy = None;
    assert!(comes_back(&without_occupancy));
}

#[test]
fn every_choice_comes_back() {
    let mut scene = two_scales();
    let changes: [fn(&mut Scene); 17] = [
        |s| s.rules.coverage = Coverage::Any,
        |s| s.rules.aggregation = Aggregation::Clamped,
        |s| s.rules.density_reduction = Reduction::Mean,
        |s| s.rules.appearance_reduction = Reduction::Sum,
        |s| s.rules.sky = Some(Sky::gray(1)),
        |s| s.rules.sky = Some(Sky { degree: 4, coefficients: Numbers(5).take(75) }),
        |s| s.rules.sky.as_mut().unwrap().coefficients[74] = -0.0,
        |s| s.frame.up = UpAxis::X,
        |s| s.frame.up = UpAxis::Y,
        |s| s.frame.up = UpAxis::MinusX,
        |s| s.frame.up = UpAxis::MinusY,
        |s| s.frame.up = UpAxis::MinusZ,
        |s| s.frame.meters_per_unit = None,
        |s| s.decoder.mode = DecoderMode::PerSample,
        |s| {
            s.decoder.mode = DecoderMode::Residual;
            for matrix in s.scales.iter_mut().map(|scale| &mut scale.appearance_matrix) {
                matrix.features = 3;
                matrix.weights.resize(3 * matrix.rank as usize, 0.25);
            }
            s.decoder.layers[0].inputs = 12;
            s.decoder.layers[0].weights.resize(12 * 4, -0.5);
        },
        |s| s.scales[0].top_k = 2,
        |s| s.provenance.dataset.clear(),
    ];
    for change in changes {
        let before = encode(&scene, &f32()).unwrap();
        change(&mut scene);
        assert_ne!(encode(&scene, &f32()).unwrap(), before);
        assert!(comes_back(&scene));
    }
}

/// The degree, the coefficients behind the 104 bytes of the other fields, and no other byte.
#[test]
fn a_sky_is_a_tail_of_rules_and_files_without_one_have_none() {
    let mut scene = two_scales();
    let plain = File::of(&encode(&scene, &f32()).unwrap()).part("RULES").payload.clone();
    assert_eq!((plain.len(), plain[7]), (104, 0));
    for degree in 1..=4u32 {
        let coefficients = Numbers(degree).take(3 * (degree as usize + 1).pow(2));
        scene.rules.sky = Some(Sky { degree, coefficients: coefficients.clone() });
        let mut expected = plain.clone();
        expected[7] = degree as u8;
        expected.extend(coefficients.iter().flat_map(|c| c.to_le_bytes()));
        assert_eq!(File::of(&encode(&scene, &f16()).unwrap()).part("RULES").payload, expected);
    }
}

#[test]
fn f16_scenes_come_back_rounded_and_all_else_exact() {
    let scene = two_scales();
    let mut rounded = scene.clone();
    for scale in &mut rounded.scales {
        for values in [&mut scale.factors.density[0].values, &mut scale.factors.appearance[0].values] {
            values.iter_mut().for_each(|v| *v = f16::from_f32(*v).to_f32());
        }
    }
    let decoded = decode(&encode(&scene, &f16()).unwrap()).unwrap();
    assert!(same(&decoded, &rounded));
    assert!(!same(&decoded, &scene));
}

#[test]
fn bytes_are_canonical() {
    for scene in [two_scales(), smallest()] {
        let file = encode(&scene, &f32()).unwrap();
        assert_eq!(encode(&decode(&file).unwrap(), &f32()).unwrap(), file);
        for encoding in [Encoding::F16, Encoding::Grid(6)] {
            assert_eq!(encode(&scene, &plain(encoding)).unwrap(), encode(&scene, &plain(encoding)).unwrap());
        }
    }
    assert_ne!(encode(&two_scales(), &f32()).unwrap(), encode(&two_scales(), &f16()).unwrap());
}

#[test]
fn bodies_are_compressed_where_it_helps() {
    let mut scene = smallest();
    let cells = (0..2000).map(|n| UVec3::new(n % 37, n / 37 % 11, n / 407)).collect();
    let lattice = Lattice { origin: DVec3::splat(-0.7), pitch: DVec3::splat(0.01) };
    let placement = Placement::Lattice { lattice, cells };
    let mut numbers = Numbers(3);
    scene.scales[0] = scale(&mut numbers, placement, DVec3::splat(0.02), [2, 2, 2], [1, 1]);
    let all = scene.scales[0].factors.density[0].values.len();
    scene.scales[0].factors.density[0].values[all / 2..].fill(0.25);
    assert!(comes_back(&scene));
    let file = encode(&scene, &EncodeOptions { chunk_tensors: 4096, zstd_level: Some(9), ..f32() }).unwrap();
    let contents = sections(&file).unwrap();
    let of = |kind| contents.sections.iter().find(|s| s.kind == kind).unwrap();
    for kind in [SectionKind::Placement, SectionKind::Density] {
        assert_eq!(of(kind).codec, Codec::Zstd, "{kind}");
        assert!(of(kind).length < of(kind).decoded_length);
    }
    assert!(of(SectionKind::Placement).length < 200, "runs of cells take next to nothing");
    assert_eq!(of(SectionKind::Rules).codec, Codec::Stored);
}

#[test]
fn sections_are_listed_from_the_start_of_a_file() {
    let file = encode(&two_scales(), &f16()).unwrap();
    let contents = sections(&file[..64 + 64 * 18]).unwrap();
    assert_eq!(contents.file_length, file.len() as u64);
    assert_eq!(contents.version.to_string(), "1.0");
    let names: Vec<_> = contents.sections.iter().map(ToString::to_string).collect();
    let expected = [
        "FRAME",
        "RULES",
        "PROVENANCE",
        "DECODER",
        "OCCUPANCY",
        "SCALE of scale 0",
        "MATRIX of scale 0",
        "PLACEMENT of chunk 0 of scale 0",
        "DENSITY of chunk 0 of scale 0",
        "APPEARANCE of chunk 0 of scale 0",
        "PLACEMENT of chunk 1 of scale 0",
        "DENSITY of chunk 1 of scale 0",
        "APPEARANCE of chunk 1 of scale 0",
        "SCALE of scale 1",
        "MATRIX of scale 1",
        "PLACEMENT of chunk 0 of scale 1",
        "DENSITY of chunk 0 of scale 1",
        "APPEARANCE of chunk 0 of scale 1",
    ];
    assert_eq!(names, expected);
    for section in &contents.sections {
        assert_eq!(section.offset % 64, 0);
        assert_eq!(section.critical, section.kind != SectionKind::Provenance);
    }
}

#[test]
fn unknown_ancillary_sections_and_newer_minor_versions_open() {
    let scene = two_scales();
    let mut file = File::of(&encode(&scene, &f32()).unwrap());
    file.minor = 7;
    file.sections.insert(0, Part::ancillary("X-0", b"not a picture"));
    let mut strange = Part::ancillary("X-1", b"");
    (strange.scale, strange.codec, strange.decoded_length) = (900, 77, u64::MAX);
    file.sections.push(strange);
    let bytes = file.bytes();
    assert!(same(&decode(&bytes).unwrap(), &scene));
    let contents = sections(&bytes).unwrap();
    assert_eq!((contents.version.minor, contents.sections.len()), (7, 20));
    assert_eq!(contents.sections[19].to_string(), "X-1 of scale 900");
}

#[test]
fn a_file_may_lack_its_provenance() {
    let scene = two_scales();
    let mut file = File::of(&encode(&scene, &f32()).unwrap());
    file.sections.remove(file.index("PROVENANCE"));
    assert_eq!(decode(&file.bytes()).unwrap(), Scene { provenance: Default::default(), ..scene });
}

#[test]
fn what_this_version_does_not_know_is_kept_through_reading_and_writing() {
    let mut file = File::of(&encode(&two_scales(), &f32()).unwrap());
    let mut strange = Part::ancillary("X-1", b"opaque");
    (strange.scale, strange.chunk, strange.codec, strange.decoded_length) = (900, 7, 77, 1 << 40);
    file.sections.insert(3, strange.clone());
    let document = decode_scene_file(&file.bytes(), Limits::default()).unwrap();
    let written = encode_scene_file(&document.scene, &document.metadata, &f32()).unwrap();
    let last = File::of(&written).sections.pop().unwrap();
    assert_eq!(last, strange);
    assert_eq!(decode_scene_file(&written, Limits::default()).unwrap(), document);
}

/// The largest difference between two scenes' factors.
fn largest_difference(a: &Scene, b: &Scene) -> f64 {
    let of_scales = |scene: &Scene| -> Vec<f32> {
        scene
            .scales
            .iter()
            .flat_map(|s| [&s.factors.density[0].values, &s.factors.appearance[0].values])
            .flatten()
            .copied()
            .collect()
    };
    let differences = of_scales(a).into_iter().zip(of_scales(b)).map(|(a, b)| (f64::from(a) - f64::from(b)).abs());
    differences.fold(0.0, f64::max)
}

#[test]
fn grids_lose_half_a_step_at_most() {
    let scene = two_scales();
    for bits in GRID_BITS {
        let decoded = decode(&encode(&scene, &plain(Encoding::Grid(bits))).unwrap()).unwrap();
        // All numbers are below 1, and steps are at most 2^(1/8) times what they must be.
        let step = 1.0905078 / f64::from((1u32 << (bits - 1)) - 1);
        let found = largest_difference(&scene, &decoded);
        assert!(found <= step / 2.0 + 1e-7 && found > step / 20.0, "{bits} bits: {found} of {step}");
    }
}

#[test]
fn integers_come_back_within_their_steps_stored_and_coded() {
    let scene = two_scales();
    for code in [110, 130, 160, 180] {
        let options = |scale: usize| FactorOptions {
            array: ArrayOptions::best(Encoding::Grid(16)),
            steps: Some(vec![vec![code; 3 * scene.scales[scale].cloud.len()]]),
        };
        let of_scales = vec![options(0), options(1)];
        let options = EncodeOptions { density: of_scales.clone(), appearance: of_scales, ..f32() };
        let stored = encode(&scene, &options).unwrap();
        let coded = encode(&scene, &EncodeOptions { zstd_level: Some(1), ..options }).unwrap();
        // Bodies here have a hundred bytes. Noise in small steps is stored: it has nothing to save.
        let is_coded = sections(&coded).unwrap().sections.iter().any(|s| s.codec == Codec::Adaptive);
        assert_eq!(is_coded, code >= 160, "{code}");
        let decoded = decode(&stored).unwrap();
        assert_eq!(decode(&coded).unwrap(), decoded);
        let found = largest_difference(&scene, &decoded);
        let step = f64::from(step(code));
        assert!(found <= step / 2.0 + 1e-7 && found > step / 20.0 - 1e-6, "{code}: {found} of {step}");
    }
}

#[test]
fn components_that_are_zero_take_no_bytes() {
    let mut scene = two_scales();
    let before = encode(&scene, &f32()).unwrap();
    // Component 1 of tensor 2 of scale 0.
    let rank = scene.scales[0].factors.appearance_rank() as usize;
    let rows = strivec_format::model::Form::Cp.rows(scene.scales[0].cloud.resolution);
    scene.scales[0].factors.appearance[0].values[2 * rows * rank..3 * rows * rank]
        .iter_mut()
        .skip(1)
        .step_by(rank)
        .for_each(|v| *v = 0.0);
    for encoding in [Encoding::F16, Encoding::Grid(8)] {
        let decoded = decode(&encode(&scene, &plain(encoding)).unwrap()).unwrap();
        assert!(largest_difference(&decoded, &scene) < 0.005, "{encoding:?}");
    }
    assert!(comes_back(&scene));
    assert!(encode(&scene, &f32()).unwrap().len() < before.len());
    // A tensor without any component is still there.
    scene.scales[1].factors.density[0].values.fill(0.0);
    scene.scales[1].factors.appearance[0].values.fill(0.0);
    assert!(comes_back(&scene));
}

#[test]
fn filters_lose_nothing() {
    let scene = two_scales();
    let of = |encoding, filter| {
        let factors = vec![FactorOptions { array: ArrayOptions { encoding, filter }, steps: None }];
        let options = EncodeOptions { density: factors.clone(), appearance: factors, ..f32() };
        decode(&encode(&scene, &options).unwrap()).unwrap()
    };
    assert!(same(&of(Encoding::F32, Filter::Planes), &scene));
    assert!(same(&of(Encoding::F16, Filter::Planes), &of(Encoding::F16, Filter::None)));
}

#[test]
fn extras_come_back() {
    let (scene, metadata) = (two_scales(), super::scenes::metadata());
    let bytes = encode_scene_file(&scene, &metadata, &f32()).unwrap();
    let document = decode_scene_file(&bytes, Limits::default()).unwrap();
    assert_eq!((document.scene, &document.metadata), (scene.clone(), &metadata));
    assert_ne!(document.metadata, Metadata::default());
    assert_eq!(encode_scene_file(&scene, &metadata, &f32()).unwrap(), bytes);
}

#[test]
fn what_readers_would_drop_is_not_written() {
    let write = |metadata: Metadata| encode_scene_file(&smallest(), &metadata, &f32());
    let notes = |count: u32, length: usize| Metadata {
        notes: (0..count).map(|n| (format!("{n:06}"), "a".repeat(length))).collect(),
        ..Metadata::default()
    };
    let file = decode_scene_file(&write(notes(100, 100)).unwrap(), Limits::default()).unwrap();
    assert_eq!(file.metadata.notes.len(), 100);
    for (count, length, what) in [(70_000, 0, "notes"), (20, 1 << 16, "bytes")] {
        let error = write(notes(count, length)).unwrap_err();
        assert!(error.to_string().starts_with(&format!("NOTES {what} must be within the format's limits")), "{error}");
    }
}
