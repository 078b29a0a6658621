//! Photographs in, a file and pictures out: the commands one after another, on a tiny synthetic scene.

use crate::command;

use std::fs;
use std::process::Command;

use command::{json, run, strivec};
use tempfile::TempDir;

/// Small enough for seconds; the prior sees 32×32 pictures. Faint samples count to the end, so that few pixels are exactly
/// white, which 8 bits do not round.
const SETTINGS: &str = "
preset = \"fast\"
[model]
step = 1.0
[sampling]
batch_rays = 256
[schedule]
upsample_at = [40]
occupancy_at = [40, 80]
steps = 120
[prior]
voxels = 60000
steps = [100, 150]
rays = 1024
[bootstrap]
steps = [150, 250]
batch_rays = 256
resolution = 12
[[scales]]
pitch = [0.4, 0.4, 0.4]
edge = [0.6, 0.6, 0.6]
resolutions = [[7, 7, 7], [10, 10, 10]]
density_rank = 8
appearance_rank = 8
top_k = 2
[decoder]
hidden = [32]
[finish]
from = 1.0
";

#[test]
fn synth_train_info_render_and_eval_agree_with_each_other() {
    let temporary = TempDir::new().unwrap();
    let folder = temporary.path();
    fs::write(folder.join("tiny.toml"), SETTINGS).unwrap();
    run(folder, &["synth", "data", "--views", "20", "--test-views", "4", "--size", "32x32", "--seed", "3"]);
    let train = ["train", "data", "-o", "a.strivec", "--config", "tiny.toml", "--log", "a.csv", "--eval-every", "60"];
    let trained = json(folder, &[&train[..], &["--watch", "w.png"]].concat());
    assert_eq!(trained["steps"], 120);
    let png = fs::read(folder.join("w.png")).unwrap();
    let number = |at: usize| u32::from_be_bytes(png[at..at + 4].try_into().unwrap());
    assert_eq!([number(16), number(20)], [32 + 4 + 32, 32], "the scene beside the photograph");
    let log = fs::read_to_string(folder.join("a.csv")).unwrap();
    assert_eq!(log.lines().count(), 121, "a head and a row for each step of a short run");
    let evaluated: Vec<_> = log.lines().skip(1).filter(|row| !row.ends_with(',')).collect();
    assert!(evaluated.len() == 2 && evaluated[0].starts_with("60,") && evaluated[1].starts_with("120,"), "{log}");
    assert!(!folder.join("a.strivec.state").exists(), "a finished run leaves no state");

    // The file does not depend on the number of threads, and is not overwritten without `--force`.
    // Nor does it depend on whether the training is watched.
    let again = ["train", "data", "-o", "b.strivec", "--config", "tiny.toml", "--threads", "1", "--quiet"];
    run(folder, &again);
    assert!(fs::read(folder.join("a.strivec")).unwrap() == fs::read(folder.join("b.strivec")).unwrap());
    assert_eq!(strivec(folder, &again).status.code(), Some(1));

    let info = run(folder, &["info", "a.strivec"]);
    assert!(info.contains("lattice") && info.contains("10"), "{info}");

    // It learned something, on views that it did not see.
    let evaluation = json(folder, &["eval", "a.strivec", "data", "--split", "test"]);
    let psnr = evaluation["psnr"].as_f64().unwrap();
    assert!(psnr > 17.0, "{psnr} dB");

    // The fast renderer follows the reference on a trained scene.
    let compared = json(folder, &["eval", "a.strivec", "data", "--split", "test", "--parity"]);
    let parity = &compared["parity"];
    println!("{parity}");
    assert!(parity["clear_maximum"].as_f64().unwrap() < 2e-4, "{parity}");
    assert!(parity["near_999"].as_f64().unwrap() < 1e-2, "{parity}");
    assert!(parity["clear_rays"].as_u64().unwrap() > 3000, "{parity}");

    // An approximation is in the result, changes the picture, and is not supported by the reference.
    assert_eq!(evaluation["approximation"]["step_scale"], 1.0);
    let quick = ["eval", "a.strivec", "data", "--split", "test", "--step-scale", "4", "--decoder", "per-ray"];
    let approximated = json(folder, &quick);
    assert_eq!(approximated["approximation"]["step_scale"], 4.0);
    assert_eq!(approximated["approximation"]["decoder"], "per-ray");
    assert!((approximated["psnr"].as_f64().unwrap() - psnr).abs() > 1e-3, "{approximated}");
    for (wrong, expected) in [
        (["--top-k", "3"], "--top-k was removed; --step-scale"),
        (["--step-scale", "0"], "--step-scale must be 0.25 to 64; found 0"),
        (["--renderer=reference", "--step-scale=2"], "--backend reference renders without approximations"),
    ] {
        let output = strivec(folder, &[&["eval", "a.strivec", "data", "--quiet"][..], &wrong].concat());
        let message = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(output.status.code() == Some(1) && message.contains(expected), "{message}");
    }

    // Pictures that are rendered to files are those that are evaluated, to the rounding of 8 bits (58.9 dB): the
    // renderings, laid out as a dataset, are pictures of the scene.
    fs::create_dir(folder.join("copy")).unwrap();
    fs::copy(folder.join("data/transforms_test.json"), folder.join("copy/transforms_test.json")).unwrap();
    run(folder, &["render", "a.strivec", "--cameras", "data/transforms_test.json", "--out", "copy/test", "--depth"]);
    let copied = json(folder, &["eval", "a.strivec", "copy", "--split", "test", "--renderer", "reference"]);
    let psnr = copied["psnr"].as_f64().unwrap();
    assert!((57.0..61.0).contains(&psnr), "{psnr} dB");
}

