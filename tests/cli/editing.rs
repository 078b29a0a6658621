//! Edits of files by `strivec-pack`: what an edit does not change stays as it is, bit for bit.

use crate::{command, scenes};

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use serde_json::Value;
use strivec_field::render::ReferenceRenderer;
use strivec_format::container::{
    Codec, EncodeOptions, Encoding, Limits, Metadata, SceneFile, SectionKind, UnknownSection, decode_scene_file,
    encode_scene_file, first_scales, sections,
};
use strivec_format::model::{Block, Scale};
use strivec_measure::{check_probes, probe_density_error};
use tempfile::TempDir;

fn fixtures() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("fixtures/v1")
}

/// Standard error of a run that succeeds.
#[track_caller]
fn succeed(folder: &Path, arguments: &[&str]) -> String {
    let output = command::pack(folder, arguments);
    let message = command::text(&output.stderr);
    assert_eq!(command::code(&output), 0, "{arguments:?}: {message}");
    message
}

fn open(path: &Path) -> (SceneFile, Vec<u8>) {
    let bytes = fs::read(path).unwrap();
    let file = decode_scene_file(&bytes, Limits::default());
    (file.unwrap_or_else(|e| panic!("{}: {e}", path.display())), bytes)
}

/// Name, codec and payload of each section of a file.
fn payloads(bytes: &[u8]) -> Vec<(String, Codec, Vec<u8>)> {
    let all = sections(bytes).unwrap().sections;
    let payload =
        |s: &strivec_format::container::Section| bytes[s.offset as usize..(s.offset + s.length) as usize].to_vec();
    all.iter().map(|s| (s.to_string(), s.codec, payload(s))).collect()
}

/// The sections that differ between two files, or are in one of them.
fn changed(before: &[u8], after: &[u8]) -> Vec<String> {
    let (before, after) = (payloads(before), payloads(after));
    let lacks = |of: &[(String, Codec, Vec<u8>)], other: &[(String, Codec, Vec<u8>)]| -> Vec<String> {
        of.iter().filter(|s| !other.contains(s)).map(|s| s.0.clone()).collect()
    };
    let mut names = lacks(&before, &after);
    names.extend(lacks(&after, &before));
    names.sort();
    names.dedup();
    names
}

/// A folder with the file `packed.strivec`: a lossy pack with a section of every kind in chunks of 20 tensors.
fn packed() -> (TempDir, SceneFile, Vec<u8>) {
    static PACKED: OnceLock<Vec<u8>> = OnceLock::new();
    let bytes = PACKED.get_or_init(pack).clone();
    let folder = TempDir::new().unwrap();
    fs::write(folder.path().join("packed.strivec"), &bytes).unwrap();
    (folder, decode_scene_file(&bytes, Limits::default()).unwrap(), bytes)
}

fn pack() -> Vec<u8> {
    let folder = TempDir::new().unwrap();
    let mut config = scenes::config();
    config.model.density_shift = -4.0;
    config.optimizer.factor_deviation = 0.8;
    let mut scene = scenes::scene(&config);
    scene.occupancy = Some(scenes::sliced(scene.bounds.grown(glam::DVec3::splat(0.0345))));
    let metadata = Metadata {
        license: Some("CC0".into()),
        notes: [("author".to_owned(), "me".to_owned())].into(),
        cameras: vec![scenes::training_camera()],
        ..Metadata::default()
    };
    let bytes = encode_scene_file(&scene, &metadata, &EncodeOptions::uniform(Encoding::F32)).unwrap();
    let path = folder.path().join("packed.strivec");
    fs::write(folder.path().join("scene.strivec"), bytes).unwrap();
    let pack = ["pack", "scene.strivec", "-o", "packed.strivec", "--quality", "small", "--effort", "0.02"];
    succeed(folder.path(), &[&pack[..], &["--chunk-tensors", "20"]].concat());
    let (mut file, bytes) = open(&path);
    let mut section = sections(&bytes).unwrap().sections.pop().unwrap();
    let payload = b"kept as it is".to_vec();
    section.kind = SectionKind::Other(*b"X-TEST\0\0\0\0\0\0");
    (section.critical, section.scale, section.chunk, section.codec) = (false, None, None, Codec::Stored);
    (section.offset, section.length, section.decoded_length) = (0, payload.len() as u64, payload.len() as u64);
    section.checksum = crc32fast::hash(&payload);
    file.metadata.unknown.push(UnknownSection { section, payload });
    let options = EncodeOptions { zstd_level: Some(19), ..file.encoding.clone() };
    fs::write(&path, encode_scene_file(&file.scene, &file.metadata, &options).unwrap()).unwrap();
    let (file, bytes) = open(&path);
    let kinds: Vec<_> = sections(&bytes).unwrap().sections.iter().map(|s| s.kind.to_string()).collect();
    for kind in
        ["QUALITY", "VIEWS", "THUMBNAIL", "LICENCE", "OCCUPANCY", "PREFIX", "PROBES", "CAMERAS", "NOTES", "X-TEST"]
    {
        assert!(kinds.iter().any(|k| k == kind), "{kind} of {kinds:?}");
    }
    assert!(kinds.iter().filter(|k| *k == "PLACEMENT").count() > 2 * file.scene.scales.len(), "{kinds:?}");
    bytes
}

