//! The command `strivec prior`: files of geometry to occupied cells.

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;
use std::process::Command;

use crate::command::{code, json, strivec, text};
use serde_json::Value;
use tempfile::TempDir;

fn done(folder: &Path, arguments: &[&str]) -> Value {
    json(folder, &[&["--force"], arguments].concat())
}

/// Exit code and message.
fn refused(folder: &Path, arguments: &[&str]) -> (i32, String) {
    let output = strivec(folder, &[&["--quiet", "--json", "--force"], arguments].concat());
    (code(&output), text(&output.stderr))
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|n| n.as_f64().unwrap()).collect()
}

fn toy() -> TempDir {
    let folder = TempDir::new().unwrap();
    done(folder.path(), &["synth", "toy", "--views", "6", "--test-views", "2", "--size", "32x32"]);
    folder
}

/// The corners of what was found.
fn corners(found: &Value) -> [Vec<f64>; 2] {
    [numbers(&found["bounds"][0]), numbers(&found["bounds"][1])]
}

fn assert_near(a: &[f64], b: &[f64], tolerance: f64) {
    assert!(a.iter().zip(b).all(|(a, b)| (a - b).abs() <= tolerance), "{a:?} and {b:?}");
}

#[test]
fn the_same_surface_is_found_in_every_file_of_it() {
    let toy = toy();
    let read = |file: &str| done(toy.path(), &["prior", file, "-o", "p.npz", "--voxel", "0.0213", "--data", "toy"]);
    let mesh = read("toy/mesh.ply");
    assert_eq!(mesh["triangles"], read("toy/mesh.obj")["triangles"]);
    let points = read("toy/points.ply");
    assert_eq!(points["points"], 100_000);
    assert_eq!(points["colored"], true);
    let occupancy = read("toy/occupancy.npz");
    for found in [&mesh, &points, &occupancy] {
        let [from, to] = corners(found);
        assert_near(&from, &[-0.95, -0.95, -0.86], 0.045);
        assert_near(&to, &[0.95, 0.95, 0.63], 0.045);
        let share = found["share_of_rays"].as_f64().unwrap();
        assert!((0.2..0.4).contains(&share), "{share}");
    }
    // Faces on the lattice's planes touch cells to one side or both, as their coordinates are rounded.
    let objects = read("toy/mesh.obj")["cells"].as_f64().unwrap();
    assert!((objects / mesh["cells"].as_f64().unwrap() - 1.0).abs() < 0.01);
    // Conservative: cells of the points are cells of the triangles, and the inside is added to these.
    let cells = |found: &Value| found["cells"].as_u64().unwrap();
    assert!(cells(&points) < cells(&mesh) && cells(&mesh) < cells(&occupancy));
}

#[test]
fn a_prior_reads_back_as_itself_and_joins_others() {
    let toy = toy();
    let first = done(toy.path(), &["prior", "toy/points.ply", "-o", "a.npz", "--voxel", "0.05"]);
    let again = done(toy.path(), &["prior", "a.npz", "-o", "b.npz"]);
    assert_eq!([&first["cells"], &first["colored"]], [&again["cells"], &again["colored"]]);
    assert_near(&corners(&first)[0], &corners(&again)[0], 1e-9);
    let half = |axis: &str, from: &str, out: &str| {
        let cells = done(toy.path(), &["prior", "a.npz", "-o", out, &format!("--crop={from}")])["cells"].as_u64();
        assert!(cells.unwrap() > 0, "{axis}");
    };
    half("left", "-2,-2,-2,0,2,2", "left.npz");
    half("right", "0,-2,-2,2,2,2", "right.npz");
    let joined = done(toy.path(), &["prior", "left.npz", "right.npz", "-o", "c.npz"]);
    assert_eq!(joined["cells"], first["cells"]);
}

#[test]
fn geometry_is_turned_scaled_and_moved() {
    let folder = TempDir::new().unwrap();
    // A line along y, in millimeters, y up.
    let lines: String = (0..100).map(|i| format!("0;{};0\n", 10 * i)).collect();
    fs::write(folder.path().join("line.txt"), lines).unwrap();
    let common = ["prior", "line.txt", "-o", "p.npz", "--voxel", "0.01", "--up", "y", "--scale", "0.001"];
    let [from, to] = corners(&done(folder.path(), &common));
    assert_near(&from, &[0.0, 0.0, 0.0], 1e-12);
    assert_near(&to, &[0.01, 0.01, 1.0], 1e-12);
    let moved = done(folder.path(), &[&common[..], &["--transform", "1,0,0,5,0,1,0,0,0,0,1,-1,0,0,0,1"]].concat());
    assert_near(&corners(&moved)[0], &[5.0, 0.0, -1.0], 0.011);
    let grown = done(folder.path(), &[&common[..], &["--dilate", "0.02"]].concat());
    assert_near(&corners(&grown)[1], &[0.03, 0.03, 1.02], 1e-12);
}

#[test]
fn outliers_and_sparse_cells_are_left_out() {
    let folder = TempDir::new().unwrap();
    let mut lines: String = (0..2000).map(|i| format!("{},{},0\n", i % 50, i / 50)).collect();
    lines += "25,20,40\n";
    fs::write(folder.path().join("cloud.csv"), lines).unwrap();
    let read = |more: &[&str]| {
        done(folder.path(), &[&["prior", "cloud.csv", "-o", "p.npz", "--voxel", "10"][..], more].concat())
    };
    assert_eq!(corners(&read(&[]))[1][2], 50.0);
    let cleaned = read(&["--outliers", "8,3"]);
    assert_eq!((&cleaned["outliers"], corners(&cleaned)[1][2]), (&Value::from(1), 10.0));
    assert_eq!(corners(&read(&["--min-points", "2"]))[1][2], 10.0);
}

