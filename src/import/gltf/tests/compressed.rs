//! Compressed meshes, as other programs write them (`fixtures/import/gltf`), and with planted differences.

use meshoptimizer_rs::Workspace;
use meshoptimizer_rs::codec::{IndexEncoding, encode_index_sequence};
use serde_json::{Value, json};

use super::super::super::testing::Seen;
use super::super::super::{Fault, Point};
use super::{QUAD, corners, data, fault, no_files, seen, try_seen, with};

macro_rules! fixture {
    ($name:literal) => {
        ($name, include_bytes!(concat!("../../../../fixtures/import/gltf/", $name)))
    };
}

const PLAIN: &[u8] = include_bytes!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../fixtures/import/gltf/plain.glb"));
const DRACO: [(&str, &[u8]); 3] =
    [fixture!("draco-valence.glb"), fixture!("draco-edgebreaker.glb"), fixture!("draco-sequential.glb")];
const MESHOPT: [(&str, &[u8]); 3] =
    [fixture!("meshopt.glb"), fixture!("meshopt-float.glb"), fixture!("meshopt-khr.glb")];
/// Half a step of 14 bits over the sphere's diameter of 2, and the rounding of floats.
const HALF_STEP: f64 = 1.0 / 16383.0 + 1e-6;

/// The triangles of `file` whose corners differ from those of `plain` by more than `position` along an axis or by more
/// than `color`, in the best of the three rotations.
fn unmatched(plain: &Seen, file: &Seen, position: f64, color: u8) -> usize {
    let near = |a: &Point, b: &Point| {
        let channels = match (a.color, b.color) {
            (Some(a), Some(b)) => a.iter().zip(b).all(|(a, b)| a.abs_diff(b) <= color),
            (a, b) => a == b,
        };
        channels && (a.position - b.position).abs().max_element() <= position
    };
    let mut left: Vec<_> = file.triangles.iter().collect();
    for triangle in &plain.triangles {
        let same = |other: &[Point; 3]| (0..3).any(|turn| (0..3).all(|n| near(&triangle[n], &other[(n + turn) % 3])));
        if let Some(n) = left.iter().position(|other| same(other)) {
            left.swap_remove(n);
        }
    }
    left.len()
}

fn read(file: &[u8]) -> Result<Seen, Fault> {
    try_seen(file, &no_files)
}

#[test]
fn compressed_files_have_the_triangles_of_the_plain_file() {
    let plain = read(PLAIN).unwrap();
    assert_eq!(plain.triangles.len(), 2 * 320 + 12);
    for (name, file) in DRACO.into_iter().chain(MESHOPT) {
        let seen = read(file).unwrap();
        // The filter of colors rounds linear values, and sRGB has 13 steps for the first of them.
        let color = if name == "meshopt-khr.glb" { 26 } else { 0 };
        assert_eq!(seen.triangles.len(), plain.triangles.len(), "{name}");
        assert_eq!(unmatched(&plain, &seen, HALF_STEP, color), 0, "{name}");
        assert!(unmatched(&plain, &seen, 1e-7, color) > 0, "{name} is rounded");
    }
    // Planted differences.
    let mut moved = read(DRACO[0].1).unwrap();
    moved.triangles[7][1].position.y += 4.0 * HALF_STEP;
    assert_eq!(unmatched(&plain, &moved, HALF_STEP, 0), 1);
    moved.triangles[9].swap(0, 1);
    assert_eq!(unmatched(&plain, &moved, HALF_STEP, 0), 2);
    moved.triangles[11][0].color = Some([1, 2, 3]);
    assert_eq!(unmatched(&plain, &moved, HALF_STEP, 0), 3);
}

/// The file with its JSON changed.
fn changed(file: &[u8], change: impl FnOnce(&mut Value)) -> Vec<u8> {
    let length = u32::from_le_bytes(file[12..16].try_into().unwrap()) as usize;
    let mut document: Value = serde_json::from_slice(&file[20..20 + length]).unwrap();
    change(&mut document);
    super::glb(&document.to_string(), Some(&file[28 + length..]))
}

fn message(file: &[u8], change: impl FnOnce(&mut Value)) -> String {
    read(&changed(file, change)).unwrap_err().to_string()
}

fn set(pointer: &str, value: Value) -> impl FnOnce(&mut Value) {
    move |document| *document.pointer_mut(pointer).unwrap() = value
}

#[test]
fn draco_streams_must_agree_with_the_accessors() {
    let file = DRACO[1].1;
    assert_eq!(read(&changed(file, |_| ())).unwrap().triangles.len(), 652);
    let extension = "/meshes/0/primitives/0/extensions/KHR_draco_mesh_compression";
    let cases = [
        (
            "/accessors/0/count".into(),
            json!(957),
            "accessor 0: expected the 960 indices of its Draco stream, found 957",
        ),
        (
            "/accessors/1/count".into(),
            json!(163),
            "accessor 1: expected the 162 elements of its Draco stream, found 163",
        ),
        (
            "/accessors/1/type".into(),
            json!("VEC4"),
            "accessor 1: expected 3 of F32 as in its Draco stream, found 4 of F32",
        ),
        (
            "/accessors/2/componentType".into(),
            json!(5123),
            "accessor 2: expected 4 of U8 as in its Draco stream, found 4 of U16",
        ),
        (
            format!("{extension}/attributes/POSITION"),
            json!(9),
            "accessor 1: its Draco stream has no attribute 9 with values that glTF has",
        ),
        (format!("{extension}/bufferView"), json!(9), "the JSON: buffer view 9 is missing: there are 2"),
        (
            "/meshes/0/primitives/0/mode".into(),
            json!(5),
            "primitive 0 of mesh 0: Draco compression of TriangleStrip is not supported: export triangles",
        ),
    ];
    for (pointer, value, expected) in cases {
        assert_eq!(message(file, set(&pointer, value)), expected, "{pointer}");
    }
    let invalid = message(file, set(extension, json!({"attributes": {}})));
    assert!(invalid.starts_with("primitive 0 of mesh 0: invalid extension KHR_draco_mesh_compression: "), "{invalid}");
    let short = message(file, set("/bufferViews/0/byteLength", json!(100)));
    assert!(short.starts_with("buffer view 0: cannot decode the Draco stream: "), "{short}");
    // An attribute outside the stream is read as usual, and its count is that of the stream's points.
    let no_color = changed(file, |document| {
        let extension = document.pointer_mut(extension).unwrap();
        extension["attributes"].as_object_mut().unwrap().remove("COLOR_0");
    });
    assert_eq!(read(&no_color).unwrap().triangles[0][0].color, Some([0, 0, 0]));
}

