//! Splats in every format against the same ones as PLY, and such SOG files as no reader should trust.

use std::io::{Cursor, Write};
use std::panic::{AssertUnwindSafe, catch_unwind};

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use glam::{DQuat, DVec3};
use image::{ExtendedColorType, ImageEncoder};
use serde_json::{Value, json};
use zip::ZipWriter;
use zip::write::SimpleFileOptions;

use super::{HARMONIC, read_sog, read_sog_meta, read_spz, sigmoid};
use crate::testing::{Seen, seen_with};
use crate::{Fault, Input, LeftOut, ReadOptions, gltf, ply};

/// A splat as PLY files hold it.
#[derive(Clone)]
struct Known {
    center: [f64; 3],
    /// w, x, y, z.
    rotation: [f64; 4],
    scales: [f64; 3],
    /// Before the sigmoid.
    opacity: f64,
    color: [f64; 3],
}

impl Known {
    fn unit(&self) -> DQuat {
        let [w, x, y, z] = self.rotation;
        DQuat::from_xyzw(x, y, z, w).normalize()
    }
}

/// Splats of all octants, of each largest component of the rotation, and a transparent one.
fn known() -> Vec<Known> {
    let splat = |n: i32| {
        let at = f64::from(n);
        let mut rotation = [0.3, -0.2, 0.25, -0.1 * at / 9.0];
        rotation[n as usize % 4] = if n % 3 == 0 { -1.2 } else { 0.9 };
        Known {
            center: [(at * 0.7).sin() * 3.0, (at * 1.3).cos() * 0.5, at / 5.0 - 0.9],
            rotation,
            scales: [-2.0 - at / 7.0, -3.0 + at / 11.0, -6.0],
            opacity: if n == 4 { -5.0 } else { at - 2.0 },
            color: [at / 5.0 - 1.0, 0.4, -at / 10.0],
        }
    };
    (0..10).map(splat).collect()
}

fn ply_of(splats: &[Known]) -> Vec<u8> {
    let names = "x y z f_dc_0 f_dc_1 f_dc_2 opacity scale_0 scale_1 scale_2 rot_0 rot_1 rot_2 rot_3";
    let properties: String = names.split(' ').map(|name| format!("property float {name}\n")).collect();
    let count = splats.len();
    let mut file =
        format!("ply\nformat binary_little_endian 1.0\nelement vertex {count}\n{properties}end_header\n").into_bytes();
    for Known { center, rotation, scales, opacity, color } in splats {
        let values = [&center[..], color, &[*opacity], scales, rotation].concat();
        file.extend(values.into_iter().flat_map(|value| (value as f32).to_le_bytes()));
    }
    file
}

fn from_ply(splats: &[Known]) -> Seen {
    seen_with(&ply_of(splats), &ReadOptions::default(), ply::read).unwrap()
}

/// Fails unless `found` has the splats of `expected`: centers within `center`, axes within the share `axis` of their length,
/// colors within `color`.
fn check(expected: &Seen, found: &Seen, center: f64, axis: f64, color: u8) {
    assert_eq!(found.left_out, expected.left_out);
    assert_eq!((found.splats.len(), found.points.len()), (expected.splats.len(), 0));
    for ((a, a_axes), (b, b_axes)) in expected.splats.iter().zip(&found.splats) {
        assert!(a.position.distance(b.position) <= center, "{a:?} and {b:?}");
        for (a, b) in a_axes.iter().zip(b_axes) {
            // The opposite axis is that of the same ellipsoid.
            let off = a.distance(*b).min(a.distance(-*b));
            assert!(off <= axis * a_axes.iter().map(|a| a.length()).fold(0.0, f64::max), "{a_axes:?} and {b_axes:?}");
        }
        let (a, b) = (a.color.unwrap(), b.color.unwrap());
        assert!((0..3).all(|c| a[c].abs_diff(b[c]) <= color), "{a:?} and {b:?}");
    }
}

