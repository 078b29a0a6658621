//! One file for each way in which a file can be wrong, its checksums right.

use strivec_format::container::{
    ArrayOptions, EncodeOptions, Encoding, Error, Filter, Limits, SectionKind, SkippedSection, decode,
    decode_scene_file, encode, encode_scene_file, sections, with_notes,
};
use strivec_format::model::{Placement, Provenance, Scene, Sky};

use super::roundtrip::{f16, f32, plain};
use super::scenes::{metadata, smallest, two_scales};
use super::surgery::{File, Part, name, seal, seal_header};

/// Offset of a body behind a record of at most 64 bytes.
const BODY: usize = 64;
/// Offset of the body of SCALE.
const CHUNKS: usize = 128;

/// The error of a file after `change`.
fn refused(change: impl FnOnce(&mut File)) -> Error {
    let mut file = File::of(&encode(&two_scales(), &f32()).unwrap());
    assert!(decode(&file.bytes()).is_ok(), "the file is right before the change");
    change(&mut file);
    decode(&file.bytes()).expect_err("the file is wrong")
}

/// The error of a file whose section is patched.
fn patched(kind: &str, at: usize, bytes: &[u8]) -> Error {
    refused(|f| f.part(kind).patch(at, bytes))
}

#[track_caller]
fn malformed(error: Error, at: &str) {
    match &error {
        Error::Malformed(invalid) if invalid.place.to_string().contains(at) => (),
        _ => panic!("expected something malformed at {at:?}, not: {error}"),
    }
}

#[track_caller]
fn limit(error: Error, at: &str) {
    match &error {
        Error::Limit { place, .. } if place.contains(at) => (),
        _ => panic!("expected a limit at {at:?}, not: {error}"),
    }
}

#[track_caller]
fn unsupported(error: Error, at: &str) {
    match &error {
        Error::Unsupported { place, .. } if place.contains(at) => (),
        _ => panic!("expected something unsupported at {at:?}, not: {error}"),
    }
}

#[track_caller]
fn broken(error: Error, at: &str) {
    match &error {
        Error::Scene(invariant) if invariant.place.to_string().contains(at) => (),
        _ => panic!("expected a broken invariant at {at:?}, not: {error}"),
    }
}

#[test]
fn not_strivec() {
    for bytes in [b"PK\x03\x04".as_slice(), b"\x89PNG\r\n\x1A\n", b"glTF....", b"\xB3STV, but not", &[0; 4096]] {
        assert!(matches!(decode(bytes), Err(Error::NotStrivec { .. })), "{bytes:02x?}");
    }
}

#[test]
fn other_major_versions() {
    for major in [0, 2, 0xFFFF] {
        let error = refused(|f| f.major = major);
        assert!(matches!(error, Error::UnsupportedVersion { found, supported: 1 } if found.major == major));
    }
}

#[test]
fn unknown_critical_section() {
    let error = refused(|f| {
        f.sections.push(Part { flags: 1, scale: 1, ..Part::ancillary("WAVELETS", b"") });
    });
    assert_eq!(error, Error::UnknownCritical { name: "WAVELETS of scale 1".into() });
}

/// The writer refuses what the reader refuses.
#[test]
fn integers_have_no_planes() {
    let mut options = f32();
    options.networks = ArrayOptions { encoding: Encoding::Grid(16), filter: Filter::Planes };
    malformed(encode(&two_scales(), &options).expect_err("refused"), "filter");
}

#[test]
fn names_flags_and_reserved_fields() {
    for bad in ["", "frame", "A B", "A\0B"] {
        malformed(
            refused(|f| f.sections.push(Part { kind: name(bad), ..Part::ancillary("", b"") })),
            "name of section",
        );
    }
    unsupported(refused(|f| f.part("FRAME").flags = 3), "FRAME flags");
    malformed(refused(|f| f.part("FRAME").flags = 0), "FRAME flags");
    malformed(refused(|f| f.part("PROVENANCE").flags = 1), "PROVENANCE flags");
    unsupported(refused(|f| f.part("RULES").reserved = 1), "RULES flags or reserved bytes");
    unsupported(patched("SCALE", 46, &[1]), "SCALE of scale 0 reserved");
    unsupported(patched("DENSITY", 1, &[1]), "reserved");
    unsupported(patched("DENSITY", 11, &[1]), "reserved");
    malformed(patched("DENSITY", 20, &[1]), "padding before the body");
    let mut header = encode(&two_scales(), &f32()).unwrap();
    header[40] = 1;
    seal_header(&mut header);
    unsupported(decode(&header).unwrap_err(), "header reserved");
    malformed(refused(|f| f.part("RULES").decoded_length += 1), "RULES decoded length");
}

