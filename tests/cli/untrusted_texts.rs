//! Texts of files and names of files reach no terminal raw: control characters, marks of direction and separators of lines
//! are escaped in every output of both commands (spec 10).
#![cfg(unix)]

use crate::command::{output_of, text};
use crate::scenes;

use std::fs;
use std::path::Path;
use std::process::Output;

use strivec_format::container::{
    Codec, EncodeOptions, Encoding, Metadata, Quality, Section, SectionKind, UnknownSection, encode_scene_file,
};
use tempfile::TempDir;

/// Sets a terminal's title, begins a line, and reverses what follows.
const EVIL: &str = "\u{1b}]0;title\u{7}\r\nforged  line\u{202e}\u{9b}31m\u{2028}\u{2066}\u{200b}\u{7f}";
/// The name of a file, which has no slash.
const FILE: &str = "a\u{1b}]0;title\u{7}\r\nforged\u{202e}.strivec";

fn evil_scene(folder: &Path) {
    let mut scene = scenes::scene(&scenes::config());
    scene.scales.truncate(1);
    let provenance = &mut scene.provenance;
    (provenance.dataset, provenance.preset, provenance.tool) = (EVIL.into(), EVIL.into(), EVIL.into());
    let payload = EVIL.as_bytes().to_vec();
    let length = payload.len() as u64;
    let section = Section {
        kind: SectionKind::Other(*b"X-EVIL\0\0\0\0\0\0"),
        critical: false,
        scale: None,
        chunk: None,
        codec: Codec::Stored,
        offset: 0,
        length,
        decoded_length: length,
        checksum: crc32fast::hash(&payload),
        uses_reserved: false,
    };
    let metadata = Metadata {
        license: Some(EVIL.into()),
        quality: Some(Quality { test: Some(30.0), dataset: EVIL.into(), ..Quality::default() }),
        notes: [(EVIL.to_owned(), EVIL.to_owned()), ("trade".to_owned(), EVIL.to_owned())].into(),
        unknown: vec![UnknownSection { section, payload }],
        ..Metadata::default()
    };
    let bytes = encode_scene_file(&scene, &metadata, &EncodeOptions::uniform(Encoding::F32)).unwrap();
    fs::write(folder.join(FILE), &bytes).unwrap();
    let mut damaged = bytes;
    let last = damaged.len() - 1;
    damaged[last] ^= 1;
    fs::write(folder.join(format!("damaged {FILE}")), damaged).unwrap();
}

