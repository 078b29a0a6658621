//! What is written comes back.

use glam::{DVec3, UVec3};
use half::f16;
use strivec::container::{Codec, EncodeOptions, FactorEncoding, SectionKind, decode, encode, sections};
use strivec::geometry::{Aabb, Lattice};
use strivec::model::{Aggregation, Coverage, DecoderMode, Occupancy, Placement, Reduction, Scene, UpAxis};

use super::scenes::{Numbers, scale, smallest, two_scales};
use super::surgery::{File, Part};

pub(crate) const F32: EncodeOptions = EncodeOptions { factors: FactorEncoding::F32, zstd_level: 9 };
pub(crate) const F16: EncodeOptions = EncodeOptions { factors: FactorEncoding::F16, zstd_level: 9 };

/// All factors and weights as bits: tells 0 from −0.
fn bits(scene: &Scene) -> Vec<u32> {
    let scales = scene.scales.iter();
    let of_scales = scales.flat_map(|s| [&s.factors.density, &s.factors.appearance, &s.appearance_matrix.weights]);
    let of_layers = scene.decoder.layers.iter().flat_map(|l| [&l.weights, &l.bias]);
    of_scales.chain(of_layers).flatten().map(|v| v.to_bits()).collect()
}

fn same(a: &Scene, b: &Scene) -> bool {
    a == b && bits(a) == bits(b)
}

fn comes_back(scene: &Scene) -> bool {
    same(&decode(&encode(scene, &F32).unwrap()).unwrap(), scene)
}

#[test]
fn the_comparison_sees_the_sign_of_zero_and_the_last_bit() {
    let scene = two_scales();
    let mut sign = scene.clone();
    sign.scales[0].factors.density[3] = 0.0;
    let mut last_bit = scene.clone();
    let value = &mut last_bit.scales[1].factors.appearance[0];
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
    let changes: [fn(&mut Scene); 11] = [
        |s| s.rules.coverage = Coverage::Any,
        |s| s.rules.aggregation = Aggregation::Clamped,
        |s| s.rules.density_reduction = Reduction::Mean,
        |s| s.rules.appearance_reduction = Reduction::Sum,
        |s| s.frame.up = UpAxis::X,
        |s| s.frame.up = UpAxis::Y,
        |s| s.frame.metres_per_unit = None,
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
        let before = encode(&scene, &F32).unwrap();
        change(&mut scene);
        assert_ne!(encode(&scene, &F32).unwrap(), before);
        assert!(comes_back(&scene));
    }
}

#[test]
fn f16_scenes_come_back_rounded_and_all_else_exact() {
    let scene = two_scales();
    let mut rounded = scene.clone();
    for scale in &mut rounded.scales {
        for values in [&mut scale.factors.density, &mut scale.factors.appearance] {
            values.iter_mut().for_each(|v| *v = f16::from_f32(*v).to_f32());
        }
    }
    let decoded = decode(&encode(&scene, &F16).unwrap()).unwrap();
    assert!(same(&decoded, &rounded));
    assert!(!same(&decoded, &scene));
}

#[test]
fn bytes_are_canonical() {
    for options in [F32, F16] {
        for scene in [two_scales(), smallest()] {
            let file = encode(&scene, &options).unwrap();
            assert_eq!(encode(&decode(&file).unwrap(), &options).unwrap(), file);
        }
    }
    assert_ne!(encode(&two_scales(), &F32).unwrap(), encode(&two_scales(), &F16).unwrap());
}

#[test]
fn bodies_are_compressed_where_it_helps() {
    let mut scene = smallest();
    let cells = (0..2000).map(|n| UVec3::new(n % 37, n / 37 % 11, n / 407)).collect();
    let lattice = Lattice { origin: DVec3::splat(-0.7), pitch: DVec3::splat(0.01) };
    let placement = Placement::Lattice { lattice, cells };
    let mut numbers = Numbers(3);
    scene.scales[0] = scale(&mut numbers, placement, DVec3::splat(0.02), [2, 2, 2], [1, 1]);
    let all = scene.scales[0].factors.density.len();
    scene.scales[0].factors.density[all / 2..].fill(0.25);
    assert!(comes_back(&scene));
    let file = encode(&scene, &F32).unwrap();
    let contents = sections(&file).unwrap();
    let of = |kind| contents.sections.iter().find(|s| s.kind == kind).unwrap();
    for kind in [SectionKind::Placement, SectionKind::Factors] {
        assert_eq!(of(kind).codec, Codec::Zstd, "{kind}");
        assert!(of(kind).length < of(kind).decoded_length);
    }
    assert!(of(SectionKind::Placement).length < 200, "runs of cells take next to nothing");
    assert_eq!(of(SectionKind::Decoder).codec, Codec::Stored);
}

#[test]
fn what_expands_more_than_a_reader_allows_is_stored() {
    let mut scene = smallest();
    let bounds = Aabb { min: DVec3::NEG_ONE, max: DVec3::ONE };
    for (vertices, codec) in [([512, 512, 1000], Codec::Zstd), ([512, 512, 1100], Codec::Stored)] {
        scene.occupancy = Some(Occupancy::empty(bounds, UVec3::from_array(vertices)));
        let file = encode(&scene, &F32).unwrap();
        let contents = sections(&file).unwrap();
        let occupancy = contents.sections.iter().find(|s| s.kind == SectionKind::Occupancy).unwrap();
        assert_eq!(occupancy.codec, codec);
        assert_eq!(decode(&file).unwrap(), scene);
    }
}

#[test]
fn sections_are_listed_from_the_start_of_a_file() {
    let file = encode(&two_scales(), &F16).unwrap();
    let contents = sections(&file[..32 + 48 * 11]).unwrap();
    assert_eq!(contents.file_length, file.len() as u64);
    assert_eq!(contents.version.to_string(), "1.0");
    let names: Vec<_> = contents.sections.iter().map(ToString::to_string).collect();
    let expected = [
        "FRAME",
        "RULES",
        "PROVENANCE",
        "DECODER",
        "OCCUPANCY",
        "PLACEMENT of scale 0",
        "APPEARANCE of scale 0",
        "FACTORS of scale 0",
        "PLACEMENT of scale 1",
        "APPEARANCE of scale 1",
        "FACTORS of scale 1",
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
    let mut file = File::of(&encode(&scene, &F32).unwrap());
    file.minor = 7;
    file.sections.insert(0, Part::ancillary("THUMBNAIL", b"not a picture"));
    let mut strange = Part::ancillary("X-1", b"");
    (strange.scale, strange.codec, strange.decoded_length) = (900, 77, u64::MAX);
    file.sections.push(strange);
    let bytes = file.bytes();
    assert!(same(&decode(&bytes).unwrap(), &scene));
    let contents = sections(&bytes).unwrap();
    assert_eq!((contents.version.minor, contents.sections.len()), (7, 13));
    assert_eq!(contents.sections[12].to_string(), "X-1 of scale 900");
}

#[test]
fn a_file_may_lack_its_provenance() {
    let scene = two_scales();
    let mut file = File::of(&encode(&scene, &F32).unwrap());
    file.sections.remove(file.index("PROVENANCE"));
    assert_eq!(decode(&file.bytes()).unwrap(), Scene { provenance: Default::default(), ..scene });
}