#[test]
fn sections_missing_doubled_or_out_of_order() {
    for kind in ["FRAME", "RULES", "DECODER", "SCALE", "MATRIX", "DENSITY", "APPEARANCE"] {
        let error = refused(|f| {
            f.sections.remove(f.index(kind));
        });
        assert!(matches!(&error, Error::MissingSection { name } if name.starts_with(kind)), "{error}");
        let error = refused(|f| {
            let twice = f.part(kind).clone();
            f.sections.insert(f.index(kind), twice);
        });
        malformed(error, if kind == "APPEARANCE" { "chunks" } else { "next section" });
    }
    malformed(refused(|f| f.sections.swap(0, 1)), "next section");
    malformed(refused(|f| f.sections.push(f.sections[17].clone())), "next section");
    // Chunks are counted.
    let error = refused(|f| {
        let first = f.index("PLACEMENT");
        f.sections.drain(first + 3..first + 6);
    });
    assert_eq!(error, Error::MissingSection { name: "PLACEMENT of chunk 1 of scale 0".into() });
    malformed(refused(|f| f.part("FRAME").scale = 0), "section FRAME");
    malformed(refused(|f| f.part("FRAME").chunk = 0), "section FRAME");
    malformed(refused(|f| f.part("SCALE").scale = 0xFFFF), "section SCALE");
    malformed(refused(|f| f.part("DENSITY").chunk = 0xFFFF_FFFF), "section DENSITY");
}

#[test]
fn gaps_overlaps_and_unclaimed_bytes() {
    let file = encode(&two_scales(), &f32()).unwrap();
    let sealed = |at: usize, value: u64| {
        let mut bytes = file.clone();
        bytes[at..at + 8].copy_from_slice(&value.to_le_bytes());
        seal(&mut bytes);
        decode(&bytes).unwrap_err()
    };
    let (offset, length) = (64 + 64 + 32, 64 + 64 + 40);
    let second = u64::from_le_bytes(file[offset..offset + 8].try_into().unwrap());
    for wrong in [second + 64, second - 64, second + 1, 0, u64::MAX] {
        malformed(sealed(offset, wrong), "RULES offset");
    }
    malformed(sealed(length + 8, 0), "RULES decoded length");
    let mut unstored = File::of(&file);
    unstored.part("RULES").codec = 1;
    let bytes = unstored.bytes();
    for wrong in [u64::MAX, u64::MAX - 70] {
        let mut bytes = bytes.clone();
        bytes[length..length + 8].copy_from_slice(&wrong.to_le_bytes());
        seal(&mut bytes);
        assert!(matches!(decode(&bytes), Err(Error::Malformed { .. })));
    }
    malformed(sealed(16, file.len() as u64 + 1), "file length");
    malformed(decode(&[file.as_slice(), &[0]].concat()).unwrap_err(), "bytes in the file");
    let mut padded = file.clone();
    padded[second as usize - 1] = 1;
    assert!(matches!(decode(&padded), Err(Error::Corrupt { section, .. }) if section == "file"));
    seal(&mut padded);
    malformed(decode(&padded).unwrap_err(), "padding before RULES");
}

#[test]
fn section_counts() {
    let mut file = encode(&two_scales(), &f32()).unwrap();
    for count in [0, 65_537, u32::MAX] {
        file[12..16].copy_from_slice(&count.to_le_bytes());
        seal_header(&mut file);
        limit(decode(&file).unwrap_err(), "section count");
    }
}

#[test]
fn records_of_the_wrong_length() {
    for kind in ["FRAME", "RULES", "DECODER", "OCCUPANCY", "SCALE", "MATRIX", "PLACEMENT", "DENSITY", "APPEARANCE"] {
        for change in
            [|p: &mut Vec<u8>| p.truncate(p.len() - 1), |p: &mut Vec<u8>| p.push(0), |p: &mut Vec<u8>| p.clear()]
        {
            malformed(
                refused(|f| {
                    let mut payload = f.part(kind).payload.clone();
                    change(&mut payload);
                    f.part(kind).set(payload);
                }),
                kind,
            );
        }
    }
}