/// `fixtures/import/gltf`: one scene, plain and compressed.
#[test]
fn compressed_gltf_occupies_the_cells_of_plain_gltf() {
    let fixtures = Path::new(env!("CARGO_MANIFEST_DIR")).join("fixtures/import/gltf");
    let folder = TempDir::new().unwrap();
    let out = folder.path().join("p.npz");
    // No vertex is within a quantization step of a border of these cells.
    let read = |name: &str| done(&fixtures, &["prior", name, "-o", out.to_str().unwrap(), "--voxel", "0.0937"]);
    let plain = read("plain.glb");
    assert_eq!((&plain["triangles"], &plain["colored"]), (&Value::from(652), &Value::from(true)));
    let compressed: Vec<_> = files_below(&fixtures, "").into_iter().filter(|name| name.ends_with(".glb")).collect();
    assert_eq!(compressed.len(), 7);
    for name in compressed {
        let found = read(&name);
        for key in ["triangles", "colored", "cells", "bounds"] {
            assert_eq!(found[key], plain[key], "{key} of {name}");
        }
    }
}

/// `fixtures/hostile-import`: malformed files and their errors, in 2 GiB of address space.
#[test]
fn hostile_files_are_refused_as_written() {
    let fixtures = Path::new(env!("CARGO_MANIFEST_DIR")).join("fixtures/hostile-import");
    let errors = fs::read_to_string(fixtures.join("errors.tsv")).unwrap();
    let listed: BTreeSet<_> = errors.lines().map(|line| line.split_once('\t').unwrap().0.to_owned()).collect();
    let mut there = files_below(&fixtures, "");
    assert!(["make.py", "errors.tsv"].iter().all(|name| there.remove(*name)));
    assert_eq!(there, listed);
    let folder = TempDir::new().unwrap();
    let out = folder.path().join("p.npz");
    for (name, expected) in errors.lines().map(|line| line.split_once('\t').unwrap()) {
        let mut command = in_bounded_memory(env!("CARGO_BIN_EXE_strivec"));
        let output = command.current_dir(&fixtures).args(["prior", name, "-o"]).arg(&out).output().unwrap();
        let message = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(3), "{name}: {message}");
        assert_eq!(message.trim_end(), format!("strivec: {name}: {expected}"));
        assert!(!out.exists(), "{name}");
    }
}

/// Names of all files in `folder`, with those of its folders before them.
fn files_below(folder: &Path, before: &str) -> BTreeSet<String> {
    let mut found = BTreeSet::new();
    for entry in fs::read_dir(folder).unwrap().map(Result::unwrap) {
        let name = before.to_owned() + entry.file_name().to_str().unwrap();
        if entry.path().is_dir() {
            found.append(&mut files_below(&entry.path(), &(name + "/")));
        } else {
            found.insert(name);
        }
    }
    found
}

#[cfg(unix)]
fn in_bounded_memory(program: &str) -> Command {
    let mut command = Command::new("sh");
    command.args(["-c", "ulimit -v 2097152 && exec \"$0\" \"$@\"", program]).env("RAYON_NUM_THREADS", "2");
    command
}

#[cfg(not(unix))]
fn in_bounded_memory(program: &str) -> Command {
    Command::new(program)
}

#[test]
fn too_little_to_go_by_is_said() {
    let folder = TempDir::new().unwrap();
    assert_eq!(refused(folder.path(), &["prior", "absent.ply", "-o", "p.npz"]).0, 2);
    fs::write(folder.path().join("one.xyz"), "1 2 3\n").unwrap();
    let (code, message) = refused(folder.path(), &["prior", "one.xyz", "-o", "p.npz"]);
    assert!(code == 3 && message.contains("one.xyz: ") && message.contains("--voxel"), "{message}");
    assert_eq!(done(folder.path(), &["prior", "one.xyz", "-o", "p.npz", "--voxel", "0.5"])["cells"], 1);
    assert_eq!(refused(folder.path(), &["prior", "one.xyz", "-o", "p.npz", "--voxel", "0"]).0, 1);
}

#[test]
fn training_begins_with_a_prior_from_a_file_and_says_where_it_is() {
    let toy = toy();
    let short = ["--preset", "fast", "--steps", "2", "--set", "sampling.batch_rays=64", "--keep-dead"];
    let trained =
        done(toy.path(), &[&["train", "toy", "-o", "a.strivec", "--prior", "toy/mesh.ply"], &short[..]].concat());
    assert!(trained["scales"][0]["tensors"].as_u64().unwrap() > 10);
    let beside = ["--transform", "1,0,0,50,0,1,0,0,0,0,1,0,0,0,0,1"];
    let report = done(toy.path(), &[&["prior", "toy/mesh.ply", "-o", "p.npz", "--data", "toy"][..], &beside].concat());
    assert!(report["share_of_rays"].as_f64().unwrap() < 0.01);
    assert!(report["advice"].as_str().unwrap().contains("beside"), "{}", report["advice"]);
    let shown = done(toy.path(), &["prior", "show", "p.npz", "toy/mesh.ply", "--data", "toy", "--out", "s.png"]);
    assert!(shown["share_of_rays"].as_f64().unwrap() > 0.2 && toy.path().join("s.png").exists());
}
