//! The command `strivec paper` on a small dataset.
#![cfg(feature = "cli")]

use std::fs;
use std::path::Path;
use std::process::{Command, Output};
use std::time::SystemTime;

use serde_json::Value;

fn strivec(folder: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_strivec")).args(arguments).arg("--quiet").current_dir(folder).output().unwrap()
}

/// A prior in a second, few rays, and a scene that is seen from the first step on.
const TINY: &str = "
batch_rays = 64
factor_deviation = 1.0
occupancy_at = []
[field]
density_shift = 0.0
[prior]
voxels = 60000
steps = [100, 150]
rays = 1024
";

/// The table of rotations with the smallest of its models.
const ROTATION: [&str; 10] =
    ["paper", "rotation", "--data", "data", "--only", "tensorf-cp", "--config", "tiny.toml", "--steps", "8"];

fn table(folder: &Path, more: &[&str]) -> Output {
    strivec(folder, &[&ROTATION, more].concat())
}

fn json(output: &Output) -> Value {
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap()
}

/// The files in `paper`, and when each was written.
fn written(folder: &Path) -> Vec<(String, SystemTime)> {
    let mut files = Vec::new();
    for training in fs::read_dir(folder.join("paper")).unwrap() {
        for file in fs::read_dir(training.unwrap().path()).unwrap() {
            let file = file.unwrap();
            let name = file.path().strip_prefix(folder).unwrap().to_str().unwrap().to_owned();
            files.push((name, file.metadata().unwrap().modified().unwrap()));
        }
    }
    files.sort();
    files
}

#[test]
fn a_table_is_trained_once_and_printed_beside_the_papers() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let synth = ["synth", "data/lego", "--views", "20", "--test-views", "3", "--size", "32x32"];
    assert!(strivec(folder, &synth).status.success());
    fs::write(folder.join("tiny.toml"), TINY).unwrap();

    let report = json(&table(folder, &["--views", "1", "--json"]));
    let rows = report["rows"].as_array().unwrap();
    let names: Vec<&str> = rows.iter().map(|row| row["name"].as_str().unwrap()).collect();
    assert_eq!(names, ["TensoRF-CP, 0°", "TensoRF-CP, 5°", "TensoRF-CP, 45°"]);
    let psnr = |row: &Value| row["outcomes"][0]["psnr"].as_f64().unwrap();
    assert!(rows.iter().all(|row| psnr(row) > 3.0 && row["outcomes"][0]["views"] == 1));
    // The dataset is turned: the same training gives other pictures.
    assert!(psnr(&rows[0]) != psnr(&rows[2]), "{report}");
    assert_eq!(rows[0]["by_turn"], Value::Null);
    let [ours, paper] = [0, 1].map(|n| rows[2]["by_turn"][0][n].as_f64().unwrap());
    assert!((ours - (psnr(&rows[2]) - psnr(&rows[0]))).abs() < 1e-9);
    assert!((paper - (28.57 - 34.50)).abs() < 1e-9);

    // Nothing is trained twice; other views are measured.
    let scenes = |files: Vec<(String, SystemTime)>| -> Vec<(String, SystemTime)> {
        files.into_iter().filter(|(name, _)| name.ends_with(".strivec")).collect()
    };
    let before = scenes(written(folder));
    assert_eq!(before.len(), 3);
    assert_eq!(json(&table(folder, &["--views", "1", "--json"])), report);
    let other = json(&table(folder, &["--views", "3", "--json"]));
    assert_eq!(other["rows"][0]["outcomes"][0]["views"], 3);
    assert_eq!(scenes(written(folder)), before);

    let text = String::from_utf8(table(folder, &[]).stdout).unwrap();
    let line = text.lines().find(|line| line.starts_with("TensoRF-CP, 5°")).unwrap();
    assert!(text.contains("8 steps") && line.contains("-4.71") && line.contains("29.79"), "{text}");

    // A record of other settings is not overwritten.
    let other = table(folder, &["--seed", "1"]);
    let message = String::from_utf8_lossy(&other.stderr).into_owned();
    assert!(other.status.code() == Some(1) && message.contains("belongs to another training"), "{message}");
    let unknown = strivec(folder, &["paper", "main", "--data", "data", "--only", "13"]);
    let message = String::from_utf8_lossy(&unknown.stderr).into_owned();
    assert!(unknown.status.code() == Some(1) && message.contains("--only 13: the table has rows of"), "{message}");
}

#[test]
fn a_scene_without_a_record_is_trained_again() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    assert!(
        strivec(folder, &["synth", "data", "--views", "12", "--test-views", "1", "--size", "32x32"]).status.success()
    );
    fs::write(folder.join("tiny.toml"), TINY).unwrap();
    let speed =
        ["paper", "speed", "--data", "data", "--only", "tensorf-cp", "--config", "tiny.toml", "--steps", "4", "--json"];
    let report = json(&strivec(folder, &speed));
    let record = folder.join("paper/tensorf-cp/data.json");
    let mut stopped: Value = serde_json::from_slice(&fs::read(&record).unwrap()).unwrap();
    // As if it had been stopped before it recorded the training.
    (stopped["trained"], stopped["measured"]) = (Value::Null, Value::Null);
    fs::write(&record, stopped.to_string()).unwrap();
    let again = json(&strivec(folder, &speed));
    let psnr = |report: &Value| report["rows"][0]["outcomes"][0]["psnr"].clone();
    assert_eq!(psnr(&again), psnr(&report));
}