#[test]
fn codecs() {
    for kind in ["FRAME", "RULES"] {
        malformed(refused(|f| f.part(kind).compress(0)), "codec");
    }
    for kind in ["FRAME", "RULES", "DENSITY"] {
        malformed(refused(|f| f.part(kind).codec = 2), "codec");
    }
    unsupported(refused(|f| f.part("DENSITY").codec = 3), "DENSITY");
}

#[test]
fn codes_that_this_version_does_not_define() {
    unsupported(patched("FRAME", 100, &[6]), "up axis");
    unsupported(patched("FRAME", 101, &[1]), "color space");
    unsupported(patched("RULES", 2, &[2]), "coverage");
    unsupported(patched("RULES", 3, &[2]), "aggregation");
    unsupported(patched("RULES", 4, &[2]), "density reduction");
    unsupported(patched("RULES", 5, &[2]), "appearance reduction");
    unsupported(patched("RULES", 6, &[2]), "contraction");
    for degree in [5, 6, 255] {
        unsupported(patched("RULES", 7, &[degree]), "RULES sky");
    }
    unsupported(patched("DECODER", 0, &[3]), "mode");
    // Too few features for colors of the samples' own.
    broken(patched("DECODER", 0, &[2]), "features");
    unsupported(patched("SCALE", 44, &[2]), "factor kind");
    unsupported(patched("SCALE", 45, &[2]), "placement");
    unsupported(patched("DENSITY", 0, &[2]), "components");
    // Codes come before other faults of the same section.
    unsupported(patched("RULES", 0, &[0, 0, 2]), "coverage");
    unsupported(refused(|f| f.part("SCALE").set([&[0; 44][..], &[2; 80]].concat())), "factor kind");
    unsupported(patched("DECODER", 0, &[3, 99]), "mode");
    unsupported(patched("DECODER", 0, &[3, 0, 0, 0, 0, 0, 0, 0, 0, 99]), "mode");
    unsupported(refused(|f| f.part("MATRIX").set([&[0; 8][..], &[0, 0, 2, 0]].concat())), "filter");
    for (kind, head) in [("DECODER", 33), ("MATRIX", 8), ("DENSITY", 8), ("APPEARANCE", 8)] {
        unsupported(patched(kind, head, &[4]), "encoding");
        unsupported(patched(kind, head + 1, &[7]), "bits");
        unsupported(patched(kind, head + 2, &[2]), "filter");
        malformed(patched(kind, head, &[2, 8, 1]), "filter");
    }
}

#[test]
fn a_sky_has_as_many_finite_coefficients_as_its_degree_says() {
    // Without a sky nothing follows the record.
    let with_tail = |degree: u8, numbers: &[f32]| {
        refused(|f| {
            let rules = f.part("RULES");
            rules.patch(7, &[degree]);
            let tail = numbers.iter().flat_map(|v| v.to_le_bytes());
            rules.set(rules.payload.iter().copied().chain(tail).collect());
        })
    };
    malformed(with_tail(0, &[0.0]), "RULES number of bytes of the sky");
    for degree in 1..=4u8 {
        let count = 3 * (usize::from(degree) + 1).pow(2);
        for wrong in [0, 1, count - 1, count + 1, 75 + 12] {
            malformed(with_tail(degree, &vec![0.5; wrong]), "RULES number of bytes of the sky");
        }
        for (at, value) in [(0, f32::NAN), (count / 2, f32::INFINITY), (count - 1, f32::NEG_INFINITY)] {
            let mut numbers = vec![0.5; count];
            numbers[at] = value;
            broken(with_tail(degree, &numbers), "sky's coefficients");
        }
    }
    // The number of bytes, not of floats, has to be right.
    let error = refused(|f| {
        let rules = f.part("RULES");
        rules.patch(7, &[1]);
        rules.set([rules.payload.as_slice(), &[0; 49]].concat());
    });
    malformed(error, "RULES number of bytes of the sky");
    // A field that ends too early is still one of the record.
    malformed(refused(|f| f.part("RULES").set(vec![0; 100])), "RULES record");
}