/// [`check`], which must fail for planted differences in each property of a splat.
fn check_file(read: impl Fn(&[Known]) -> Seen, center: f64, axis: f64, color: u8) {
    let splats = known();
    let expected = from_ply(&splats);
    assert_eq!((expected.splats.len(), &expected.left_out[..]), (9, &[LeftOut::Transparent][..]));
    check(&expected, &read(&splats), center, axis, color);
    let planted: [fn(&mut Known); 5] = [
        |splat| splat.center[1] *= -1.0,
        |splat| splat.rotation.swap(0, 1),
        |splat| splat.scales.swap(0, 2),
        |splat| splat.opacity = -4.0,
        |splat| splat.color.swap(0, 2),
    ];
    for (n, plant) in planted.into_iter().enumerate() {
        let mut changed = splats.clone();
        plant(&mut changed[9]);
        let found = read(&changed);
        let checked = catch_unwind(AssertUnwindSafe(|| check(&expected, &found, center, axis, color)));
        assert!(checked.is_err(), "the planted difference {n} goes unnoticed");
    }
}

fn floats(values: impl IntoIterator<Item = f64>) -> Vec<u8> {
    values.into_iter().flat_map(|value| (value as f32).to_le_bytes()).collect()
}

/// A document of one primitive; its attributes are `parts`: names, types, numbers.
fn document(parts: &[(&str, &str, Vec<u8>)], extension: Value) -> Value {
    let mut bytes = Vec::new();
    let (mut views, mut accessors, mut attributes) = (Vec::new(), Vec::new(), serde_json::Map::new());
    for (n, (name, kind, part)) in parts.iter().enumerate() {
        let width = 4 * match *kind {
            "VEC3" => 3,
            "VEC4" => 4,
            _ => 1,
        };
        views.push(json!({"buffer": 0, "byteOffset": bytes.len(), "byteLength": part.len()}));
        accessors.push(json!({"bufferView": n, "componentType": 5126, "count": part.len() / width, "type": kind}));
        attributes.insert((*name).into(), n.into());
        bytes.extend(part);
    }
    json!({
        "asset": {"version": "2.0"},
        "extensionsUsed": ["KHR_gaussian_splatting"],
        "buffers": [{"byteLength": bytes.len(), "uri": format!("data:;base64,{}", STANDARD.encode(&bytes))}],
        "bufferViews": views,
        "accessors": accessors,
        "meshes": [{"primitives": [{"attributes": attributes, "mode": 0, "extensions": {"KHR_gaussian_splatting": extension}}]}],
        "nodes": [{"mesh": 0}],
    })
}

fn gltf_of(splats: &[Known]) -> Value {
    gltf_with(splats, f64::exp)
}

/// The splats with scales that `scale_of` makes of their logarithms.
fn gltf_with(splats: &[Known], scale_of: fn(f64) -> f64) -> Value {
    let part = |values: &dyn Fn(&Known) -> Vec<f64>| floats(splats.iter().flat_map(values));
    let name = |name: &str| format!("KHR_gaussian_splatting:{name}");
    let [rotation, scale, opacity, color] = ["ROTATION", "SCALE", "OPACITY", "SH_DEGREE_0_COEF_0"].map(name);
    document(
        &[
            ("POSITION", "VEC3", part(&|s| s.center.to_vec())),
            (&rotation, "VEC4", part(&|s| s.unit().to_array().to_vec())),
            (&scale, "VEC3", part(&|s| s.scales.map(scale_of).to_vec())),
            (&opacity, "SCALAR", part(&|s| vec![sigmoid(s.opacity)])),
            (&color, "VEC3", part(&|s| s.color.to_vec())),
        ],
        json!({"kernel": "ellipse", "colorSpace": "srgb_rec709_display"}),
    )
}

fn try_gltf(document: &Value) -> Result<Seen, Fault> {
    let mut seen = Seen::default();
    let text = document.to_string();
    let none = |name: &str| Err(Fault::broken(name, "there is no file"));
    gltf::read(&mut Input::from_bytes(text.as_bytes()), &none, &ReadOptions::default(), &mut seen)?;
    Ok(seen)
}