#[test]
fn a_transform_changes_frame_alone() {
    let (folder, before, bytes) = packed();
    fs::create_dir(folder.path().join("out")).unwrap();
    let all = fixtures().join("*.strivec").display().to_string();
    for input in [all.as_str(), "packed.strivec"] {
        let output = ["--force", "transform", input, "-o", "out", "--move=1,-2,3", "--turn", "y", "--scale", "2"];
        let message = succeed(folder.path(), &output);
        // Warnings of sections with codes that this version does not define, which are copied all the same.
        let is_expected = |line: &str| line.contains("newer-codes.strivec: section ") && line.contains(" is skipped: ");
        assert!(message.lines().all(is_expected), "{message}");
        assert_eq!(message.is_empty(), input == "packed.strivec");
    }
    let files = fs::read_dir(fixtures()).unwrap().map(|entry| entry.unwrap().path());
    for path in files.chain([folder.path().join("packed.strivec")]) {
        let name = path.file_name().unwrap();
        let (original, moved) = (fs::read(&path).unwrap(), fs::read(folder.path().join("out").join(name)).unwrap());
        assert_eq!(original.len(), moved.len(), "{name:?}");
        assert_eq!(changed(&original, &moved), ["FRAME"], "{name:?}");
        let order = |bytes: &[u8]| payloads(bytes).into_iter().map(|s| s.0).collect::<Vec<_>>();
        assert_eq!(order(&original), order(&moved), "{name:?}");
        assert_eq!(sections(&original).unwrap().version, sections(&moved).unwrap().version, "{name:?}");
    }
    let (moved, _) = open(&folder.path().join("out/packed.strivec"));
    assert_eq!(moved.metadata, before.metadata);
    let at = glam::DVec3::new(0.3, 0.2, 0.1);
    let (map, after) = (before.scene.frame.model_from_dataset, moved.scene.frame.model_from_dataset);
    // A quarter turn about y takes (x, y, z) to (z, y, -x).
    let there = 2.0 * glam::DVec3::new(at.z, at.y, -at.x) + glam::DVec3::new(1.0, -2.0, 3.0);
    assert!(map.point(at).distance(after.point(there)) < 1e-12, "{:?}, {:?}", map.point(at), after.point(there));

    succeed(folder.path(), &["transform", "packed.strivec", "-o", "same.strivec", "--move", "0,0,0"]);
    assert!(fs::read(folder.path().join("same.strivec")).unwrap() == bytes, "no move changes nothing");
}

#[test]
fn a_crop_of_everything_and_a_conversion_to_the_same_copy_every_section() {
    let (folder, _, bytes) = packed();
    fs::create_dir(folder.path().join("out")).unwrap();
    let all = fixtures().join("*.strivec").display().to_string();
    let everything = "--box=-1e6,-1e6,-1e6,1e6,1e6,1e6";
    for edit in [&["crop", everything][..], &["convert"], &["convert", "--encoding", "keep"], &["prune", "--error=-1"]]
    {
        let (command, options) = edit.split_first().unwrap();
        let message = succeed(folder.path(), &[&["--force", command, "packed.strivec", "-o", "out"], options].concat());
        assert!(!message.contains("probe"), "{message}");
        assert!(fs::read(folder.path().join("out/packed.strivec")).unwrap() == bytes, "{edit:?}");
        if *command == "prune" {
            continue;
        }
        succeed(folder.path(), &[&["--force", command, &all, "-o", "out"], options].concat());
        for path in fs::read_dir(fixtures()).unwrap().map(|entry| entry.unwrap().path()) {
            let name = path.file_name().unwrap().to_str().unwrap();
            let edited = fs::read(folder.path().join("out").join(name)).unwrap();
            let changed = changed(&fs::read(&path).unwrap(), &edited);
            if name == "newer-codes.strivec" {
                // Sections with codes that this version does not define are left out.
                let ancillary = [
                    "THUMBNAIL",
                    "NOTES",
                    "PREFIX of scale 0",
                    "CAMERAS",
                    "PROVENANCE",
                    "PROBES",
                    "QUALITY",
                    "VIEWS",
                    "LICENCE",
                ];
                assert!(changed.iter().all(|section| ancillary.contains(&section.as_str())), "{changed:?}");
            } else if name == "zstd-of-nothing.strivec" {
                // Sections without entries are left out.
                assert_eq!(changed, ["CAMERAS", "NOTES"]);
            } else {
                assert_eq!(changed, [""; 0], "{name} {edit:?}");
            }
        }
    }
}