/// The writer refuses what the reader refuses.
#[test]
fn skies_that_no_file_can_hold() {
    for (degree, count, at) in [(0, 3, "degree"), (5, 108, "degree"), (2, 12, "number of coefficients")] {
        let mut scene = two_scales();
        scene.rules.sky = Some(Sky { degree, coefficients: vec![0.5; count] });
        broken(encode(&scene, &f32()).expect_err("refused"), at);
    }
    let mut scene = two_scales();
    scene.rules.sky = Some(Sky { degree: 1, coefficients: vec![f32::NAN; 12] });
    broken(encode(&scene, &f32()).expect_err("refused"), "sky's coefficients");
}

#[test]
fn a_contraction_has_its_own_shell_and_bounds() {
    broken(patched("RULES", 6, &[1]), "shell");
    for shell in [-0.4, 1.001, f64::NAN, f64::INFINITY] {
        broken(
            refused(|f| {
                f.part("RULES").patch(6, &[1]);
                f.part("RULES").patch(96, &shell.to_le_bytes());
            }),
            "shell",
        );
    }
    broken(
        refused(|f| {
            f.part("RULES").patch(6, &[1]);
            f.part("RULES").patch(96, &0.4_f64.to_le_bytes());
        }),
        "bounds",
    );
    malformed(patched("RULES", 96, &[1]), "shell of the contraction");
}

#[test]
fn integers_outside_their_grid() {
    let grid = |change: &dyn Fn(&mut Part)| {
        let mut file = File::of(&encode(&two_scales(), &plain(Encoding::Grid(4))).unwrap());
        file.part("DENSITY").inflate(BODY);
        assert!(decode(&file.bytes()).is_ok());
        change(file.part("DENSITY"));
        decode(&file.bytes()).expect_err("the file is wrong")
    };
    // Two tensors of two components: twelve step codes, then the integers.
    for wrong in [8, 0xF8, 0x80] {
        malformed(grid(&|p| p.payload[BODY + 12] = wrong), "integer of group 0");
    }
    malformed(grid(&|p| p.payload[BODY] = 0), "integer of group 0");
}

#[test]
fn components_that_tensors_do_not_have() {
    let ragged = |change: &dyn Fn(&mut Part)| {
        let mut scene = two_scales();
        scene.scales[1].factors.appearance[0].values.iter_mut().step_by(2).for_each(|v| *v = 0.0);
        let mut file = File::of(&encode(&scene, &f32()).unwrap());
        let last = file.sections.last_mut().unwrap();
        last.inflate(BODY);
        assert_eq!(last.payload[BODY..BODY + 2], [2, 2]);
        change(last);
        decode(&file.bytes()).expect_err("the file is wrong")
    };
    malformed(ragged(&|p| p.payload[BODY] = 6), "components");
    malformed(ragged(&|p| p.payload[BODY] = 3), "bytes of the array");
    malformed(ragged(&|p| p.payload[BODY] = 0), "bytes of the array");
    malformed(ragged(&|p| p.payload[0] = 0), "bytes of the array");
}

#[test]
fn numbers_beyond_the_limits() {
    let (zero, most) = (0u32.to_le_bytes(), u32::MAX.to_le_bytes());
    for value in [zero, most] {
        limit(patched("RULES", 0, &value[..2]), "scales");
        limit(patched("SCALE", 0, &value), "tensors");
        limit(patched("SCALE", 4, &value), "top_k");
        limit(patched("SCALE", 36, &value), "resolution");
        limit(patched("SCALE", 48, &value), "density rank");
        limit(patched("SCALE", 52, &value), "appearance rank");
        limit(patched("SCALE", 56, &value), "chunks");
        limit(patched("SCALE", 116, &value), "cells along an axis");
        limit(patched("SCALE", CHUNKS, &value), "tensors");
        limit(patched("MATRIX", 0, &value), "features");
        limit(patched("MATRIX", 4, &value), "rank");
        limit(patched("DECODER", 17, &value), "inputs");
        limit(patched("DECODER", 21, &value), "outputs");
        limit(patched("OCCUPANCY", 52, &value), "vertices of an axis");
    }
    limit(patched("DECODER", 1, &most), "feature frequencies");
    limit(patched("DECODER", 5, &most), "direction frequencies");
    let without_layers = |f: &mut File| {
        let decoder = f.part("DECODER");
        decoder.set([&decoder.payload[..9], &[0; 12]].concat());
    };
    limit(refused(without_layers), "layers");
    limit(patched("DECODER", 9, &[17]), "DECODER");
    limit(patched("DECODER", 9, &u64::MAX.to_le_bytes()), "DECODER");
    limit(patched("RULES", 72, &1e-9_f64.to_le_bytes()), "steps");
    limit(patched("OCCUPANCY", 48, &[4096u32.to_le_bytes(); 3].concat()), "OCCUPANCY vertices");
}

