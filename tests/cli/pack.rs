//! The command `strivec-pack`, from files to files.

use crate::command::{PACK, code, command, pack, run_program, text};
use crate::scenes;

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Stdio;

use serde_json::Value;
use strivec_field::render::{ReferenceRenderer, Renderer};
use strivec_format::container::{
    EncodeOptions, Encoding, Limits, Metadata, decode, decode_scene_file, encode_scene_file,
};
use strivec_format::geometry::Ray;
use strivec_format::model::{ReferenceField, Scene};
use tempfile::TempDir;

/// A folder with the file `scene.strivec`.
fn folder() -> (TempDir, Scene) {
    let folder = TempDir::new().unwrap();
    let mut config = scenes::config();
    config.model.density_shift = -4.0;
    config.optimizer.factor_deviation = 0.8;
    let scene = scenes::scene(&config);
    let bytes =
        encode_scene_file(&scene, &Metadata::default(), &EncodeOptions::uniform(Encoding::F32)).expect("a valid scene");
    fs::write(folder.path().join("scene.strivec"), bytes).unwrap();
    (folder, scene)
}

#[track_caller]
fn json(folder: &Path, arguments: &[&str]) -> Value {
    let value = serde_json::from_str(&run_program(PACK, folder, &[&["--json"], arguments].concat())).expect("JSON");
    conforms(&value, arguments[0]);
    value
}

/// One line of standard error that names `what`, and the exit code.
#[track_caller]
fn fail(folder: &Path, arguments: &[&str], expected: i32, what: &str) {
    let output = pack(folder, arguments);
    let message = text(&output.stderr);
    assert_eq!(code(&output), expected, "{arguments:?}: {message}");
    assert!(message.starts_with("strivec-pack: ") && message.contains(what), "{message}");
}

fn read(folder: &Path, name: &str) -> Scene {
    decode(&fs::read(folder.join(name)).unwrap()).unwrap()
}

fn published() -> Value {
    let path = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("format-spec/strivec-pack.schema.json");
    serde_json::from_slice(&fs::read(path).unwrap()).unwrap()
}

/// Checks `value` against the published schema: as much of JSON schema as it uses.
#[track_caller]
fn conforms(value: &Value, command: &str) {
    let schema = published();
    let wrong = violation(value, &schema["$defs"][command], &schema);
    assert_eq!(wrong, None, "{command}: {value:#}");
}

/// The parts of `value` that do not match `schema`.
fn violation(value: &Value, schema: &Value, root: &Value) -> Option<String> {
    if let Some(reference) = schema["$ref"].as_str() {
        return violation(value, root.pointer(&reference[1..]).expect("a definition"), root);
    }
    if let Some(choices) = schema["anyOf"].as_array() {
        return choices.iter().map(|choice| violation(value, choice, root)).min().flatten();
    }
    let kind = match value {
        Value::Null => "null",
        Value::Bool(_) => "boolean",
        Value::Number(n) if n.is_f64() => "number",
        Value::Number(_) => "integer",
        Value::String(_) => "string",
        Value::Array(_) => "array",
        Value::Object(_) => "object",
    };
    let fits = |name: &Value| name == kind || (name == "number" && kind == "integer");
    let allowed = match &schema["type"] {
        Value::Null => true,
        Value::Array(kinds) => kinds.iter().any(fits),
        name => fits(name),
    };
    if !allowed {
        return Some(format!("{value} is not {}", schema["type"]));
    }
    match value {
        Value::Array(items) => {
            let of = |n: usize| schema["prefixItems"].get(n).unwrap_or(&schema["items"]);
            items.iter().enumerate().find_map(|(n, item)| violation(item, of(n), root))
        }
        Value::Object(fields) => {
            let required = schema["required"].as_array().into_iter().flatten();
            let missing = required.filter_map(Value::as_str).find(|name| !fields.contains_key(*name));
            let missing = missing.map(|name| format!("{name} is missing"));
            missing.or_else(|| {
                fields.iter().find_map(|(name, field)| match schema["properties"].get(name) {
                    Some(schema) => violation(field, schema, root),
                    None if schema["additionalProperties"].is_object() => {
                        violation(field, &schema["additionalProperties"], root)
                    }
                    None => Some(format!("{name} is unknown")),
                })
            })
        }
        _ => None,
    }
}