/// The factors of a scale's tensors by the bits of their centers.
fn tensors(scale: &Scale) -> std::collections::BTreeMap<[u64; 3], (Vec<u32>, Vec<u32>)> {
    let factors = &scale.factors;
    let of = |block: &Block, n: usize| -> Vec<u32> {
        let length = block.tensor_len(scale.cloud.resolution);
        block.values[n * length..][..length].iter().map(|v| v.to_bits()).collect()
    };
    let tensor = |n: usize| {
        let key = scale.cloud.center(n).to_array().map(f64::to_bits);
        (key, (of(&factors.density[0], n), of(&factors.appearance[0], n)))
    };
    (0..scale.cloud.len()).map(tensor).collect()
}

#[test]
fn a_crop_keeps_the_numbers_and_encodings_of_what_is_left() {
    let (folder, before, bytes) = packed();
    let message = succeed(folder.path(), &["crop", "packed.strivec", "-o", "half.strivec", "--box=-2,-2,-2,0.3,2,2"]);
    let (after, half) = open(&folder.path().join("half.strivec"));
    assert!(half.len() < bytes.len(), "{} of {}", half.len(), bytes.len());
    for (s, (before_scale, scale)) in before.scene.scales.iter().zip(&after.scene.scales).enumerate() {
        assert!(scale.cloud.len() < before_scale.cloud.len() || s == 0, "scale {s}");
        let all = tensors(before_scale);
        assert!(tensors(scale).iter().all(|(center, factors)| all.get(center) == Some(factors)), "scale {s}");
        let arrays = |file: &SceneFile| [file.encoding.density[s].array, file.encoding.appearance[s].array];
        assert_eq!(arrays(&before), arrays(&after));
        // Steps are those of the tensors that are left.
        let steps = |file: &SceneFile, scale: &Scale| {
            let steps = file.encoding.density[s].steps.clone().expect("integers").concat();
            let rank = scale.factors.density_rank() as usize;
            let of =
                |n: usize| (scale.cloud.center(n).to_array().map(f64::to_bits), steps[n * rank..][..rank].to_vec());
            (0..scale.cloud.len()).map(of).collect::<std::collections::BTreeMap<_, _>>()
        };
        let all = steps(&before, before_scale);
        assert!(steps(&after, scale).iter().all(|(center, steps)| all.get(center) == Some(steps)), "scale {s}");
        // The tensors of a chunk stay together.
        let largest = |file: &SceneFile| {
            let of = |chunk: u32| file.encoding.chunks[s].iter().filter(|c| **c == chunk).count();
            file.encoding.chunks[s].iter().map(|&chunk| of(chunk)).max()
        };
        assert!(largest(&after) <= largest(&before));
    }
    let codec = |bytes: &[u8]| -> std::collections::BTreeSet<_> {
        payloads(bytes).iter().map(|s| format!("{} {}", s.0.split(' ').next().unwrap_or_default(), s.1)).collect()
    };
    assert!(codec(&half).is_subset(&codec(&bytes)), "{:?}", codec(&half));
    let same = [
        "LICENCE",
        "VIEWS",
        "THUMBNAIL",
        "DECODER",
        "OCCUPANCY",
        "CAMERAS",
        "NOTES",
        "X-TEST",
        "PREFIX of scale 0",
        "MATRIX of scale 1",
    ];
    let (all, left) = (payloads(&bytes), payloads(&half));
    for name in same {
        let section = all.iter().find(|s| s.0 == name).unwrap();
        assert!(left.contains(section), "{name}");
    }
    assert_eq!(after.metadata.quality, None);

    // Probes that the crop does not touch.
    let (probes, left) = (before.metadata.probes.unwrap(), after.metadata.probes.clone().expect("some probes"));
    assert!(left.probes.len() > 4 && left.probes.len() < probes.probes.len(), "{}", left.probes.len());
    assert!(message.contains(&format!("{} of {} probes kept", left.probes.len(), probes.probes.len())), "{message}");
    for probe in &left.probes {
        let original = probes.probes.iter().find(|p| p.origin == probe.origin).expect("a probe of the file");
        assert!(probe.margin <= original.margin);
        assert_eq!(strivec_format::container::Probe { margin: original.margin, ..*probe }, *original);
    }
    let report = check_probes(&ReferenceRenderer::new(&after.scene), &left);
    assert_eq!(report.failed, 0, "{report:?}");
    assert!(probe_density_error(&after.scene, &left) < 1e-9);
}