#[test]
fn strings() {
    malformed(skipped("PROVENANCE", |p| p.patch(24, &[0xFF])), "PROVENANCE");
    limit(skipped("PROVENANCE", |p| p.patch(16, &u64::MAX.to_le_bytes())), "PROVENANCE");
    malformed(skipped("PROVENANCE", |p| p.patch(16, &4096u64.to_le_bytes())), "PROVENANCE");
    let longest = [&[0; 16], 4097u64.to_le_bytes().as_slice(), &[b'a'; 4097], &[0; 16]].concat();
    limit(skipped("PROVENANCE", |p| p.set(longest)), "PROVENANCE");
}

/// The error with which an ancillary section of a file that opens is skipped after `change`.
fn skipped(kind: &str, change: impl FnOnce(&mut Part)) -> Error {
    let options = EncodeOptions { zstd_level: None, ..f32() };
    let mut file = File::of(&encode_scene_file(&two_scales(), &metadata(), &options).unwrap());
    change(file.part(kind));
    let read = decode_scene_file(&file.bytes(), Limits::default()).expect("an ancillary section closes no scene");
    let mut whole = two_scales();
    if kind == "PROVENANCE" {
        whole.provenance = Provenance::default();
    }
    assert_eq!(read.scene, whole, "{kind}");
    let [skipped] = read.metadata.skipped.try_into().expect("one section is skipped");
    let SkippedSection { name, error } = skipped;
    assert!(name.starts_with(kind), "{name}");
    error
}

#[test]
fn ancillary_sections_that_cannot_be_used() {
    for kind in ["PROVENANCE", "LICENCE", "QUALITY", "VIEWS", "PREFIX", "PROBES", "CAMERAS", "THUMBNAIL", "NOTES"] {
        unsupported(skipped(kind, |p| p.codec = 3), kind);
        unsupported(skipped(kind, |p| p.flags = 2), kind);
        unsupported(skipped(kind, |p| p.reserved = 1), kind);
        malformed(skipped(kind, |p| p.set(p.payload[..5].to_vec())), kind);
        if kind != "THUMBNAIL" {
            malformed(skipped(kind, |p| p.set([p.payload.as_slice(), &[0]].concat())), kind);
        }
    }
    for kind in ["PROVENANCE", "THUMBNAIL", "PROBES"] {
        malformed(skipped(kind, |p| p.compress(BODY.min(p.payload.len()))), "codec");
    }
    malformed(skipped("LICENCE", |p| p.patch(8, &[0xFF])), "LICENCE");
    for value in [f64::NEG_INFINITY, f64::NAN] {
        broken(skipped("QUALITY", |p| p.patch(0, &value.to_le_bytes())), "QUALITY");
    }
    malformed(skipped("QUALITY", |p| p.patch(24, &1u64.to_le_bytes())), "number of prefixes");
    broken(skipped("VIEWS", |p| p.patch(96, &[2])), "closed");
    limit(skipped("VIEWS", |p| p.patch(97, &65_537u64.to_le_bytes())), "VIEWS");
    unsupported(skipped("THUMBNAIL", |p| p.patch(0, &[2])), "format");
    unsupported(skipped("THUMBNAIL", |p| p.patch(1, &[1])), "reserved");
    unsupported(skipped("PREFIX", |p| p.patch(24, &[4])), "encoding");
    broken(skipped("PREFIX", |p| p.patch(0, &0f64.to_le_bytes())), "gain");
    for value in [-1.0, f64::NAN, f64::INFINITY] {
        broken(skipped("PROBES", |p| p.patch(BODY + 120, &value.to_le_bytes())), "margin");
        broken(skipped("PROBES", |p| p.patch(0, &value.to_le_bytes())), "tolerance");
    }
    unsupported(skipped("PROBES", |p| p.patch(BODY + 143, &[1])), "reserved");
    for value in [0.0, -5.0, f64::NAN, f64::INFINITY] {
        broken(skipped("CAMERAS", |p| p.patch(BODY + 64, &value.to_le_bytes())), "focal length");
    }
    broken(skipped("CAMERAS", |p| p.patch(BODY + 72, &f64::INFINITY.to_le_bytes())), "principal point");
    broken(skipped("CAMERAS", |p| p.patch(BODY + 92, &[0; 4])), "width and height");
    unsupported(skipped("CAMERAS", |p| p.patch(BODY + 96, &[3])), "projection");
    unsupported(skipped("CAMERAS", |p| p.patch(BODY + 103, &[1])), "reserved");
    broken(skipped("CAMERAS", |p| p.patch(BODY + 184, &f64::NAN.to_le_bytes())), "distortion");
    malformed(skipped("NOTES", |p| p.patch(BODY + 8, b"z")), "key");
}

