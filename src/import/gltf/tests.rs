//! glTF files as programs write them, and such as no reader should trust.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use serde_json::{Value, json};

use super::super::testing::Seen;
use super::super::{Fault, Input, ReadOptions};
use super::read;

mod compressed;

fn no_files(name: &str) -> Result<Vec<u8>, Fault> {
    panic!("nothing is asked for but {name}")
}

fn try_seen(file: &[u8], beside: &dyn Fn(&str) -> Result<Vec<u8>, Fault>) -> Result<Seen, Fault> {
    let mut seen = Seen::default();
    read(&mut Input::from_bytes(file), beside, &ReadOptions::default(), &mut seen)?;
    Ok(seen)
}

fn seen(document: &Value) -> Seen {
    try_seen(document.to_string().as_bytes(), &no_files).unwrap()
}

fn fault(document: &Value) -> String {
    try_seen(document.to_string().as_bytes(), &no_files).unwrap_err().to_string()
}

fn glb(document: &str, blob: Option<&[u8]>) -> Vec<u8> {
    let mut json = document.as_bytes().to_vec();
    json.resize(json.len().next_multiple_of(4), b' ');
    let mut chunks = [&(json.len() as u32).to_le_bytes()[..], b"JSON", &json].concat();
    if let Some(blob) = blob {
        chunks.extend([&(blob.len() as u32).to_le_bytes()[..], b"BIN\0", blob].concat());
    }
    [&b"glTF\x02\0\0\0"[..], &(12 + chunks.len() as u32).to_le_bytes(), &chunks].concat()
}

fn floats(values: &[f32]) -> Vec<u8> {
    values.iter().flat_map(|value| value.to_le_bytes()).collect()
}

fn data(bytes: &[u8]) -> String {
    format!("data:application/octet-stream;base64,{}", STANDARD.encode(bytes))
}

/// Four vertices, whose x is their number from 1, then colors of them, then the indices 0 1 2 2 1 3 of 16 bits.
fn quad() -> Vec<u8> {
    let mut bytes = floats(&[1., 0., 0., 2., 0.5, 0., 3., 1., 0., 4., 1., -1.]);
    bytes.extend([255, 0, 55, 255, 0, 0, 0, 255, 188, 1, 128, 255, 0, 0, 0, 255]);
    bytes.extend([0_u16, 1, 2, 2, 1, 3].into_iter().flat_map(u16::to_le_bytes));
    bytes
}

/// A document of one node with [`quad`].
fn document() -> Value {
    let bytes = quad();
    json!({
        "asset": {"version": "2.0", "generator": "a test"},
        "buffers": [{"byteLength": bytes.len(), "uri": data(&bytes)}],
        "bufferViews": [
            {"buffer": 0, "byteLength": 48},
            {"buffer": 0, "byteOffset": 48, "byteLength": 16},
            {"buffer": 0, "byteOffset": 64, "byteLength": 12},
        ],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3", "min": [1, 0, -1], "max": [4, 1, 0]},
            {"bufferView": 1, "componentType": 5121, "count": 4, "type": "VEC4", "normalized": true},
            {"bufferView": 2, "componentType": 5123, "count": 6, "type": "SCALAR"},
        ],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 2}]}],
        "nodes": [{"mesh": 0}],
        "scenes": [{"nodes": [0]}],
        "scene": 0,
    })
}

/// [`document`] with other values: each is a JSON pointer and what to put there.
fn with(changes: &[(&str, Value)]) -> Value {
    let mut document = document();
    for (pointer, value) in changes {
        let (parent, key) = pointer.rsplit_once('/').unwrap();
        match document.pointer_mut(parent).unwrap() {
            Value::Array(entries) if key == "-" => entries.push(value.clone()),
            Value::Array(entries) => entries[key.parse::<usize>().unwrap()] = value.clone(),
            parent => parent[key] = value.clone(),
        }
    }
    document
}

/// The x of every triangle's corners.
fn corners(seen: &Seen) -> Vec<[f64; 3]> {
    seen.triangles.iter().map(|corners| corners.map(|corner| corner.position.x)).collect()
}

const QUAD: [[f64; 3]; 2] = [[1.0, 2.0, 3.0], [3.0, 2.0, 4.0]];