#[test]
fn an_interrupted_training_goes_on_to_the_same_file() {
    let temporary = TempDir::new().unwrap();
    let folder = temporary.path();
    fs::write(folder.join("tiny.toml"), SETTINGS).unwrap();
    run(folder, &["synth", "data", "--views", "12", "--test-views", "2", "--size", "24x24", "--seed", "4"]);
    run(folder, &["train", "data", "-o", "whole.strivec", "--config", "tiny.toml", "--quiet"]);

    let arguments = ["train", "data", "-o", "cut.strivec", "--config", "tiny.toml", "--checkpoint-every", "10"];
    let mut child =
        Command::new(env!("CARGO_BIN_EXE_strivec")).current_dir(folder).args(arguments).arg("--quiet").spawn().unwrap();
    let state = folder.join("cut.strivec.state");
    while !state.exists() && child.try_wait().unwrap().is_none() {
        std::thread::sleep(std::time::Duration::from_millis(5));
    }
    let killed = child.try_wait().unwrap().is_none();
    child.kill().unwrap();
    child.wait().unwrap();
    assert!(killed && !folder.join("cut.strivec").exists(), "the run was cut short");

    let again = strivec(folder, &["train", "data", "-o", "cut.strivec", "--config", "tiny.toml"]);
    let message = String::from_utf8_lossy(&again.stderr).into_owned();
    assert!(again.status.code() == Some(1) && message.contains("--resume"), "{message}");
    let other = strivec(folder, &["train", "data", "-o", "cut.strivec", "--resume", "--seed", "9"]);
    assert_eq!(other.status.code(), Some(1), "a resumed run has its settings already");
    run(folder, &["train", "data", "-o", "cut.strivec", "--resume", "--quiet"]);
    assert!(fs::read(folder.join("whole.strivec")).unwrap() == fs::read(folder.join("cut.strivec")).unwrap());
    assert!(!state.exists());
}

#[test]
fn a_bootstrapped_and_pruned_training_says_what_it_left_out() {
    let temporary = TempDir::new().unwrap();
    let folder = temporary.path();
    fs::write(folder.join("tiny.toml"), SETTINGS).unwrap();
    run(folder, &["synth", "data", "--views", "16", "--test-views", "4", "--size", "32x32", "--seed", "3"]);
    let train = |output: &str, more: &[&str]| {
        json(folder, &[&["train", "data", "-o", output, "--config", "tiny.toml", "--bootstrap"], more].concat())
    };
    let kept = train("kept.strivec", &["--set", "schedule.prune=true", "--keep-dead"]);
    assert!(kept["dead_components"].is_null(), "{kept}");
    let cleared = train("cleared.strivec", &["--set", "schedule.prune=true"]);
    println!("{}", cleared["dead_components"]);
    let number = |key: &str| cleared["dead_components"][key].as_f64().unwrap();
    assert!(number("psnr_after") >= number("psnr_before") - 0.01);
    let parameters = |result: &serde_json::Value| result["parameters"].as_f64().unwrap();
    assert_eq!(parameters(&kept), parameters(&cleared) + number("parameters_saved"));
    let bytes = |result: &serde_json::Value| result["bytes"].as_u64().unwrap();
    assert!(if number("components_dropped") > 0.0 {
        bytes(&cleared) < bytes(&kept)
    } else {
        bytes(&cleared) == bytes(&kept)
    });
    let psnr = |file: &str| json(folder, &["eval", file, "data", "--split", "test"])["psnr"].as_f64().unwrap();
    let (all, without) = (psnr("kept.strivec"), psnr("cleared.strivec"));
    println!("{all:.3} dB, without dead components {without:.3} dB");
    assert!(without > 15.0 && (all - without).abs() < 0.1, "{all} and {without} dB");

    let message = |arguments: &[&str]| {
        let output = strivec(folder, arguments);
        assert_eq!(output.status.code(), Some(1));
        String::from_utf8_lossy(&output.stderr).into_owned()
    };
    assert!(
        message(&["train", "data", "-o", "c.strivec", "--resume", "--set", "schedule.prune=true"]).contains("--set")
    );
    let settings = run(folder, &["train", "--config", "tiny.toml", "--set", "schedule.prune=true", "--print-config"]);
    assert!(settings.contains("prune = true") && settings.contains("resolution = 12"), "{settings}");
}