/// With other notes a damaged section is still known as damaged.
#[test]
fn notes_can_be_changed_in_a_file_with_a_damaged_section() {
    let file = encode_scene_file(&two_scales(), &metadata(), &f32()).unwrap();
    let license = sections(&file).unwrap().sections.iter().find(|s| s.kind == SectionKind::License).unwrap().offset;
    let mut damaged = file;
    damaged[license as usize + 10] ^= 1;
    let changed = with_notes(&damaged, &[("a".into(), "b".into())].into()).unwrap();
    let read = decode_scene_file(&changed, Limits::default()).unwrap().metadata;
    assert_eq!(read.notes["a"], "b");
    assert!(matches!(&read.skipped[..], [SkippedSection { error: Error::Corrupt { .. }, .. }]), "{:?}", read.skipped);
    let mut newer = File::of(&changed);
    newer.part("MATRIX").flags = 3;
    unsupported(with_notes(&newer.bytes(), &read.notes).unwrap_err(), "MATRIX");
}

#[test]
fn cells() {
    let cells = |bytes: &[u8]| refused(|f| f.part("PLACEMENT").set(bytes.to_vec()));
    // The scene's own: numbers 2 and 3 in the first chunk, of an extent of 3, 2 and 4.
    let mut file = File::of(&encode(&two_scales(), &f32()).unwrap());
    assert_eq!(file.part("PLACEMENT").payload, [2, 0]);
    malformed(cells(&[2]), "bytes of cells");
    malformed(cells(&[0; 19]), "bytes of cells");
    malformed(cells(&[2, 0x8D, 0x00]), "cell 1");
    malformed(cells(&[2, 0x8D]), "cell 1");
    malformed(cells(&[2, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0x01]), "cell 1");
    malformed(cells(&[2, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0x7F]), "cell 1");
    malformed(cells(&[2, 21]), "cell 1");
    malformed(cells(&[2, 0, 0]), "bytes after the cells");
    malformed(cells(&[2, 1]), "box");
    malformed(patched("SCALE", 120, &5u32.to_le_bytes()), "extent");
    malformed(patched("SCALE", CHUNKS + 4, &0f64.to_le_bytes()), "box");
    malformed(patched("SCALE", CHUNKS, &3u32.to_le_bytes()), "tensors of all chunks");
}

#[test]
fn a_tensor_is_in_one_chunk() {
    let twice = |f: &mut File| {
        let first = f.index("PLACEMENT");
        let (placement, covered) =
            (f.sections[first].payload.clone(), f.part("SCALE").payload[CHUNKS + 4..][..48].to_vec());
        f.sections[first + 3].set(placement);
        f.part("SCALE").patch(CHUNKS + 52 + 4, &covered);
    };
    let error = refused(twice);
    assert!(matches!(error, Error::Scene(_) | Error::Malformed { .. }), "{error}");
}