#[test]
fn splats_in_gltf_are_those_of_ply() {
    check_file(|splats| try_gltf(&gltf_of(splats)).unwrap(), 1e-6, 1e-6, 0);
}

#[test]
fn scales_in_gltf_of_which_one_is_negative_are_logarithms() {
    assert!(known().iter().any(|splat| splat.scales.iter().any(|scale| *scale < 0.0)));
    check_file(|splats| try_gltf(&gltf_with(splats, |logarithm| logarithm)).unwrap(), 1e-6, 1e-6, 0);
}

#[test]
fn a_node_moves_splats_with_their_axes() {
    let mut moved = gltf_of(&known());
    moved["nodes"] = json!([{"mesh": 0, "scale": [2, 2, 2], "rotation": [0, 0, 1, 0], "translation": [1, 0, 0]}]);
    let map = |v: DVec3| 2.0 * DVec3::new(-v.x, -v.y, v.z);
    let mut expected = from_ply(&known());
    for (center, axes) in &mut expected.splats {
        center.position = map(center.position) + DVec3::X;
        *axes = axes.map(map);
    }
    check(&expected, &try_gltf(&moved).unwrap(), 1e-5, 1e-6, 0);
    // Nodes of large scales are endless together.
    let mut chain: Vec<Value> = (1..12).map(|n| json!({"children": [n], "scale": [3e38, 1, 1]})).collect();
    chain.push(moved["nodes"][0].clone());
    moved["nodes"] = chain.into();
    let message = try_gltf(&moved).unwrap_err().to_string();
    assert!(message.starts_with("a splat of primitive 0 of mesh 0: expected finite coordinates"), "{message}");
}

/// SPZ of version 3, in axes right, up, back of the left, up, front of glTF.
fn spz_of(splats: &[Known], turned: bool) -> Vec<u8> {
    let signs = if turned { [-1.0, 1.0, -1.0] } else { [1.0; 3] };
    let mut bytes = b"NGSP".to_vec();
    bytes.extend([3, splats.len() as u32].iter().flat_map(|v| v.to_le_bytes()));
    bytes.extend([0, 12, 0, 0]);
    for splat in splats {
        for (value, sign) in splat.center.iter().zip(signs) {
            bytes.extend(&((sign * value * 4096.0).round() as i32).to_le_bytes()[..3]);
        }
    }
    let quantized = |value: f64| value.round().clamp(0.0, 255.0) as u8;
    bytes.extend(splats.iter().map(|s| quantized(255.0 * sigmoid(s.opacity))));
    bytes.extend(splats.iter().flat_map(|s| s.color.map(|c| quantized((0.15 * c + 0.5) * 255.0))));
    bytes.extend(splats.iter().flat_map(|s| s.scales.map(|c| quantized(16.0 * (c + 10.0)))));
    for splat in splats {
        let [x, y, z, w] = splat.unit().to_array();
        let quaternion = [signs[0] * x, signs[1] * y, signs[2] * z, w];
        let largest = (0..4).max_by(|&a, &b| quaternion[a].abs().total_cmp(&quaternion[b].abs())).unwrap();
        let mut bits = largest as u32;
        for (_, value) in quaternion.iter().enumerate().filter(|(n, _)| *n != largest) {
            let value = value * quaternion[largest].signum();
            let magnitude = (value.abs() * std::f64::consts::SQRT_2 * 511.0).round() as u32;
            bits = bits << 10 | u32::from(value < 0.0) << 9 | magnitude;
        }
        bytes.extend(bits.to_le_bytes());
    }
    let mut encoder = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::default());
    encoder.write_all(&bytes).unwrap();
    encoder.finish().unwrap()
}