#[test]
fn the_published_schema_is_that_of_the_results() {
    let (folder, _) = folder();
    let printed: Value = serde_json::from_str(&run_program(PACK, folder.path(), &["schema"])).unwrap();
    assert_eq!(printed, published(), "strivec-pack schema > format-spec/strivec-pack.schema.json");
    // The check of results finds a planted difference.
    let schema = published();
    let info = json(folder.path(), &["info", "scene.strivec"]);
    for change in [
        |row: &mut Value| row["bytes"] = "many".into(),
        |row: &mut Value| drop(row.as_object_mut().unwrap().remove("version")),
        |row: &mut Value| row["more"] = 1.into(),
        |row: &mut Value| row["scales"][0]["tensors"] = Value::Null,
    ] {
        let mut wrong = info.clone();
        change(&mut wrong[0]);
        assert!(violation(&wrong, &schema["$defs"]["info"], &schema).is_some(), "{wrong:#}");
    }
}

#[test]
fn packing_loses_what_was_asked_for_and_says_so() {
    let (folder, scene) = folder();
    let row = &json(
        folder.path(),
        &["pack", "scene.strivec", "-o", "small.strivec", "--quality", "small", "--effort", "0.02"],
    )[0];
    assert!(row["bytes"].as_u64() < row["bytes_before"].as_u64(), "{row}");
    let psnr = row["psnr_to_before"].as_f64().expect("a loss");
    assert!(psnr >= 45.0, "{psnr}");
    let document =
        decode_scene_file(&fs::read(folder.path().join("small.strivec")).unwrap(), Limits::default()).unwrap();
    let metadata = document.metadata;
    assert_eq!(metadata.probes.as_ref().map(|p| p.probes.len()), Some(16));
    assert_eq!(metadata.prefixes.iter().flatten().count(), scene.scales.len() - 1);
    assert_eq!(metadata.quality.unwrap().encoded, Some(psnr));
    assert_eq!(metadata.views.unwrap().path.len(), 36);
    let thumbnail = metadata.thumbnail.unwrap();
    let picture = image::load_from_memory(&thumbnail.file).unwrap().to_rgb8();
    assert_eq!([picture.width(), picture.height()], thumbnail.size.map(u32::from));
    assert!(picture.pixels().any(|p| p.0 != picture.get_pixel(0, 0).0), "something is seen");

    let verified = json(folder.path(), &["verify", "--render", "small.strivec"]);
    assert_eq!(verified[0]["error"], Value::Null);
    assert_eq!(verified[0]["renderers"].as_array().unwrap().len(), 2);
}

#[test]
fn a_target_size_is_kept() {
    let (folder, _) = folder();
    let size = fs::metadata(folder.path().join("scene.strivec")).unwrap().len();
    let target = format!("{}B", size / 3);
    run_program(
        PACK,
        folder.path(),
        &[
            "pack",
            "scene.strivec",
            "-o",
            "third.strivec",
            "--target-size",
            &target,
            "--no-prefixes",
            "--effort",
            "0.02",
        ],
    );
    assert!(fs::metadata(folder.path().join("third.strivec")).unwrap().len() <= size / 3);
    fail(
        folder.path(),
        &["--quiet", "pack", "scene.strivec", "-o", "no.strivec", "--target-size", "100B", "--effort", "0.01"],
        4,
        "cannot be reached; the smallest file has about ",
    );
    assert!(!folder.path().join("no.strivec").exists());
}

#[test]
fn lossless_is_and_a_dry_run_writes_nothing() {
    let (folder, scene) = folder();
    let arguments = ["pack", "scene.strivec", "-o", "same.strivec", "--lossless", "--effort", "0.01"];
    json(folder.path(), &[&arguments[..], &["--dry-run"]].concat());
    assert!(!folder.path().join("same.strivec").exists());
    let row = &json(folder.path(), &arguments)[0];
    assert_eq!(row["psnr_to_before"], Value::Null);
    assert_eq!(read(folder.path(), "same.strivec"), scene);
    fail(folder.path(), &arguments, 1, "--force");
}