#[test]
fn zstd_frames() {
    let compressed = |change: &dyn Fn(&mut Part)| {
        refused(|f| {
            f.part("DENSITY").compress(BODY);
            assert!(decode(&f.bytes()).is_ok());
            change(f.part("DENSITY"));
        })
    };
    malformed(compressed(&|p| p.payload[BODY] ^= 1), "DENSITY");
    malformed(compressed(&|p| p.payload.truncate(BODY + 6)), "DENSITY");
    malformed(compressed(&|p| p.decoded_length += 1), "body length");
    malformed(compressed(&|p| p.decoded_length = 3), "decoded length");
    // A second frame, and one to be skipped, would hide bytes.
    malformed(compressed(&|p| p.payload.extend(zstd::bulk::compress(b"", 3).unwrap())), "frame length");
    malformed(compressed(&|p| p.payload.extend([0x50, 0x2A, 0x4D, 0x18, 0, 0, 0, 0])), "frame length");
    malformed(
        compressed(&|p| {
            p.payload.splice(BODY..BODY, [0x50, 0x2A, 0x4D, 0x18, 0, 0, 0, 0]);
        }),
        "DENSITY",
    );
    // Frames of one block as it is, with a window of 2^27 bytes and of one more step.
    let with_window = |window: u8, p: &mut Part| {
        let content = zstd::bulk::decompress(&p.payload[BODY..], 1 << 20).unwrap();
        let length = content.len() as u32;
        p.payload.truncate(BODY);
        p.payload.extend([0x28, 0xB5, 0x2F, 0xFD, 0x80, window]);
        p.payload.extend(length.to_le_bytes());
        p.payload.extend(&(length << 3 | 1).to_le_bytes()[..3]);
        p.payload.extend(content);
    };
    let mut file = File::of(&encode(&two_scales(), &f32()).unwrap());
    file.part("DENSITY").compress(BODY);
    with_window(17 << 3, file.part("DENSITY"));
    assert_eq!(decode(&file.bytes()).unwrap(), two_scales());
    malformed(compressed(&|p| with_window(17 << 3 | 1, p)), "window");
    malformed(compressed(&|p| with_window(0xFF, p)), "window");
    // A frame of another size, or of none that it declares.
    let replaced = |frame: Vec<u8>| {
        compressed(&|p| {
            p.payload.truncate(BODY);
            p.payload.extend(&frame);
        })
    };
    malformed(replaced(zstd::bulk::compress(&[0; 99], 3).unwrap()), "content size");
    malformed(replaced(zstd::stream::encode_all([0; 99].as_slice(), 3).unwrap()), "DENSITY");
}

#[test]
fn scenes_that_break_an_invariant() {
    let nan = f64::NAN.to_le_bytes();
    broken(patched("FRAME", 0, &nan), "model_from_dataset");
    broken(patched("FRAME", 64, &(-0.0f64).to_le_bytes()), "meters_per_unit");
    broken(patched("RULES", 8, &nan), "bounds");
    broken(patched("RULES", 72, &nan), "step");
    broken(patched("DENSITY", BODY, &f32::INFINITY.to_le_bytes()), "density factors");
    broken(patched("DECODER", 17, &[7, 0, 0, 0, 5]), "DECODER layer");
    broken(patched("MATRIX", 0, &[3]), "MATRIX of scale 0 features");
    malformed(patched("MATRIX", 4, &[1]), "MATRIX of scale 0 rank");
    // 60 vertices: bits 60 to 63 of the last byte have none.
    malformed(patched("OCCUPANCY", BODY + 7, &[0x80]), "OCCUPANCY unused bits");
    for wrong in [f64::NAN, -1.0, 0.0, f64::INFINITY] {
        broken(patched("SCALE", 8, &wrong.to_le_bytes()), "half edges");
        broken(patched("SCALE", 104, &wrong.to_le_bytes()), "pitch");
    }
    broken(patched("SCALE", 64, &nan), "origin");
    let swapped = |f: &mut File| {
        let centers = [[0.1f64, 0.2, 0.3], [0.1, 0.2, -0.3]].map(|c| c.map(f64::to_le_bytes).concat());
        let last = f.sections.iter_mut().rfind(|p| p.kind == name("PLACEMENT")).unwrap();
        last.set(centers.concat());
    };
    malformed(refused(swapped), "PLACEMENT of chunk 0 of scale 1");
}

/// The error of a file whose two explicit centers are these, in chunks as they are or in one for each.
fn centers(first: [f64; 3], second: [f64; 3]) -> Option<Error> {
    let mut scene = two_scales();
    let half = scene.scales[1].cloud.half_edge;
    let mut file = File::of(&encode(&scene, &f32()).unwrap());
    let both = [first, second].map(glam::DVec3::from_array);
    scene.scales[1].cloud.placement = Placement::Explicit { centers: both.to_vec() };
    let covered = strivec_format::geometry::Aabb::from_points(both).grown(half);
    let bytes = |v: glam::DVec3| v.to_array().map(f64::to_le_bytes).concat();
    let scale = file.sections.iter_mut().rfind(|p| p.kind == name("SCALE")).unwrap();
    scale.inflate(CHUNKS);
    scale.patch(CHUNKS + 4, &[bytes(covered.min), bytes(covered.max)].concat());
    let last = file.sections.iter_mut().rfind(|p| p.kind == name("PLACEMENT")).unwrap();
    last.set(both.map(bytes).concat());
    let read = decode(&file.bytes());
    if let Ok(read) = &read {
        assert_eq!(read.scales[1].cloud.placement, scene.scales[1].cloud.placement, "centers");
    }
    read.err()
}