#[test]
fn other_chunks_and_levels_change_no_number() {
    let (folder, packed_file, packed_bytes) = packed();
    fs::create_dir(folder.path().join("out")).unwrap();
    let again = |name: &str, input: &Path, options: &[&str]| {
        let (input, output) = (input.display().to_string(), format!("out/{name}"));
        let message = succeed(folder.path(), &[&["--force", "convert", &input, "-o", &output], options].concat());
        assert!(!message.contains("probe"), "{message}");
        open(&folder.path().join(output))
    };
    let files = fs::read_dir(fixtures()).unwrap().map(|entry| entry.unwrap().path());
    for path in files.chain([folder.path().join("packed.strivec")]) {
        let name = path.file_name().unwrap().to_str().unwrap();
        let (before, bytes) = open(&path);
        let (cut, cut_bytes) = again(name, &path, &["--encoding", "keep", "--chunk-tensors", "3"]);
        let as_before = |after: &SceneFile| {
            assert_eq!(after.scene, before.scene, "{name}");
            let skipped = Metadata { skipped: Vec::new(), ..before.metadata.clone() };
            assert_eq!(after.metadata, skipped, "{name}");
            let plain = |file: &SceneFile| EncodeOptions { chunks: Vec::new(), ..file.encoding.clone() };
            let filters = |mut options: EncodeOptions| {
                options
                    .density
                    .iter_mut()
                    .chain(&mut options.appearance)
                    .for_each(|f| f.array.filter = Default::default());
                options.networks.filter = Default::default();
                options
            };
            assert_eq!(filters(plain(after)), filters(plain(&before)), "{name}");
        };
        as_before(&cut);
        assert_eq!(cut.encoding.density, before.encoding.density, "{name}: with filters");
        for section in changed(&bytes, &cut_bytes) {
            let kind = section.split(' ').next().unwrap();
            let of_chunks = ["SCALE", "PLACEMENT", "DENSITY", "APPEARANCE"].contains(&kind);
            let is_empty = name == "zstd-of-nothing.strivec" && ["CAMERAS", "NOTES"].contains(&kind);
            assert!(of_chunks || is_empty || name == "newer-codes.strivec", "{name}: {section}");
        }
        let (_, twice) = again("twice.strivec", &folder.path().join("out").join(name), &["--chunk-tensors", "3"]);
        assert!(twice == cut_bytes, "{name}");
        for level in ["0", "3"] {
            as_before(&again(name, &path, &["--level", level]).0);
        }
    }
    // There and back gives the file, but for the errors that its arrays state.
    let (back, bytes) = again("back.strivec", &folder.path().join("out/packed.strivec"), &["--chunk-tensors", "20"]);
    assert_eq!((back.scene, back.encoding), (packed_file.scene, packed_file.encoding));
    assert_eq!(bytes.len(), packed_bytes.len());
}

#[test]
fn converting_to_the_encoding_that_numbers_have_changes_none() {
    let folder = TempDir::new().unwrap();
    for (fixture, encoding) in [
        ("grid-16", "grid16"),
        ("grid-8", "grid8"),
        ("grid-6", "grid6"),
        ("grid-3", "grid3"),
        ("f16", "f16"),
        ("f32", "f32"),
        ("integers-adaptive", "grid16"),
        ("networks-grid", "f32"),
    ] {
        let path = fixtures().join(format!("{fixture}.strivec"));
        let (before, bytes) = open(&path);
        let text = path.display().to_string();
        let message = succeed(folder.path(), &["--force", "convert", &text, "-o", "x.strivec", "--encoding", encoding]);
        let (after, same) = open(&folder.path().join("x.strivec"));
        if before.encoding.density.iter().all(|f| f.array.encoding == after.encoding.density[0].array.encoding) {
            assert!(bytes == same, "{fixture}");
            assert_eq!(message, "", "{fixture}");
        }
        assert_eq!(before.scene.decoder, after.scene.decoder, "{fixture}");
    }
}