#[test]
fn differences_are_exit_code_7() {
    let (folder, _) = folder();
    run_program(PACK, folder.path(), &["convert", "scene.strivec", "-o", "half.strivec", "--encoding", "f16"]);
    json(folder.path(), &["diff", "scene.strivec", "scene.strivec"]);
    let output = pack(folder.path(), &["--json", "diff", "scene.strivec", "half.strivec"]);
    assert_eq!(code(&output), 7);
    let difference: Value = serde_json::from_slice(&output.stdout).unwrap();
    conforms(&difference, "diff");
    assert_eq!(difference["same_bytes"], false);
    let largest = difference["largest_parameter_difference"].as_f64().unwrap();
    assert!(largest > 0.0 && largest < 1e-2, "{largest}");
    assert!(difference["psnr"].as_f64().unwrap() > 50.0, "{difference}");
}

#[test]
fn converting_there_and_back_changes_no_byte() {
    let (folder, _) = folder();
    let grid = ["convert", "scene.strivec", "-o", "a.strivec", "--encoding", "grid6"];
    run_program(PACK, folder.path(), &grid);
    run_program(PACK, folder.path(), &["convert", "a.strivec", "-o", "b.strivec"]);
    run_program(PACK, folder.path(), &["convert", "b.strivec", "-o", "c.strivec"]);
    let bytes = |name| fs::read(folder.path().join(name)).unwrap();
    assert_eq!(read(folder.path(), "a.strivec"), read(folder.path(), "b.strivec"));
    // The same but for the stated error: nothing is lost a second time.
    assert_eq!(bytes("a.strivec").len(), bytes("b.strivec").len());
    assert!(bytes("b.strivec") == bytes("c.strivec"));
    fail(
        folder.path(),
        &["convert", "a.strivec", "-o", "d.strivec", "--target-version", "0.9"],
        5,
        "only 1.0 can be written",
    );
}

#[test]
fn a_crop_keeps_what_is_in_the_box_as_it_was() {
    let (folder, scene) = folder();
    // The scene's own box, but for a corner.
    let from = scene.frame.model_from_dataset.inverse();
    let (min, max) = (from.point(scene.bounds.min), from.point(scene.bounds.center()));
    let corners = [min.to_array(), max.to_array()].concat().iter().map(f64::to_string).collect::<Vec<_>>().join(",");
    run_program(PACK, folder.path(), &["crop", "scene.strivec", "-o", "part.strivec", &format!("--box={corners}")]);
    let part = read(folder.path(), "part.strivec");
    assert!(part.parameter_count() < scene.parameter_count());
    assert!(part.bounds.max.distance(scene.bounds.center()) < 1e-9, "{:?}", part.bounds);
    let inside = part.bounds.center();
    let feature = |scene: &Scene| {
        let field = ReferenceField::new(scene);
        field.density_feature(&field.locate(inside)).feature
    };
    assert_eq!(feature(&scene), feature(&part));
    run_program(PACK, folder.path(), &["crop", "scene.strivec", "-o", "coarse.strivec", "--scales", "1"]);
    assert_eq!(read(folder.path(), "coarse.strivec").scales, scene.scales[..1]);
    let refused = pack(folder.path(), &["crop", "scene.strivec", "-o", "x.strivec", "--box=1,1,1,0,0,0"]);
    let message = String::from_utf8_lossy(&refused.stderr);
    assert_eq!(code(&refused), 1);
    assert!(message.contains("'--box") && message.contains("the smallest corner, then a larger one"), "{message}");
}

#[test]
fn four_quarter_turns_are_none_and_a_move_moves_what_is_seen() {
    let (folder, scene) = folder();
    let turn = ["--turn", "z"].repeat(4);
    run_program(PACK, folder.path(), &[&["transform", "scene.strivec", "-o", "turned.strivec"], &turn[..]].concat());
    let turned = read(folder.path(), "turned.strivec").frame.model_from_dataset;
    assert!(turned.rotation.dot(scene.frame.model_from_dataset.rotation).abs() > 1.0 - 1e-12);

    run_program(
        PACK,
        folder.path(),
        &["transform", "scene.strivec", "-o", "moved.strivec", "--move=1,2,3", "--scale", "2"],
    );
    let moved = read(folder.path(), "moved.strivec");
    let seen = |scene: &Scene, origin: glam::DVec3, target: glam::DVec3| {
        let map = scene.frame.model_from_dataset;
        let (origin, target) = (map.point(origin), map.point(target));
        ReferenceRenderer::new(scene).trace(&[Ray { origin, direction: (target - origin).normalize() }])[0]
    };
    let from = scene.frame.model_from_dataset.inverse();
    let (eye, middle) = (from.point(scene.bounds.max * 2.0), from.point(scene.bounds.center()));
    let by = glam::DVec3::new(1.0, 2.0, 3.0);
    let (before, after) = (seen(&scene, eye, middle), seen(&moved, 2.0 * eye + by, 2.0 * middle + by));
    assert!(before.opacity > 0.01, "something is seen: {before:?}");
    assert!((0..3).all(|c| (before.color[c] - after.color[c]).abs() < 1e-6), "{before:?}, {after:?}");
}