#[test]
fn zeros_of_both_signs_keep_the_order_of_centers() {
    assert_eq!(centers([-1.0, 0.0, -0.0], [1.0, 0.0, 0.0]), None);
    assert_eq!(centers([-1.0, -0.0, 0.5], [1.0, 0.0, 0.5]), None);
    // By x alone, and by the sign of y.
    malformed(centers([-1.0, 0.0, 0.5], [1.0, -0.0, 0.5]).unwrap(), "PLACEMENT of chunk 0");
    malformed(centers([1.0, -0.0, 0.5], [-1.0, 0.0, 0.5]).unwrap(), "centers of SCALE");
    malformed(centers([1.0, -0.0, 0.5], [1.0, 0.0, 0.5]).unwrap(), "centers of SCALE");
    malformed(centers([1.0, 0.0, 0.5], [1.0, 0.0, 0.5]).unwrap(), "centers of SCALE");
    broken(centers([1.0, 0.0, f64::NAN], [1.0, 0.0, 0.5]).unwrap(), "center 0");
    broken(centers([1.0, 0.0, 0.5], [f64::INFINITY, 0.0, 0.5]).unwrap(), "center 1");
}

/// The error of writing a scene after `change`.
fn not_written(options: &EncodeOptions, change: impl FnOnce(&mut Scene)) -> Error {
    let mut scene = two_scales();
    assert!(encode(&scene, options).is_ok(), "the scene is right before the change");
    change(&mut scene);
    encode(&scene, options).expect_err("the scene cannot be written")
}

#[test]
fn the_writer_refuses_what_a_reader_would() {
    broken(not_written(&f32(), |s| s.rules.step = 0.0), "step");
    broken(not_written(&f32(), |s| s.decoder.feature_frequencies = u32::MAX), "decoder");
    limit(not_written(&f32(), |s| s.provenance.tool = "a".repeat(4097)), "tool");
    limit(not_written(&f32(), |s| s.scales = vec![s.scales[0].clone(); 17]), "scales");
    let far = |s: &mut Scene| {
        let Placement::Lattice { cells, .. } = &mut s.scales[0].cloud.placement else { unreachable!() };
        cells[3].z = 1 << 20;
    };
    limit(not_written(&f32(), far), "cells along an axis");
    let many = |s: &mut Scene| {
        let factors = &mut s.scales[1].factors;
        let block = &mut factors.density[0];
        block.values.resize(block.values.len() / block.rank as usize * 513, 0.5);
        block.rank = 513;
    };
    limit(not_written(&f32(), many), "density rank");
    let rank = |s: &mut Scene| {
        s.scales[1].factors.density[0].rank = 0;
        s.scales[1].factors.density[0].values.clear();
    };
    broken(not_written(&f32(), rank), "density rank");
}

#[test]
fn numbers_that_an_encoding_does_not_hold() {
    for (value, fits) in [(65_504.0, true), (65_519.0, true), (65_520.0, false), (-1e30, false)] {
        let mut scene = two_scales();
        scene.scales[1].factors.appearance[0].values[2] = value;
        assert!(encode(&scene, &f32()).is_ok());
        let place = "APPEARANCE entry 2".to_string();
        let expected = Error::Overflow { place, value, largest: 65_504.0 };
        assert_eq!(encode(&scene, &f16()).err(), (!fits).then_some(expected));
    }
    for (bits, value, fits) in [(8, 27_339.0, true), (8, -27_341.0, false), (3, 645.0, true), (3, 1e37, false)] {
        let mut scene = two_scales();
        scene.scales[1].factors.density[0].values[2] = value;
        match encode(&scene, &EncodeOptions::uniform(Encoding::Grid(bits))) {
            Ok(_) => assert!(fits, "{value} in {bits} bits"),
            Err(Error::Overflow { value: found, .. }) => assert!(!fits && found == value, "{found} in {bits} bits"),
            Err(other) => panic!("{other}"),
        }
    }
}

#[test]
fn compression_levels() {
    for found in [0, -5, 23, i32::MAX] {
        let error = encode(&smallest(), &EncodeOptions { zstd_level: Some(found), ..f16() }).unwrap_err();
        assert_eq!(error, Error::Level { found });
    }
}