/// A document whose primitive is an SPZ stream; its accessors have no data, as the extension prescribes.
fn spz_document(stream: &[u8], name: &str) -> Value {
    let mut document =
        document(&[("POSITION", "SPZ", stream.to_vec())], json!({"extensions": {name: {"bufferView": 0}}}));
    document["accessors"] = json!([{"componentType": 5126, "count": 10, "type": "VEC3"}]);
    document["extensionsRequired"] = json!(["KHR_gaussian_splatting", name]);
    document
}

#[test]
fn spz_is_read_alone_and_in_gltf() {
    let options = ReadOptions::default();
    // Half a step of 1/4096 on each axis; half of 1/16 of a logarithm, and of 511ths of a component.
    check_file(|splats| seen_with(&spz_of(splats, false), &options, read_spz).unwrap(), 3e-4, 0.05, 2);
    for name in gltf_names() {
        check_file(|splats| try_gltf(&spz_document(&spz_of(splats, true), name)).unwrap(), 3e-4, 0.05, 2);
    }
}

fn gltf_names() -> [&'static str; 2] {
    ["KHR_gaussian_splatting_compression_spz_2", "KHR_gaussian_splatting_compression_spz"]
}

#[test]
fn splats_in_gltf_that_are_incomplete_are_not_read_as_points() {
    let fault = |document: &Value| try_gltf(document).unwrap_err().to_string();
    let attributes = "/meshes/0/primitives/0/attributes";
    for name in ["ROTATION", "SCALE", "OPACITY"] {
        let mut document = gltf_of(&known());
        let name = format!("KHR_gaussian_splatting:{name}");
        document.pointer_mut(attributes).unwrap().as_object_mut().unwrap().remove(&name).unwrap();
        let message = format!("primitive 0 of mesh 0: the attribute {name} of splats is missing");
        assert_eq!(fault(&document), message);
        // Attributes of splats make splats of a primitive that lacks the extension.
        document["meshes"][0]["primitives"][0]["extensions"] = json!({});
        assert_eq!(fault(&document), message);
        for extensions in [json!(1), json!({"KHR_gaussian_splatting": 1})] {
            document["meshes"][0]["primitives"][0]["extensions"] = extensions;
            assert!(fault(&document).contains("invalid "), "{}", fault(&document));
        }
    }
    let with = |pointer: &str, value: Value| {
        let mut document = gltf_of(&known());
        *document.pointer_mut(pointer).unwrap() = value;
        fault(&document)
    };
    let primitive = "primitive 0 of mesh 0: ";
    let cases = [
        ("/meshes/0/primitives/0/mode", json!(4), "expected the mode 0 of splats, points, found another one"),
        (
            "/accessors/1",
            json!({"componentType": 5126, "count": 10, "type": "VEC4"}),
            "ROTATION has no buffer view; the splats are compressed in a way that is not supported",
        ),
    ];
    for (pointer, value, message) in cases {
        assert_eq!(with(pointer, value), format!("{primitive}{message}"), "{pointer}");
    }
    let mut document = gltf_of(&known());
    document["accessors"][2]["count"] = json!(9);
    assert_eq!(fault(&document), "primitive 0 of mesh 0: expected 10 elements of SCALE, found 9");
    document["accessors"][2]["count"] = json!(u64::MAX);
    assert!(fault(&document).starts_with("buffer view 2: expected "), "{}", fault(&document));
    document["accessors"][2] = json!({"bufferView": 2, "componentType": 5126, "count": 10, "type": "SCALAR"});
    let message = "primitive 0 of mesh 0: expected SCALE of three floats or small integers, found Scalar of F32";
    assert_eq!(fault(&document), message);

    let mut cut = spz_of(&known(), true);
    cut.truncate(40);
    let message = fault(&spz_document(&cut, gltf_names()[0]));
    assert!(message.starts_with("the SPZ stream in buffer view 0: "), "{message}");
    let other = "KHR_gaussian_splatting_compression_other";
    let message = fault(&spz_document(&spz_of(&known(), true), other));
    assert!(message.starts_with(&format!("the extension \"{other}\" is not supported")), "{message}");
}