#[test]
fn pruning_drops_components_and_hardly_changes_pictures() {
    let (folder, _) = folder();
    run_program(PACK, folder.path(), &["prune", "scene.strivec", "-o", "pruned.strivec", "--error", "1e-9"]);
    let output = pack(folder.path(), &["--json", "diff", "scene.strivec", "pruned.strivec"]);
    let difference: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert!(difference["psnr"].as_f64().is_none_or(|psnr| psnr > 45.0), "{difference}");
}

#[test]
fn a_file_taken_apart_goes_together_again() {
    let (folder, scene) = folder();
    run_program(PACK, folder.path(), &["notes", "scene.strivec", "--set", "author=me", "-o", "noted.strivec"]);
    json(folder.path(), &["extract", "noted.strivec", "-o", "parts"]);
    json(folder.path(), &["assemble", "parts", "-o", "again.strivec"]);
    assert_eq!(read(folder.path(), "again.strivec"), scene);
    let notes = json(folder.path(), &["notes", "again.strivec"]);
    assert_eq!(notes, serde_json::json!({ "author": "me" }));
    fail(folder.path(), &["extract", "noted.strivec", "-o", "parts"], 1, "parts");

    let density = folder.path().join("parts/scale0_density.npy");
    let whole = fs::read(&density).unwrap();
    let nested = [b"\x93NUMPY\x02\x00\x00\x00\x01\x00".as_slice(), &[b'('; 1 << 16]].concat();
    for (bytes, what) in [
        (nested.as_slice(), "scale0_density.npy"),
        (&whole[..whole.len() - 4], "scale0_density.npy"),
        (b"not numpy", "scale0_density.npy"),
        (&fs::read(folder.path().join("parts/scale0_matrix.npy")).unwrap(), "expected an array of lengths"),
    ] {
        fs::write(&density, bytes).unwrap();
        fail(folder.path(), &["assemble", "parts", "-o", "x.strivec"], 3, what);
    }
    fs::remove_file(&density).unwrap();
    fail(folder.path(), &["assemble", "parts", "-o", "x.strivec"], 2, "scale0_density.npy");
    fs::write(folder.path().join("parts/scene.json"), "{}").unwrap();
    fail(folder.path(), &["assemble", "parts", "-o", "x.strivec"], 3, "scene.json");
}

#[test]
fn notes_change_no_other_section() {
    let (folder, _) = folder();
    run_program(
        PACK,
        folder.path(),
        &["notes", "scene.strivec", "--set", "a=1", "--set", "b=2", "-o", "noted.strivec"],
    );
    run_program(PACK, folder.path(), &["notes", "noted.strivec", "--remove", "a", "-o", "fewer.strivec"]);
    assert_eq!(json(folder.path(), &["notes", "fewer.strivec"]), serde_json::json!({ "b": "2" }));
    let output = pack(folder.path(), &["--json", "diff", "scene.strivec", "fewer.strivec"]);
    let difference: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(difference["sections"], serde_json::json!(["NOTES"]));
}

#[test]
fn patterns_folders_and_pipes() {
    let (folder, scene) = folder();
    fs::copy(folder.path().join("scene.strivec"), folder.path().join("scene2.strivec")).unwrap();
    fs::create_dir(folder.path().join("out")).unwrap();
    let rows = json(folder.path(), &["convert", "scene*.strivec", "-o", "out", "--encoding", "f16"]);
    assert_eq!(rows.as_array().unwrap().len(), 2);
    assert!(folder.path().join("out/scene2.strivec").is_file());
    fail(folder.path(), &["info", "nothing*.strivec"], 2, "nothing*.strivec");
    fail(folder.path(), &["convert", "scene*.strivec", "-o", "-"], 1, "standard output");

    let mut piped = command(PACK, folder.path(), &["convert", "-", "-o", "-"]);
    let input = fs::File::open(folder.path().join("scene.strivec")).unwrap();
    let output = piped.stdin(Stdio::from(input)).output().unwrap();
    assert_eq!(code(&output), 0, "{}", String::from_utf8_lossy(&output.stderr));
    assert_eq!(decode(&output.stdout).unwrap(), scene);
}