/// Checks that nothing raw reaches a stream of `output`.
#[track_caller]
fn check(output: &Output, arguments: &[&str]) {
    for stream in [&output.stdout, &output.stderr] {
        let text = std::str::from_utf8(stream).expect("UTF-8");
        let raw = text.chars().find(|&c| {
            (c.is_control() && c != '\n')
                || matches!(c, '\u{200b}'..='\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
        });
        assert_eq!(raw, None, "{arguments:?}: {text:?}");
        assert!(!text.lines().any(|line| line.trim_start().starts_with("forged")), "{arguments:?}: {text}");
    }
}

/// Runs `program` and returns both streams, which hold nothing raw.
#[track_caller]
fn run(program: &str, folder: &Path, arguments: &[&str]) -> String {
    let output = output_of(program, folder, arguments);
    check(&output, arguments);
    text(&output.stdout) + &text(&output.stderr)
}

#[test]
fn no_command_on_a_scene_prints_texts_raw() {
    let folder = TempDir::new().unwrap();
    let folder = folder.path();
    evil_scene(folder);
    let damaged = format!("damaged {FILE}");
    fs::create_dir(folder.join("out")).unwrap();
    let (strivec, pack) = (env!("CARGO_BIN_EXE_strivec"), env!("CARGO_BIN_EXE_strivec-pack"));
    let shown = "\\u{1b}]0;title\\u{7}\\r\\nforged";
    let missing = format!("missing {FILE}");
    let forged = format!("/{FILE}");
    let runs: [(&str, &[&str], bool); 33] = [
        (pack, &["info", FILE], true),
        (pack, &["info", "*.strivec"], true),
        (pack, &["info", &damaged], true),
        (pack, &["notes", FILE], true),
        (pack, &["verify", FILE], true),
        (pack, &["verify", "--strict", FILE], true),
        (pack, &["verify", "--render", &damaged], true),
        (pack, &["convert", FILE, "-o", "out", "--quality", "fast"], true),
        (pack, &["convert", FILE, "-o", "out"], true),
        (pack, &["convert", FILE, "-o", "out"], true),
        (pack, &["crop", FILE, "-o", &format!("crop {FILE}"), "--box=-1,-1,-1,0,1,1"], true),
        (pack, &["crop", FILE, "-o", "crop.strivec", "--box=90,90,90,99,99,99"], true),
        (pack, &["transform", FILE, "-o", &format!("moved {FILE}")], true),
        (pack, &["prune", FILE, "-o", &format!("pruned {FILE}")], true),
        (pack, &["diff", FILE, &format!("crop {FILE}"), "--no-pictures"], true),
        (pack, &["extract", FILE, "-o", "parts\u{1b}[2J\nforged"], false),
        (pack, &["assemble", "parts\u{1b}[2J\nforged", "-o", &format!("whole {FILE}")], true),
        (pack, &["assemble", FILE, "-o", "x.strivec"], true),
        (pack, &["notes", FILE, "-o", FILE, "--set", "a=b"], true),
        (pack, &["info", &missing], true),
        // A line feed of an argument stays.
        (pack, &["info", &format!("--{}", EVIL.replace('\n', ""))], false),
        (pack, &["pack", FILE, "-o", &format!("packed {FILE}"), "--lossless", "--effort", "0.01"], true),
        (pack, &["pack", FILE, "-o", "x.strivec", "--data", FILE], true),
        (strivec, &["info", FILE], true),
        (strivec, &["info", &damaged], true),
        (strivec, &["info", FILE, &missing], true),
        (strivec, &["render", FILE, "--orbit", "1", "--size", "8x8", "--out", "o\u{1b}[2J\nforged"], false),
        (strivec, &["render", FILE, "--orbit", "1", "--quality", "fast", "--out", "p"], true),
        (strivec, &["render", &damaged, "--orbit", "1", "--out", "p"], true),
        (strivec, &["render", FILE, "--cameras", &missing, "--out", "p"], true),
        (strivec, &["eval", FILE, &missing], true),
        (strivec, &["trade", FILE, "--data", &missing], true),
        (strivec, &["view", &forged], false),
    ];
    for (program, arguments, is_named) in runs {
        let text = run(program, folder, arguments);
        assert!(!is_named || text.contains(shown), "{arguments:?}: {text}");
        if arguments[0] == "view" {
            continue;
        }
        let arguments = [&["--json", "--force"], arguments].concat();
        run(program, folder, &arguments);
    }
    // The values are whole in JSON.
    let output = output_of(pack, folder, &["--json", "notes", FILE]);
    let notes: std::collections::BTreeMap<String, String> = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(notes[EVIL], EVIL);
}

#[test]
fn no_error_of_a_dataset_or_of_geometry_prints_texts_raw() {
    let folder = TempDir::new().unwrap();
    let folder = folder.path();
    let strivec = env!("CARGO_BIN_EXE_strivec");
    let evil = serde_json::to_string(EVIL).unwrap();
    let frames = |path: &str| {
        let matrix = "[[1,0,0,0],[0,1,0,0],[0,0,1,4],[0,0,0,1]]";
        format!("\"frames\": [{{\"file_path\": {path}, \"transform_matrix\": {matrix}}}]")
    };
    let transforms = [
        format!("{{\"camera_angle_x\": 0.7, {}}}", frames(&evil)),
        format!("{{\"camera_angle_x\": {evil}, {}}}", frames("\"a\"")),
        format!("{{\"camera_model\": {evil}, \"camera_angle_x\": 0.7, \"w\": 8, \"h\": 8, {}}}", frames("\"a\"")),
        format!("{{{evil}: 1}}"),
        format!("{{\"camera_angle_x\": 0.7, {}, \"ply_file_path\": {evil}}}", frames(&evil)),
    ];
    for (n, text) in transforms.iter().enumerate() {
        let dataset = format!("d{n}\u{1b}[2J\nforged");
        fs::create_dir(folder.join(&dataset)).unwrap();
        fs::write(folder.join(&dataset).join("transforms_train.json"), text).unwrap();
        for arguments in [&["dataset", "info", &dataset][..], &["train", &dataset, "-o", "x.strivec", "--steps", "1"]] {
            let text = run(strivec, folder, arguments);
            assert!(text.contains("\\u{1b}"), "{arguments:?}: {text}");
            run(strivec, folder, &[&["--json"], arguments].concat());
        }
    }
    let colmap = folder.join("colmap");
    fs::create_dir_all(colmap.join("sparse/0")).unwrap();
    fs::create_dir_all(colmap.join("images")).unwrap();
    let lines = EVIL.replace(['\r', '\n'], "");
    fs::write(colmap.join("sparse/0/cameras.txt"), format!("1 {lines} 8 8 8 4 4\n")).unwrap();
    fs::write(colmap.join("sparse/0/images.txt"), format!("1 1 0 0 0 0 0 0 1 {lines}.png\n\n")).unwrap();
    fs::write(colmap.join("sparse/0/points3D.txt"), format!("{lines}\n")).unwrap();
    run(strivec, folder, &["dataset", "info", "colmap"]);
    fs::write(colmap.join("sparse/0/cameras.txt"), "1 SIMPLE_PINHOLE 8 8 8 4 4\n").unwrap();
    run(strivec, folder, &["dataset", "info", "colmap"]);

    let name = "cloud\u{1b}[2J\nforged";
    for (ending, text) in [
        ("ply", format!("ply\nformat {lines} 1.0\nend_header\n")),
        ("ply", format!("ply\nformat ascii 1.0\nelement {lines} 1\nproperty {lines} x\nend_header\n1\n")),
        ("obj", format!("v 0 0 0\nf {lines}\n")),
        ("xyz", format!("{lines}\n")),
        ("off", format!("OFF\n{lines}\n")),
        ("pcd", format!("# .PCD v0.7\nFIELDS {lines}\n")),
        (lines.as_str(), "text".into()),
    ] {
        let file = format!("{name}.{ending}");
        fs::write(folder.join(&file), text).unwrap();
        let text = run(strivec, folder, &["--force", "prior", &file, "-o", "prior.npy", "--voxel", "0.1"]);
        assert!(ending == "obj" || text.contains("\\u{1b}"), "{file:?}: {text}");
    }
    fs::write(folder.join("evil.toml"), format!("schedule.steps = \"{lines}\"\n")).unwrap();
    let text = run(strivec, folder, &["train", "colmap", "-o", "x.strivec", "--config", "evil.toml"]);
    assert!(text.starts_with("strivec: evil.toml: ") && text.lines().count() > 2, "{text}");
    fs::write(folder.join("path.json"), format!("{{{evil}: 1}}")).unwrap();
    run(strivec, folder, &["render", "x.strivec", "--path", "path.json", "--out", "p"]);
}