#[test]
fn views_follow_refined_poses_and_an_opaque_capture_has_behind_it_what_is_seen_past_it() {
    let temporary = TempDir::new().unwrap();
    let folder = temporary.path();
    fs::write(folder.join("tiny.toml"), SETTINGS).unwrap();
    run(folder, &["synth", "data", "--views", "12", "--test-views", "3", "--size", "24x24", "--seed", "6"]);
    let train = ["train", "data", "-o", "a.strivec", "--config", "tiny.toml", "--quiet"];
    run(folder, &[&train[..], &["--set", "poses.refine=true", "--set", "decoder.hidden=[128, 128]"]].concat());
    assert_eq!(json(folder, &["info", "a.strivec"])["background"], serde_json::json!([1.0, 1.0, 1.0]));
    let eval =
        |poses: &[&str]| json(folder, &[&["eval", "a.strivec", "data"], poses].concat())["psnr"].as_f64().unwrap();
    let plain = eval(&[]);
    let refined = eval(&["--aligned-to", "a.strivec.poses.json"]);
    assert!((plain - refined).abs() < 1.0, "{plain} and {refined} dB");

    // The same poses, all moved by the same length along x.
    let path = folder.join("a.strivec.poses.json");
    let mut poses: serde_json::Value = serde_json::from_slice(&fs::read(&path).unwrap()).unwrap();
    for frame in poses["frames"].as_array_mut().unwrap() {
        let x = &mut frame["transform_matrix"][0][3];
        *x = (x.as_f64().unwrap() + 0.5).into();
    }
    fs::write(folder.join("moved.json"), poses.to_string()).unwrap();
    let moved = eval(&["--aligned-to", "moved.json"]);
    assert!(moved < refined - 1.0, "a shift shows: {moved} and {refined} dB");
    let compared = json(folder, &["compare", "a.strivec", "a.strivec", "data", "--aligned-to", "moved.json"]);
    for file in compared["files"].as_array().unwrap() {
        assert_eq!(file["psnr"].as_f64().unwrap(), moved);
    }

    for (text, expected) in [
        ("{", "not the refined poses"),
        (r#"{"frames": []}"#, "0 of its photographs"),
        (r#"{"frames": [{"file_path": "r_0", "transform_matrix": [[0,0,0,0],[0,0,0,0],[0,0,0,0],[0,0,0,1]]}]}"#, "r_0"),
    ] {
        fs::write(folder.join("wrong.json"), text).unwrap();
        let output = strivec(folder, &["eval", "a.strivec", "data", "--quiet", "--aligned-to", "wrong.json"]);
        let message = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(output.status.code() == Some(3) && message.contains(expected), "{message}");
    }

    // On white, which training leaves transparent, the background is nearer to white than the mean color.
    for entry in fs::read_dir(folder.join("data/train")).unwrap() {
        let path = entry.unwrap().path();
        let mut picture = image::open(&path).unwrap().to_rgba8();
        for pixel in picture.pixels_mut() {
            let alpha = u16::from(pixel[3]);
            let on_white = |channel: u8| ((u16::from(channel) * alpha + 255 * (255 - alpha)) / 255) as u8;
            *pixel = image::Rgba([on_white(pixel[0]), on_white(pixel[1]), on_white(pixel[2]), 255]);
        }
        image::DynamicImage::from(picture).to_rgb8().save(&path).unwrap();
    }
    run(folder, &["train", "data", "-o", "b.strivec", "--config", "tiny.toml", "--quiet"]);
    let behind = json(folder, &["info", "b.strivec"])["background"].clone();
    let views = strivec_capture::dataset::load(&folder.join("data"), "train", &Default::default()).unwrap().views;
    for channel in 0..3 {
        let found = behind[channel].as_f64().unwrap();
        let colors: Vec<f64> =
            views.iter().flat_map(|view| view.pixels.colors([1.0; 3])).map(|c| f64::from(c[channel])).collect();
        let mean = colors.iter().sum::<f64>() / colors.len() as f64;
        // This short training leaves some fog before objects, which counts.
        assert!(1.0 - found < 0.7 * (1.0 - mean), "{behind}, {mean}");
    }
}

#[test]
fn a_dataset_without_anything_in_it_is_named() {
    let temporary = TempDir::new().unwrap();
    let folder = temporary.path();
    run(folder, &["synth", "data", "--views", "6", "--test-views", "1", "--size", "16x16", "--seed", "5"]);
    for entry in fs::read_dir(folder.join("data/train")).unwrap() {
        image::RgbaImage::new(16, 16).save(entry.unwrap().path()).unwrap();
    }
    fs::write(folder.join("tiny.toml"), SETTINGS).unwrap();
    let output = strivec(folder, &["train", "data", "-o", "a.strivec", "--config", "tiny.toml", "--quiet"]);
    let message = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(3), "{message}");
    assert!(message.contains("empty") && message.lines().count() == 1, "{message}");
}