#[test]
fn a_lossy_conversion_drops_what_no_longer_holds() {
    let (folder, before, _) = packed();
    let message = succeed(folder.path(), &["convert", "packed.strivec", "-o", "coarse.strivec", "--encoding", "grid3"]);
    let (after, bytes) = open(&folder.path().join("coarse.strivec"));
    assert!(message.contains("probes kept"), "{message}");
    assert_eq!(after.metadata.quality, None);
    assert_eq!(after.metadata.prefixes, before.metadata.prefixes);
    assert_eq!(after.scene.decoder, before.scene.decoder);
    let probes = after.metadata.probes.map_or(0, |probes| probes.probes.len());
    assert!(probes < before.metadata.probes.unwrap().probes.len());
    assert!(payloads(&bytes).iter().any(|s| s.0 == "X-TEST"));
    succeed(folder.path(), &["verify", "--render", "coarse.strivec"]);
}

#[test]
fn pruning_changes_the_chunks_that_lose_components() {
    let (folder, before, bytes) = packed();
    succeed(folder.path(), &["prune", "packed.strivec", "-o", "pruned.strivec", "--error", "1e-9"]);
    let (after, pruned) = open(&folder.path().join("pruned.strivec"));
    assert!(pruned.len() < bytes.len());
    for (before, after) in before.scene.scales.iter().zip(&after.scene.scales) {
        let pairs = before.factors.density[0].values.iter().zip(&after.factors.density[0].values);
        assert!(pairs.into_iter().all(|(b, a)| a == b || *a == 0.0));
    }
    let arrays = |file: &SceneFile| file.encoding.density.iter().map(|f| f.array).collect::<Vec<_>>();
    assert_eq!((arrays(&before), &before.encoding.chunks), (arrays(&after), &after.encoding.chunks));
    let kinds = changed(&bytes, &pruned);
    let touched = ["DENSITY", "APPEARANCE", "QUALITY", "PROBES"];
    assert!(kinds.iter().all(|k| touched.contains(&k.split(' ').next().unwrap())), "{kinds:?}");
}

#[test]
fn corrections_of_fewer_scales_hold_for_the_corrected_scene() {
    let (folder, before, _) = packed();
    let scales = before.scene.scales.len();
    assert!(scales > 2);
    succeed(folder.path(), &["crop", "packed.strivec", "-o", "two.strivec", "--scales", "2"]);
    let (two, _) = open(&folder.path().join("two.strivec"));
    assert_eq!(two.metadata.prefixes.len(), 2);
    let coarsest = |file: &SceneFile| first_scales(file.scene.clone(), &file.metadata.prefixes, Some(1));
    let (expected, found) = (coarsest(&before), coarsest(&two));
    assert!((expected.rules.density_shift - found.rules.density_shift).abs() < 1e-12);
    let (expected, found) = (&expected.scales[0], &found.scales[0]);
    assert_eq!(expected.appearance_matrix, found.appearance_matrix);
    for (e, f) in expected.factors.density[0].values.iter().zip(&found.factors.density[0].values) {
        assert!((e - f).abs() <= 1e-6 * e.abs(), "{e} and {f}");
    }
    // What the correction does not change stays as integers.
    let (density, appearance) = (&two.encoding.density[0], &two.encoding.appearance[0]);
    assert_eq!((density.array.encoding, appearance), (Encoding::F32, &before.encoding.appearance[0]));
}

#[test]
fn notes_are_compressed_as_the_file_is() {
    let (folder, _, bytes) = packed();
    let long = format!("text={}", "a long note ".repeat(400));
    succeed(folder.path(), &["notes", "packed.strivec", "--set", &long, "-o", "noted.strivec"]);
    let noted = fs::read(folder.path().join("noted.strivec")).unwrap();
    assert_eq!(changed(&bytes, &noted), ["NOTES"]);
    assert!(noted.len() < bytes.len() + 256, "{} and {}", noted.len(), bytes.len());
    let schema: Value = serde_json::from_slice(&command::pack(folder.path(), &["schema"]).stdout).unwrap();
    assert!(schema["$defs"]["transform"].is_object());
}