/// WebP of these pixels, four in a row.
fn webp(pixels: &[[u8; 4]]) -> Vec<u8> {
    let mut pixels = pixels.to_vec();
    pixels.resize(pixels.len().next_multiple_of(4), [0; 4]);
    let mut file = Vec::new();
    let encoder = image::codecs::webp::WebPEncoder::new_lossless(&mut file);
    encoder.encode(pixels.as_flattened(), 4, pixels.len() as u32 / 4, ExtendedColorType::Rgba8).unwrap();
    file
}

fn png(pixels: &[[u8; 4]]) -> Vec<u8> {
    let mut file = Vec::new();
    let encoder = image::codecs::png::PngEncoder::new(&mut file);
    encoder.write_image(pixels.as_flattened(), pixels.len() as u32, 1, ExtendedColorType::Rgba8).unwrap();
    file
}

fn byte_of(value: f64, [min, max]: [f64; 2]) -> u8 {
    ((value - min) / (max - min) * 255.0).round() as u8
}

/// A description, and the pictures by their names.
type SogFiles = (Value, Vec<(&'static str, Vec<u8>)>);

/// The files of a SOG of this version, whose codebooks are even steps.
fn sog_of(splats: &[Known], version: u32, picture: fn(&[[u8; 4]]) -> Vec<u8>) -> SogFiles {
    let logarithm = |value: f64| value.signum() * value.abs().ln_1p();
    let means = |high: usize| {
        let pixel = |s: &Known| {
            let bytes = s.center.map(|c| (((logarithm(c) + 2.0) / 4.0 * 65535.0).round() as u16).to_le_bytes()[high]);
            [bytes[0], bytes[1], bytes[2], 255]
        };
        picture(&splats.iter().map(pixel).collect::<Vec<_>>())
    };
    let rotation = |s: &Known| {
        let [x, y, z, w] = s.unit().to_array();
        let quaternion = [w, x, y, z];
        let largest = (0..4).max_by(|&a, &b| quaternion[a].abs().total_cmp(&quaternion[b].abs())).unwrap();
        let sign = quaternion[largest].signum() * std::f64::consts::SQRT_2;
        let mut others = (0..4).filter(|&n| n != largest).map(|n| byte_of(sign * quaternion[n], [-1.0, 1.0]));
        [others.next().unwrap(), others.next().unwrap(), others.next().unwrap(), 252 + largest as u8]
    };
    let (scales, colors, logits) = ([-8.0, 0.0], [-2.0, 2.0], [-6.0, 8.0]);
    let scale = |s: &Known| {
        let [a, b, c] = s.scales.map(|value| byte_of(value, scales));
        [a, b, c, 255]
    };
    let color = |s: &Known| {
        let [a, b, c] = s.color.map(|value| byte_of(value, colors));
        let opacity = if version == 1 { byte_of(s.opacity, logits) } else { byte_of(sigmoid(s.opacity), [0.0, 1.0]) };
        [a, b, c, opacity]
    };
    let all = |of: &dyn Fn(&Known) -> [u8; 4]| picture(&splats.iter().map(of).collect::<Vec<_>>());
    let files = vec![
        ("means_l.webp", means(0)),
        ("means_u.webp", means(1)),
        ("quats.webp", all(&rotation)),
        ("scales.webp", all(&scale)),
        ("sh0.webp", all(&color)),
    ];
    let codebook =
        |[min, max]: [f64; 2]| (0..256).map(|n| min + (max - min) * f64::from(n) / 255.0).collect::<Vec<_>>();
    let means = json!({"mins": [-2, -2, -2], "maxs": [2, 2, 2], "files": ["means_l.webp", "means_u.webp"],
        "shape": [splats.len(), 3]});
    let quats = json!({"files": ["quats.webp"]});
    let meta = if version == 1 {
        json!({"means": means, "quats": quats,
            "scales": {"mins": vec![scales[0]; 3], "maxs": vec![scales[1]; 3], "files": ["scales.webp"]},
            "sh0": {"mins": [colors[0], colors[0], colors[0], logits[0]],
                "maxs": [colors[1], colors[1], colors[1], logits[1]], "files": ["sh0.webp"]}})
    } else {
        json!({"version": version, "count": splats.len(), "means": means, "quats": quats,
            "scales": {"codebook": codebook(scales), "files": ["scales.webp"]},
            "sh0": {"codebook": codebook(colors), "files": ["sh0.webp"]}})
    };
    (meta, files)
}

fn bundle(meta: &Value, files: &[(&str, Vec<u8>)]) -> Vec<u8> {
    let mut zip = ZipWriter::new(Cursor::new(Vec::new()));
    for (name, bytes) in [("meta.json", meta.to_string().into_bytes())].iter().chain(files) {
        zip.start_file(*name, SimpleFileOptions::default().compression_method(zip::CompressionMethod::Stored)).unwrap();
        zip.write_all(bytes).unwrap();
    }
    zip.finish().unwrap().into_inner()
}

fn try_sog((meta, files): &SogFiles) -> Result<Seen, Fault> {
    seen_with(&bundle(meta, files), &ReadOptions::default(), read_sog)
}

#[test]
fn both_versions_of_sog_hold_the_splats_of_ply() {
    // Half a step of 16 bits of the logarithm times the farthest center; half of 1/255 of 8 of a logarithm, and of 2/255 of
    // a component; half of 1/255 of 4 times the harmonic.
    for version in [1, 2] {
        check_file(|splats| try_sog(&sog_of(splats, version, webp)).unwrap(), 3e-4, 0.04, 1);
        check_file(|splats| try_sog(&sog_of(splats, version, png)).unwrap(), 3e-4, 0.04, 1);
    }
    let steps = 255.0 * HARMONIC * 4.0 / 255.0 / 2.0;
    assert!(steps < 1.0, "{steps}");
}

#[test]
fn a_folder_of_sog_is_read_by_its_name_and_by_its_description() {
    let folder = tempfile::tempdir().unwrap();
    let (meta, files) = sog_of(&known(), 2, webp);
    std::fs::write(folder.path().join("meta.json"), meta.to_string()).unwrap();
    files.iter().for_each(|(name, bytes)| std::fs::write(folder.path().join(name), bytes).unwrap());
    let expected = from_ply(&known());
    for path in [folder.path().to_path_buf(), folder.path().join("meta.json")] {
        let mut seen = Seen::default();
        crate::read(&path, &ReadOptions::default(), &mut seen).unwrap();
        check(&expected, &seen, 3e-4, 0.04, 1);
    }
    let bundled = folder.path().join("splats.SOG");
    std::fs::write(&bundled, bundle(&meta, &files)).unwrap();
    let mut seen = Seen::default();
    crate::read(&bundled, &ReadOptions::default(), &mut seen).unwrap();
    check(&expected, &seen, 3e-4, 0.04, 1);
    for (name, what) in [("a.ksplat", "the extension .ksplat"), ("lod-meta.json", "SOG in levels of detail")] {
        let message =
            crate::read(&folder.path().join(name), &ReadOptions::default(), &mut seen).unwrap_err().to_string();
        let expected =
            format!("{what} is not supported: convert it to SOG, SPZ or PLY, for example by splat-transform");
        assert!(message.ends_with(&expected), "{message}");
    }
}

#[test]
fn a_codebook_may_lack_its_first_number() {
    let (mut meta, files) = sog_of(&known(), 2, webp);
    meta["scales"]["codebook"][0] = Value::Null;
    check(&from_ply(&known()), &try_sog(&(meta.clone(), files.clone())).unwrap(), 3e-4, 0.04, 1);
    meta["scales"]["codebook"][1] = Value::Null;
    let message = try_sog(&(meta, files)).unwrap_err().to_string();
    assert_eq!(message, "meta.json: expected 256 numbers in the codebook of scales, found 254");
}

#[test]
fn hostile_sog_files_are_named() {
    let whole = sog_of(&known(), 2, webp);
    let fault = |change: &dyn Fn(&mut SogFiles)| {
        let mut changed = whole.clone();
        change(&mut changed);
        try_sog(&changed).unwrap_err().to_string()
    };
    let with = |pointer: &str, value: Value| fault(&|(meta, _)| *meta.pointer_mut(pointer).unwrap() = value.clone());
    assert_eq!(with("/version", json!(3)), "SOG of version 3 is not supported: convert it to version 2, or to PLY");
    assert_eq!(with("/count", json!(u64::MAX)), format!("splats: at most 16777216 are read, found {}", u64::MAX));
    assert_eq!(with("/count", json!(13)), "means_l.webp: expected a pixel for each of 13 splats, found 4 x 3");
    assert!(with("/count", json!(-1)).starts_with("meta.json: not a description of splats: invalid value"));
    assert_eq!(with("/means/mins", json!([1, 2])), "meta.json: expected 3 numbers in mins of means, found 2");
    assert_eq!(with("/sh0/codebook", json!([1])), "meta.json: expected 256 numbers in the codebook of sh0, found 1");
    assert_eq!(with("/means/files", json!(["means_l.webp"])), "meta.json: means has no file 1");
    assert_eq!(with("/quats/files", json!(["none.webp"])), "the archive: the entry none.webp is missing");
    let message = "the rotation of splat 0: expected an alpha of 252 to 255, found 255";
    assert_ne!(with("/quats/files", json!(["sh0.webp"])), message);
    assert!(
        with("/quats/files", json!(["sh0.webp"]))
            .starts_with("the rotation of splat 0: expected an alpha of 252 to 255")
    );
    let endless = with("/means/maxs", json!([1e308, 2, 2]));
    assert!(endless.starts_with("splat 0: expected finite coordinates, found [inf"), "{endless}");
    assert_eq!(
        fault(&|(meta, _)| *meta = json!({})),
        "meta.json: not a description of splats: missing field `means` at line 1 column 2"
    );
    let picture = |bytes: Vec<u8>| fault(&|(_, files)| files[2].1.clone_from(&bytes));
    assert!(picture(b"GIF89a".to_vec()).starts_with("quats.webp: expected the first bytes of lossless WebP or of PNG"));
    assert!(picture(webp(&[[0; 4]])[..20].to_vec()).starts_with("quats.webp: it cannot be decoded: "));
    // A header of 16383 x 16383 pixels.
    let mut large = webp(&[[0; 4]]);
    large[21..25].copy_from_slice(&[0xfe, 0xbf, 0xff, 0x1f]);
    assert_eq!(picture(large), "quats.webp: pixels: at most 16777216 are read, found 268402689");
    assert_eq!(
        seen_with(b"PK\x05\x06", &ReadOptions::default(), read_sog).unwrap_err().to_string(),
        "the archive's end: there is no zip directory"
    );
    let file = bundle(&whole.0, &whole.1);
    for at in (0..file.len()).step_by(3) {
        let mut damaged = file.clone();
        damaged[at] ^= 0x55;
        let _ = seen_with(&damaged, &ReadOptions::default(), read_sog);
        let _ = seen_with(&damaged[..at], &ReadOptions::default(), read_sog);
    }
    // Without a checksum, the pictures' decoders see damaged bytes.
    for at in 0..whole.1[2].1.len() {
        let beside = |name: &str| {
            let mut bytes = whole.1.iter().find(|(known, _)| *known == name).unwrap().1.clone();
            if name == "quats.webp" {
                bytes[at] ^= 0x55;
            }
            Ok(bytes)
        };
        let meta = whole.0.to_string();
        let input = &mut Input::from_bytes(meta.as_bytes());
        let _ = read_sog_meta(input, &beside, &ReadOptions::default(), &mut Seen::default());
    }
}