#[test]
fn a_mesh_reads_alike_from_all_places_of_buffers() {
    let inside = seen(&document());
    assert_eq!(corners(&inside), QUAD);
    assert_eq!(inside.triangles[1][2].position.to_array(), [4.0, 1.0, -1.0]);
    assert_eq!((inside.triangles[0][0].color, inside.points.len()), (None, 0));

    let binary = with(&[("/buffers/0", json!({"byteLength": 76}))]).to_string();
    let padded = [quad(), vec![0; 4]].concat();
    assert_eq!(corners(&try_seen(&glb(&binary, Some(&padded)), &no_files).unwrap()), QUAD);

    let named = with(&[("/buffers/0/uri", json!("my%20mesh.bin"))]).to_string();
    let beside = |name: &str| {
        assert_eq!(name, "my mesh.bin");
        Ok(quad())
    };
    assert_eq!(corners(&try_seen(named.as_bytes(), &beside).unwrap()), QUAD);
    assert_eq!(corners(&try_seen(format!("\u{feff}{named}").as_bytes(), &beside).unwrap()), QUAD);
}

#[test]
fn colors_become_srgb() {
    let seen = seen(&with(&[("/meshes/0/primitives/0/attributes/COLOR_0", json!(1))]));
    // 55/255 linear is 128 in sRGB; 188 is 223, 1 is 13, 128 is 188.
    assert_eq!(
        seen.triangles[0].map(|corner| corner.color),
        [Some([255, 0, 128]), Some([0, 0, 0]), Some([223, 13, 188])]
    );
    let bytes = floats(&[0.0, 0.2158605, 1.0, 2.0, -1.0, f32::NAN, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
    let floats = with(&[
        ("/buffers/-", json!({"byteLength": 48, "uri": data(&bytes)})),
        ("/bufferViews/1", json!({"buffer": 1, "byteLength": 48})),
        ("/accessors/1", json!({"bufferView": 1, "componentType": 5126, "count": 4, "type": "VEC3"})),
        ("/meshes/0/primitives/0/attributes/COLOR_0", json!(1)),
    ]);
    assert_eq!(super::tests::seen(&floats).triangles[0][0].color, Some([0, 128, 255]));
    assert_eq!(super::tests::seen(&floats).triangles[0][1].color, Some([255, 0, 0]));
}

#[test]
fn modes_join_the_vertices() {
    let cases = [
        (json!(5), vec![[1.0, 2.0, 3.0], [2.0, 4.0, 3.0]]),
        (json!(6), vec![[2.0, 3.0, 1.0], [3.0, 4.0, 1.0]]),
        (json!(4), vec![[1.0, 2.0, 3.0]]),
    ];
    for (mode, expected) in cases {
        let primitive = json!({"attributes": {"POSITION": 0}, "mode": mode});
        assert_eq!(corners(&seen(&with(&[("/meshes/0/primitives/0", primitive)]))), expected, "{mode}");
    }
    let points = seen(&with(&[("/meshes/0/primitives/0/mode", json!(0))]));
    let x: Vec<f64> = points.points.iter().map(|point| point.position.x).collect();
    assert_eq!(x, [1.0, 2.0, 3.0, 3.0, 2.0, 4.0]);
    for mode in [1, 2, 3] {
        let lines = json!({"attributes": {"POSITION": 0}, "mode": mode});
        assert_eq!(corners(&seen(&with(&[("/meshes/0/primitives/-", lines)]))), QUAD);
    }
}

#[test]
fn of_a_mesh_the_vertices_alone_can_be_had() {
    let options = ReadOptions { vertices: true, ..ReadOptions::default() };
    let mut seen = Seen::default();
    let file = document().to_string();
    read(&mut Input::from_bytes(file.as_bytes()), &no_files, &options, &mut seen).unwrap();
    assert_eq!(seen.positions(), [[1.0, 0.0, 0.0], [2.0, 0.5, 0.0], [3.0, 1.0, 0.0], [4.0, 1.0, -1.0]]);
    assert!(seen.triangles.is_empty());
}

#[test]
fn nodes_turn_move_and_repeat_a_mesh() {
    let half = std::f64::consts::FRAC_1_SQRT_2;
    let nodes = json!([
        {"children": [1, 2], "translation": [10, 0, 0], "scale": [2, 2, 2]},
        {"mesh": 0, "rotation": [0, 0, half, half], "translation": [0, 0, 1]},
        {"children": [3]},
        {"mesh": 0, "matrix": [-1, 0, 0, 0,  0, 1, 0, 0,  0, 0, 1, 0,  0, 5, 0, 1]},
        {"mesh": 0, "translation": [1000, 0, 0]},
    ]);
    // The second vertex is (2, 0.5, 0).
    let at = |seen: &Seen, n: usize| seen.triangles[n][1].position;
    let near = |a: glam::DVec3, b: [f64; 3]| assert!(a.distance(b.into()) < 1e-6, "{a} {b:?}");
    let scene = seen(&with(&[("/nodes", nodes.clone())]));
    assert_eq!(scene.triangles.len(), 4);
    near(at(&scene, 0), [10.0 - 1.0, 4.0, 2.0]);
    near(at(&scene, 2), [10.0 - 4.0, 11.0, 0.0]);
    // Without a default scene all roots count.
    let mut all = with(&[("/nodes", nodes)]);
    all.as_object_mut().unwrap().remove("scene");
    let all = seen(&all);
    assert_eq!(all.triangles.len(), 6);
    near(at(&all, 4), [1002.0, 0.5, 0.0]);
}

#[test]
fn quantized_positions_and_strides_are_read() {
    let mut bytes = Vec::new();
    for vertex in [[-32768_i16, 0, 0], [32767, 0, 0], [0, 16384, 0]] {
        bytes.extend(vertex.into_iter().flat_map(i16::to_le_bytes));
        bytes.extend([7, 7]);
    }
    let quantized = |normalized: bool| {
        seen(&with(&[
            ("/extensionsRequired", json!(["KHR_mesh_quantization", "KHR_materials_unlit"])),
            ("/buffers/0", json!({"byteLength": 24, "uri": data(&bytes)})),
            ("/bufferViews/0", json!({"buffer": 0, "byteLength": 24, "byteStride": 8})),
            (
                "/accessors/0",
                json!({"bufferView": 0, "componentType": 5122, "count": 3, "type": "VEC3", "normalized": normalized}),
            ),
            ("/meshes/0/primitives/0", json!({"attributes": {"POSITION": 0}})),
        ]))
    };
    assert_eq!(corners(&quantized(false)), [[-32768.0, 32767.0, 0.0]]);
    assert_eq!(corners(&quantized(true)), [[-1.0, 1.0, 0.0]]);
    assert_eq!(quantized(true).triangles[0][2].position.y, 16384.0 / 32767.0);
}

/// Replaces the vertices 1 and 3, in bytes of a buffer of their own.
fn sparse(indices: [u8; 2]) -> [(&'static str, Value); 4] {
    let bytes = [&floats(&[20., 0., 0., 40., 0., 0.])[..], &indices].concat();
    let values = json!({"count": 2, "indices": {"bufferView": 4, "componentType": 5121}, "values": {"bufferView": 3}});
    [
        ("/buffers/-", json!({"byteLength": 26, "uri": data(&bytes)})),
        ("/bufferViews/-", json!({"buffer": 1, "byteLength": 24})),
        ("/bufferViews/-", json!({"buffer": 1, "byteOffset": 24, "byteLength": 2})),
        ("/accessors/0/sparse", values),
    ]
}

#[test]
fn sparse_elements_replace_others_or_zeros() {
    let mut document = with(&sparse([1, 3]));
    assert_eq!(corners(&seen(&document)), [[1.0, 20.0, 3.0], [3.0, 20.0, 40.0]]);
    document["accessors"][0].as_object_mut().unwrap().remove("bufferView");
    assert_eq!(corners(&seen(&document)), [[0.0, 20.0, 0.0], [0.0, 20.0, 40.0]]);
    let zeros = json!({"componentType": 5126, "count": 4, "type": "VEC3"});
    assert_eq!(corners(&seen(&with(&[("/accessors/0", zeros)]))), [[0.0; 3]; 2]);
    let message = "accessor 0: expected sparse indices that ascend from 0 to below 4, found ";
    for (indices, found) in [([1, 4], 4), ([3, 1], 1), ([2, 2], 2)] {
        assert_eq!(fault(&with(&sparse(indices))), format!("{message}{found}"));
    }
}

#[test]
fn what_is_not_geometry_may_be_anything() {
    let document = with(&[
        ("/textures", json!([{"extensions": {"EXT_texture_webp": {"source": 0}}}])),
        ("/materials", json!("none")),
        ("/animations", json!([{"channels": 7}])),
        ("/skins", json!({})),
        ("/meshes/0/primitives/0/attributes/_ID", json!(99)),
        ("/meshes/0/primitives/0/targets", json!([{"POSITION": 99}])),
        ("/meshes/0/primitives/0/material", json!(99)),
        ("/nodes/0/skin", json!(99)),
        ("/nodes/0/extras", json!({"of": "a program"})),
        ("/extensionsUsed", json!(["KHR_draco_mesh_compression", "VENDOR_thing"])),
        ("/extensionsRequired", json!(["EXT_texture_webp"])),
    ]);
    assert_eq!(corners(&seen(&document)), QUAD);
}

#[test]
fn extensions_are_refused_by_name() {
    let refused = |name: &str| format!("the extension \"{name}\" is not supported: export the file without it");
    for name in ["KHR_draco", "EXT_meshopt_compression_2", "VENDOR_thing"] {
        assert_eq!(fault(&with(&[("/extensionsRequired", json!([name]))])), refused(name));
    }
    let name = "EXT_mesh_gpu_instancing";
    assert_eq!(fault(&with(&[("/extensionsUsed", json!([name]))])), refused(name));
    let splats = fault(&with(&[("/extensionsUsed", json!(["KHR_gaussian_splatting_other"]))]));
    assert_eq!(
        splats,
        "the extension \"KHR_gaussian_splatting_other\" is not supported: export the splats as PLY or SPZ"
    );
}

#[test]
fn documents_that_are_none() {
    let text = |file: &str| try_seen(file.as_bytes(), &no_files).unwrap_err().to_string();
    assert_eq!(text(""), "the JSON: not a glTF document: EOF while parsing a value at line 1 column 0");
    assert_eq!(text("{}"), "glTF of version \"unknown\" is not supported: convert it to glTF 2");
    let old = "{\"asset\": {\"version\": \"1.0\"}, \"accessors\": {}}";
    assert_eq!(text(old), "glTF of version \"1.0\" is not supported: convert it to glTF 2");
    let deep = format!("{{\"asset\": {}", "[".repeat(100_000));
    assert!(text(&deep).starts_with("the JSON: not a glTF document: invalid type: sequence"));
    let deep = format!("{{\"extras\": {}", "[".repeat(100_000));
    assert!(text(&deep).starts_with("the JSON: not a glTF document: EOF"));
    let deep = with(&[("/accessors/0/min", json!("deep"))])
        .to_string()
        .replace("\"deep\"", &format!("{}{}", "[".repeat(100_000), "]".repeat(100_000)));
    assert!(text(&deep).starts_with("the JSON: not a glTF document: recursion limit exceeded"));
    let long = with(&[("/accessors/0/min", json!(vec![0; 1 << 20]))]);
    assert!(fault(&long).contains("an entry has more than 1048576 values"));
    let many = format!("{{\"asset\": {{\"version\": \"2.0\"}}, \"nodes\": [{}{{}}]}}", "{},".repeat(1 << 20));
    assert!(text(&many).contains("invalid length 1048577, expected a list of at most 1048576"));
    let message = "the scene: it has no mesh of triangles, points or splats";
    assert_eq!(text("{\"asset\": {\"version\": \"2.0\"}}"), message);
    assert_eq!(fault(&with(&[("/scenes/0/nodes", json!([]))])), message);
}

#[test]
fn indices_and_types_that_are_wrong() {
    let primitive = "primitive 0 of mesh 0: ";
    let cases: Vec<(&str, Value, String)> = vec![
        ("/scene", json!(1), "the JSON: scene 1 is missing: there are 1".into()),
        ("/scenes/0/nodes/0", json!(7), "the JSON: node 7 is missing: there are 1".into()),
        ("/nodes/0/mesh", json!(7), "the JSON: mesh 7 is missing: there are 1".into()),
        ("/meshes/0/primitives/0/attributes/POSITION", json!(7), "the JSON: accessor 7 is missing: there are 3".into()),
        ("/meshes/0/primitives/0/indices", json!(7), "the JSON: accessor 7 is missing: there are 3".into()),
        ("/meshes/0/primitives/0/mode", json!(7), format!("{primitive}expected a mode from 0 to 6, found another one")),
        ("/accessors/0/bufferView", json!(7), "the JSON: buffer view 7 is missing: there are 3".into()),
        ("/bufferViews/0/buffer", json!(7), "the JSON: buffer 7 is missing: there are 1".into()),
        ("/accessors/0/type", json!("VEC9"), "accessor 0: unknown type of numbers".into()),
        ("/accessors/0/componentType", json!(5130), "accessor 0: unknown type of numbers".into()),
        (
            "/accessors/0/type",
            json!("VEC2"),
            format!("{primitive}expected positions of three floats or small integers, found Vec2 of F32"),
        ),
        (
            "/accessors/0/componentType",
            json!(5125),
            format!("{primitive}expected positions of three floats or small integers, found Vec3 of U32"),
        ),
        (
            "/accessors/2/componentType",
            json!(5122),
            format!("{primitive}expected indices of unsigned integers, found Scalar of I16"),
        ),
        ("/accessors/0/count", json!(3), format!("{primitive}expected an index below 3, found 3")),
        ("/meshes/0/primitives/0/attributes/COLOR_0", json!(0), "".into()),
        (
            "/meshes/0/primitives/0/attributes/COLOR_0",
            json!(2),
            format!("{primitive}expected colors of floats or normalized small integers, found Scalar of U16"),
        ),
    ];
    for (pointer, value, message) in cases {
        let changed = with(&[(pointer, value)]);
        if message.is_empty() {
            assert!(seen(&changed).triangles[0][0].color.is_some());
        } else {
            assert_eq!(fault(&changed), message, "{pointer}");
        }
    }
}

#[test]
fn bytes_that_are_not_there() {
    let most = u64::MAX;
    let view = "buffer view 0: expected ";
    let cases: Vec<(&str, Value, String)> = vec![
        ("/buffers/0/byteLength", json!(77), "buffer 0: expected the declared 77 bytes, found 76 bytes".into()),
        ("/buffers/0/byteLength", json!(most), format!("buffer 0: expected the declared {most} bytes, found 76 bytes")),
        (
            "/bufferViews/0/byteLength",
            json!(77),
            format!("{view}a range within the 76 bytes of its buffer, found 77 bytes from byte 0 on"),
        ),
        (
            "/bufferViews/0/byteOffset",
            json!(most),
            format!("{view}a range within the 76 bytes of its buffer, found 48 bytes from byte {most} on"),
        ),
        ("/bufferViews/0/byteStride", json!(8), format!("{view}a stride of at least 12, found 8")),
        ("/bufferViews/0/byteStride", json!(0), format!("{view}a stride of at least 12, found 0")),
        (
            "/bufferViews/0/byteStride",
            json!(16),
            format!("{view}4 elements of 12 bytes from byte 0 on, 16 apart, found 48 bytes"),
        ),
        (
            "/accessors/0/byteOffset",
            json!(4),
            format!("{view}4 elements of 12 bytes from byte 4 on, 12 apart, found 48 bytes"),
        ),
        (
            "/accessors/0/byteOffset",
            json!(most),
            format!("{view}4 elements of 12 bytes from byte {most} on, 12 apart, found 48 bytes"),
        ),
        (
            "/accessors/0/count",
            json!(most),
            format!("{view}{most} elements of 12 bytes from byte 0 on, 12 apart, found 48 bytes"),
        ),
        (
            "/accessors/0",
            json!({"componentType": 5126, "count": most, "type": "VEC3"}),
            format!("elements of an accessor without a buffer view: at most 16777216 are read, found {most}"),
        ),
        ("/buffers/0", json!({"byteLength": 76}), "buffer 0: it has no URI, and there is no chunk BIN for it".into()),
    ];
    for (pointer, value, message) in cases {
        assert_eq!(fault(&with(&[(pointer, value)])), message, "{pointer}");
    }
    let infinite = floats(&[0., 0., 0., f32::INFINITY, 0., 0., 0., 0., 0., 0., 0., 0.]);
    let infinite = [infinite, quad()[48..].to_vec()].concat();
    let message = "vertex 1 of primitive 0 of mesh 0: expected finite coordinates, found [inf, NaN, NaN]";
    assert_eq!(fault(&with(&[("/buffers/0/uri", json!(data(&infinite)))])), message);
}

#[test]
fn uris_stay_in_the_folder() {
    for uri in [
        "/etc/passwd",
        "../a.bin",
        "a/../../b",
        "a%2f%2e%2e%2fb",
        "C:a.bin",
        "http://a/b",
        "file:a",
        "a\\b",
        "%5c%5ca",
        "",
        "a%00",
    ] {
        let message = fault(&with(&[("/buffers/0/uri", json!(uri))]));
        assert!(message.starts_with("a separate file at \""), "{uri}: {message}");
        assert!(message.ends_with(
            "is not supported: move it into the folder of the file that names it, and name it by a relative path"
        ));
    }
    for uri in ["a%", "a%2", "a%zz", "%ff"] {
        let message = format!("buffer 0: expected a URI, found \"{uri}\"");
        assert_eq!(fault(&with(&[("/buffers/0/uri", json!(uri))])), message);
    }
    let message = "buffer 0: expected a data URI in base64, found ";
    assert_eq!(fault(&with(&[("/buffers/0/uri", json!("data:,abc"))])), format!("{message}\"data:,abc\""));
    assert!(fault(&with(&[("/buffers/0/uri", json!("data:;base64,a?"))])).starts_with(message));
}

#[test]
fn nodes_that_are_no_tree() {
    let nodes = |nodes: Value| fault(&with(&[("/nodes", nodes)]));
    assert_eq!(nodes(json!([{"children": [0]}])), "node 0: it has two parents or is part of a cycle");
    assert_eq!(
        nodes(json!([{"children": [1, 2]}, {"children": [3]}, {"children": [3]}, {"mesh": 0}])),
        "node 3: it has two parents or is part of a cycle"
    );
    assert_eq!(
        nodes(json!([{"children": [1]}, {"children": [0]}])),
        "node 0: it has two parents or is part of a cycle"
    );
    assert_eq!(nodes(json!([{"children": [1, 1, 1, 1]}, {}])), "children: at most 2 are read, found 3");
    assert_eq!(nodes(json!([{"children": [9]}])), "the JSON: node 9 is missing: there are 1");
    assert!(
        nodes(json!([{"mesh": 0, "rotation": [0, 0, 0, 0]}])).starts_with("node 0: expected a rotation of length 1")
    );
    let matrix = json!([1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 2]);
    let message = "node 0: expected a matrix whose last row is 0, 0, 0, 1, found [0, 0, 0, 2]";
    assert_eq!(nodes(json!([{"mesh": 0, "matrix": matrix}])), message);
    // Deep trees are no recursion.
    let mut chain: Vec<Value> = (1..50_000).map(|n| json!({"children": [n]})).collect();
    chain.push(json!({"mesh": 0}));
    assert_eq!(corners(&seen(&with(&[("/nodes", json!(chain))]))), QUAD);
}

#[test]
fn a_mesh_cannot_be_asked_for_without_end() {
    let children: Vec<u32> = (1..=300).collect();
    let mut nodes = vec![json!({"children": children})];
    nodes.resize(301, json!({"mesh": 0}));
    let document = with(&[
        ("/nodes", json!(nodes)),
        ("/accessors/0", json!({"componentType": 5126, "count": 1 << 24, "type": "VEC3"})),
        ("/meshes/0/primitives/0", json!({"attributes": {"POSITION": 0}})),
    ]);
    /// Counts, and is quick.
    struct Many(u64);
    impl super::Visitor for Many {
        fn point(&mut self, _: super::super::Point) -> Result<(), Fault> {
            Ok(())
        }
        fn triangle(&mut self, _: [super::super::Point; 3]) -> Result<(), Fault> {
            self.0 += 1;
            Ok(())
        }
        fn cell(&mut self, _: &strivec_format::geometry::Aabb, _: Option<[u8; 3]>) -> Result<(), Fault> {
            Ok(())
        }
        fn progress(&mut self, _: u64, _: u64) -> Result<(), Fault> {
            // One instance is enough of a test: the rest is charged below.
            Err(Fault::Stopped)
        }
    }
    let file = document.to_string();
    let result = read(&mut Input::from_bytes(file.as_bytes()), &no_files, &ReadOptions::default(), &mut Many(0));
    assert!(matches!(result, Err(Fault::Stopped)), "it asks whether to go on");
    let mut budget = super::CornerBudget::default();
    let spent: Result<(), Fault> = (0..300).try_for_each(|_| budget.spend(1 << 24));
    assert_eq!(
        spent.unwrap_err().to_string(),
        "corners of all instances: at most 4294967296 are read, found 4311744512"
    );
}

#[test]
fn glb_lengths_are_those_of_the_file() {
    let document = with(&[("/buffers/0", json!({"byteLength": 76}))]).to_string();
    let whole = glb(&document, Some(&quad()));
    let fault = |file: &[u8]| try_seen(file, &no_files).unwrap_err().to_string();
    let changed = |at: usize, value: u32| {
        let mut file = whole.clone();
        file[at..at + 4].copy_from_slice(&value.to_le_bytes());
        fault(&file)
    };
    let (len, room) = (whole.len(), whole.len() - 20);
    assert_eq!(fault(b"glTF\x02\0\0\0"), "byte 0: expected 12 bytes of a GLB header, found 8 bytes");
    assert_eq!(changed(4, 1), "GLB of version 1 is not supported: convert it to glTF 2");
    for length in [0, 11, 12, u32::MAX, len as u32 + 1] {
        assert_eq!(changed(8, length), format!("byte 8: expected a length from 20 to {len}, found {length}"));
    }
    assert_eq!(changed(12, u32::MAX), format!("byte 12: expected a chunk of at most {room} bytes, found {}", u32::MAX));
    assert_eq!(changed(16, 0), "byte 12: expected a chunk JSON, found another chunk");
    assert_eq!(fault(&glb(&document, None)), "buffer 0: it has no URI, and there is no chunk BIN for it");
    let short = fault(&glb(&document, Some(&quad()[..72])));
    assert_eq!(short, "buffer 0: expected the declared 76 bytes, found 72 bytes");
    for end in 0..len {
        assert!(try_seen(&whole[..end], &no_files).is_err(), "cut at {end}");
    }
}

#[test]
fn extras_may_be_of_any_type_and_numbers_may_be_floats() {
    for extras in [json!(5), json!("text"), json!([1, 2]), json!(null), json!(true), json!({"a": {}})] {
        let places = [
            "",
            "/asset",
            "/buffers/0",
            "/bufferViews/0",
            "/accessors/0",
            "/meshes/0",
            "/meshes/0/primitives/0",
            "/nodes/0",
            "/scenes/0",
        ];
        let changes: Vec<_> = places.iter().map(|place| format!("{place}/extras")).collect();
        let changes: Vec<_> = changes.iter().map(|place| (place.as_str(), extras.clone())).collect();
        assert_eq!(corners(&seen(&with(&changes))), QUAD, "{extras}");
    }
    let floats = with(&[("/accessors/2/count", json!(6.0)), ("/bufferViews/2/byteOffset", json!(64.0))]);
    assert_eq!(corners(&seen(&floats)), QUAD);
    let scene = with(&[("/scene", json!(0.0)), ("/nodes/0/scale", json!([1, 1.0, 1]))]);
    assert_eq!(corners(&seen(&scene)), QUAD);
    for wrong in [json!(6.5), json!(-6), json!(-6.0), json!(1e300), json!("6")] {
        let message = fault(&with(&[("/accessors/2/count", wrong)]));
        assert!(message.starts_with("the JSON: not a glTF document: invalid "), "{message}");
    }
}

/// Easting, height and northing with more digits than 32 bits have.
#[test]
fn transforms_of_nodes_keep_the_digits_of_the_file() {
    let place = [500_000.125, 312.7, -5_000_000.062_5];
    let matrix =
        [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [place[0], place[1], place[2], 1.0]];
    for (name, value) in [("translation", json!(place)), ("matrix", json!(matrix.concat()))] {
        let [first, ..] = seen(&with(&[(format!("/nodes/0/{name}").as_str(), value)])).triangles[0];
        assert_eq!(first.position.to_array(), [place[0] + 1.0, place[1], place[2]], "{name}");
    }
}

#[test]
fn scenes_may_lack_nodes() {
    assert_eq!(corners(&seen(&with(&[("/scenes/-", json!({"name": "unused"}))]))), QUAD);
    let empty = fault(&with(&[("/scenes/0", json!({}))]));
    assert_eq!(empty, "the scene: it has no mesh of triangles, points or splats");
}

#[test]
fn required_extensions_that_leave_geometry_alone_are_read() {
    for name in [
        "KHR_techniques_webgl",
        "KHR_technique_webgl",
        "EXT_mesh_features",
        "KHR_animation_pointer",
        "KHR_node_visibility",
    ] {
        let document = with(&[("/extensionsUsed", json!([name])), ("/extensionsRequired", json!([name]))]);
        assert_eq!(corners(&seen(&document)), QUAD, "{name}");
    }
}