#[test]
fn meshopt_views_must_agree_with_their_streams() {
    let (name, file) = ("EXT_meshopt_compression", MESHOPT[0].1);
    let extension = format!("/bufferViews/0/extensions/{name}");
    let field = |field: &str| format!("{extension}/{field}");
    let invalid = "buffer view 0: the meshopt compression is invalid: ";
    let cases = [
        (field("count"), json!(187), format!("buffer view 0: expected 1488 bytes in {name}, found 187 elements of 8 bytes")),
        (field("byteStride"), json!(4), format!("buffer view 0: expected 1488 bytes in {name}, found 186 elements of 4 bytes")),
        (field("buffer"), json!(9), "the JSON: buffer 9 is missing: there are 2".into()),
        (field("buffer"), json!(1), "buffer 1: it has no URI, and there is no chunk BIN for it".into()),
        (
            field("byteOffset"),
            json!(1_u64 << 40),
            "buffer view 0: expected a range within the 1952 bytes of its buffer, found 973 bytes from byte 1099511627776 on"
                .into(),
        ),
        (field("byteLength"), json!(900), format!("{invalid}invalid encoded stream")),
        (field("byteLength"), json!(0), format!("{invalid}invalid encoded stream")),
        (field("mode"), json!("TRIANGLES"), format!("{invalid}invalid vertex layout")),
        (field("mode"), json!("INDICES"), format!("{invalid}invalid vertex layout")),
    ];
    for (pointer, value, expected) in cases {
        assert_eq!(message(file, set(&pointer, value)), expected, "{pointer}");
    }
    for (pointer, value) in [(field("mode"), json!("POINTS")), (extension.clone(), json!({"buffer": 0}))] {
        let message = message(file, set(&pointer, value));
        assert!(message.starts_with(&format!("buffer view 0: invalid extension {name}: ")), "{message}");
    }
    let most = message(file, |document| {
        document["bufferViews"][0]["byteLength"] = json!(8_u64 << 32);
        document["bufferViews"][0]["extensions"][name]["count"] = json!(1_u64 << 32);
    });
    assert_eq!(most, "decompressed bytes: at most 18776064 are read, found 34359738368");
}

#[test]
fn sequences_of_indices_are_decompressed() {
    let sequence = |indices: &[u32]| {
        let bytes = encode_index_sequence(indices, IndexEncoding::DEFAULT, &mut Workspace::default()).unwrap();
        let extension = json!({
            "buffer": 1, "byteLength": bytes.len(), "byteStride": 2, "count": indices.len(), "mode": "INDICES",
        });
        with(&[
            ("/extensionsRequired", json!(["EXT_meshopt_compression"])),
            ("/buffers/-", json!({"byteLength": bytes.len(), "uri": data(&bytes)})),
            (
                "/bufferViews/2",
                json!({
                    "buffer": 1, "byteLength": 2 * indices.len(), "extensions": {"EXT_meshopt_compression": extension},
                }),
            ),
        ])
    };
    assert_eq!(corners(&seen(&sequence(&[0, 1, 2, 2, 1, 3]))), QUAD);
    assert_eq!(fault(&sequence(&[0, 1, 2, 2, 1, 4])), "primitive 0 of mesh 0: expected an index below 4, found 4");
}

/// A few thousand changed bytes, and shorter streams.
#[test]
fn damaged_files_are_errors_or_other_meshes() {
    let mut state = 1_u64;
    let mut random = |below: usize| {
        state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (state >> 33) as usize % below
    };
    for (name, file) in DRACO.into_iter().chain(MESHOPT) {
        let pointer = match name {
            "meshopt.glb" | "meshopt-float.glb" => "/bufferViews/0/extensions/EXT_meshopt_compression/byteLength",
            "meshopt-khr.glb" => "/bufferViews/0/extensions/KHR_meshopt_compression/byteLength",
            _ => "/bufferViews/0/byteLength",
        };
        for length in 0..900 {
            let short = message(file, set(pointer, json!(length)));
            assert!(short.starts_with("buffer view 0: "), "{name} of {length}: {short}");
        }
        let start = 28 + u32::from_le_bytes(file[12..16].try_into().unwrap()) as usize;
        let mut refused = 0;
        for _ in 0..1000 {
            let mut damaged = file.to_vec();
            for _ in 0..1 + random(3) {
                damaged[start + random(file.len() - start)] = random(256) as u8;
            }
            refused += usize::from(read(&damaged).is_err());
        }
        assert!(refused > 0 && refused < 1000, "{name}: {refused}");
    }
}