#[test]
fn damage_and_what_is_not_supported_have_codes_of_their_own() {
    let (folder, _) = folder();
    let mut bytes = fs::read(folder.path().join("scene.strivec")).unwrap();
    let last = bytes.len() - 1;
    bytes[last] ^= 1;
    fs::write(folder.path().join("damaged.strivec"), &bytes).unwrap();
    let output = pack(folder.path(), &["--json", "verify", "damaged.strivec"]);
    assert_eq!(code(&output), 3);
    conforms(&serde_json::from_slice(&output.stdout).unwrap(), "verify");
    fail(folder.path(), &["info", "damaged.strivec"], 3, "damaged.strivec");
    let damaged = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("fixtures/skipped/damaged-thumbnail.strivec");
    let output = pack(folder.path(), &["--json", "verify", damaged.to_str().unwrap()]);
    assert_eq!(code(&output), 3);
    let rows: Value = serde_json::from_slice(&output.stdout).unwrap();
    conforms(&rows, "verify");
    assert_eq!((&rows[0]["skipped"][0]["class"], &rows[0]["class"]), (&"corrupt".into(), &Value::Null));
    let output = pack(folder.path(), &["info", damaged.to_str().unwrap()]);
    let warning = String::from_utf8(output.stderr.clone()).unwrap();
    assert_eq!(code(&output), 0);
    assert!(warning.contains("section THUMBNAIL is skipped: corrupt"), "{warning}");
    let newer = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("fixtures/v1/newer-codes.strivec");
    assert_eq!(code(&pack(folder.path(), &["verify", newer.to_str().unwrap()])), 0);
    fail(folder.path(), &["verify", "--strict", "scene.strivec"], 3, "probes");
    fail(folder.path(), &["info", "missing.strivec"], 2, "missing.strivec");
    let hostile = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("fixtures/hostile");
    for entry in fs::read_dir(hostile).unwrap().map(|entry| entry.unwrap().path()) {
        if entry.extension().is_some_and(|e| e == "strivec") {
            let output = pack(folder.path(), &["info", "--memory", "64", entry.to_str().unwrap()]);
            assert!([3, 5].contains(&code(&output)), "{}: {}", entry.display(), code(&output));
        }
    }
}

#[test]
fn balanced_vectors_have_the_same_products() {
    let (_, scene) = folder();
    let mut balanced = scene.clone();
    strivec_train::pack::balance(&mut balanced);
    assert_ne!(balanced, scene);
    for (before, after) in scene.scales.iter().zip(&balanced.scales) {
        let rows = strivec_format::model::Form::Cp.rows(before.cloud.resolution);
        let axes = strivec_format::model::Form::Cp.factors(before.cloud.resolution);
        let rank = before.factors.appearance_rank() as usize;
        let tensors =
            |values: &Vec<f32>| -> Vec<Vec<f32>> { values.chunks(rows * rank).map(<[f32]>::to_vec).collect() };
        let pairs =
            tensors(&before.factors.appearance[0].values).into_iter().zip(tensors(&after.factors.appearance[0].values));
        for (before, after) in pairs {
            for c in 0..rank {
                let largest = |values: &[f32], axis: usize| {
                    axes[axis].clone().map(|row| values[row * rank + c].abs()).fold(0.0, f32::max)
                };
                let product = |values: &[f32]| (0..3).map(|axis| largest(values, axis)).product::<f32>();
                assert!((product(&after) / product(&before) - 1.0).abs() < 1e-5);
                assert!((largest(&after, 0) / largest(&after, 2) - 1.0).abs() < 1e-5);
                // A product of single entries.
                let entry = |values: &[f32]| axes.iter().map(|axis| values[axis.start * rank + c]).product::<f32>();
                assert!((entry(&after) - entry(&before)).abs() <= 1e-5 * entry(&before).abs());
            }
        }
    }
}
