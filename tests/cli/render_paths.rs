//! `strivec render --path`: frames along a camera's way, and videos of them.

use crate::scenes;

use std::fs;
use std::path::Path;
use std::process::{Command, Output};

use strivec_format::container::{EncodeOptions, Encoding, encode};
use tempfile::TempDir;

/// A folder with a scene, scene.strivec.
fn folder() -> TempDir {
    let folder = TempDir::new().unwrap();
    let bytes = encode(&scenes::scene(&scenes::config()), &EncodeOptions::uniform(Encoding::F32)).unwrap();
    fs::write(folder.path().join("scene.strivec"), bytes).unwrap();
    folder
}

/// Renders small pictures, with `programs` for PATH.
fn render(folder: &Path, programs: &Path, arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_strivec"));
    command.current_dir(folder).env("PATH", programs);
    command.args(["render", "scene.strivec", "--quiet", "--force", "--size", "8x6", "--out", "frames"]).args(arguments);
    command.output().unwrap()
}

/// The names that were printed.
fn printed(output: &Output) -> Vec<String> {
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout.clone()).unwrap().lines().map(str::to_owned).collect()
}

/// The one line that the command failed with.
fn failure(output: &Output, code: i32) -> String {
    let message = String::from_utf8(output.stderr.clone()).unwrap();
    assert_eq!(output.status.code(), Some(code), "{message}");
    assert_eq!(message.lines().count(), 1, "{message}");
    message
}

/// The contents of `folder`, with hidden files.
fn listed(folder: &Path) -> Vec<String> {
    let entry = |entry: std::io::Result<fs::DirEntry>| entry.unwrap().file_name().into_string().unwrap();
    let mut names: Vec<String> = fs::read_dir(folder).unwrap().map(entry).collect();
    names.sort();
    names
}

const LOOKING: &str = r#""vertical_fov_degrees": 35, "target": [0, 0, 0], "up": [0, 0, 1]"#;

fn keyframes(list: &[(f64, [f64; 3])]) -> String {
    let one = |(seconds, position): &(f64, [f64; 3])| {
        format!("{{\"seconds\": {seconds}, \"position\": {position:?}, {LOOKING}}}")
    };
    let list: Vec<_> = list.iter().map(one).collect();
    format!(r#"{{"format": "strivec-camera-path", "version": 1, "keyframes": [{}]}}"#, list.join(","))
}

#[test]
fn a_turntable_is_an_orbit_of_frames() {
    let folder = folder();
    let frames = printed(&render(folder.path(), Path::new(""), &["--path", "turntable", "--frames", "3"]));
    assert_eq!(frames, ["frames/frame_0000.png", "frames/frame_0001.png", "frames/frame_0002.png"]);
    let orbit = printed(&render(folder.path(), Path::new(""), &["--orbit", "3"]));
    let bytes = |name: &String| fs::read(folder.path().join(name)).unwrap();
    assert!(frames.iter().zip(&orbit).all(|(frame, picture)| bytes(frame) == bytes(picture)));
    assert_ne!(bytes(&frames[0]), bytes(&frames[1]));
}

#[test]
fn frames_are_taken_at_even_times_through_the_keyframes() {
    let folder = folder();
    let there_and_back = keyframes(&[(1.0, [3.0, 0.0, 1.0]), (1.5, [0.0, 3.0, 1.0]), (2.0, [3.0, 0.0, 1.0])]);
    fs::write(folder.path().join("flight.json"), there_and_back).unwrap();
    let flight = |more: &[&str]| {
        let arguments = [&["--path", "flight.json"], more].concat();
        let frames = printed(&render(folder.path(), Path::new(""), &arguments));
        frames.iter().map(|name| fs::read(folder.path().join(name)).unwrap()).collect::<Vec<_>>()
    };
    // A second at ten frames a second, the last included.
    let frames = flight(&["--fps", "10"]);
    assert_eq!(frames.len(), 11);
    assert_eq!(frames[0], frames[10]);
    assert_ne!(frames[0], frames[5]);
    let few = flight(&["--frames", "3"]);
    assert_eq!(few, [&frames[0], &frames[5], &frames[10]].map(Clone::clone));
    assert_eq!(flight(&["--frames", "1"]), few[..1]);
}

#[test]
fn what_is_no_camera_path_is_3_and_names_file_and_place() {
    let folder = folder();
    let path = folder.path().join("flight.json");
    let refused = |text: &str, code| {
        fs::write(&path, text).unwrap();
        failure(&render(folder.path(), Path::new(""), &["--path", "flight.json"]), code)
    };
    for (text, expected) in [
        ("{", "flight.json: not the JSON of a camera path: EOF while parsing an object at line 1 column 1"),
        (&keyframes(&[]), "flight.json: a camera path must have at least one keyframe; found none"),
        (
            &keyframes(&[(1.0, [3.0, 0.0, 1.0]), (0.0, [0.0, 3.0, 1.0])]),
            "flight.json: keyframe 1: seconds must be from 1.000001 (after the previous keyframe) to 1000000; found 0.0",
        ),
    ] {
        let message = refused(text, 3);
        assert!(message.contains(expected), "{message}");
    }
    let message = refused(&keyframes(&[(0.0, [3.0, 0.0, 1.0]), (1e6, [0.0, 3.0, 1.0])]), 1);
    assert!(
        message.contains("1000000 seconds at 30 frames per second are 30000001 frames; at most 100000 are supported"),
        "{message}"
    );
    let message = failure(&render(folder.path(), Path::new(""), &["--path", "absent.json"]), 2);
    assert!(message.contains("absent.json: cannot read it: "), "{message}");
    let message = failure(&render(folder.path(), Path::new(""), &["--path", "flight.json", "--fov", "50"]), 1);
    assert!(message.contains("--path flight.json: the keyframes set the view; leave out --fov"), "{message}");
    assert!(!folder.path().join("frames").exists(), "nothing was made on the way");
}

#[test]
fn a_video_that_cannot_be_made_is_refused_before_any_frame() {
    let folder = folder();
    let none = folder.path().join("no programs");
    fs::create_dir(&none).unwrap();
    for (arguments, code, expected) in [
        (&["--video", "a.mp4"][..], 4, "ffmpeg with its encoder libx264 on PATH; found none. Install it ("),
        (&["--video", "a.webp"], 4, "img2webp, or ffmpeg with its encoder libwebp_anim, on PATH; found none"),
        (&["--video", "a.mp4"], 4, "or leave out --video to keep the frames as PNG files"),
        (&["--video", "a.gif"], 1, "--video a.gif: the name must end in .mp4 or .webp"),
        (&["--video", "a.mp4", "--size", "8x5"], 1, "--video: MP4 needs an even width and height; --size is 8x5"),
    ] {
        let arguments = [&["--path", "turntable"], arguments].concat();
        let mut command = Command::new(env!("CARGO_BIN_EXE_strivec"));
        command.current_dir(&folder).env("PATH", &none).args(["render", "scene.strivec", "--out", "frames"]);
        let message = failure(&command.args(arguments).output().unwrap(), code);
        assert!(message.contains(expected), "{message}");
    }
    assert_eq!(listed(folder.path()), ["no programs", "scene.strivec"]);
}

#[cfg(unix)]
mod with_programs {
    use std::os::unix::fs::PermissionsExt;

    use super::*;

    /// A folder with a program that runs the shell's `script`.
    fn program(folder: &Path, name: &str, script: &str) {
        fs::create_dir_all(folder.join("bin")).unwrap();
        let file = folder.join("bin").join(name);
        fs::write(&file, format!("#!/bin/sh\nPATH=/usr/bin:/bin\n{script}\n")).unwrap();
        fs::set_permissions(&file, fs::Permissions::from_mode(0o755)).unwrap();
    }

    /// Writes its arguments and the number of frames in place of a video.
    const FFMPEG: &str = r#"case "$*" in *-encoders*) echo " V....D libx264 H.264"; exit;; esac
for last; do :; done
echo "$* $(ls frame_*.png | wc -l)" > "$last""#;

    #[test]
    fn an_encoder_is_given_the_frames_and_only_a_whole_video_gets_its_name() {
        let folder = folder();
        let bin = folder.path().join("bin");
        program(folder.path(), "ffmpeg", FFMPEG);
        let turn = ["--path", "turntable", "--frames", "2", "--fps", "12.5", "--video", "turn.mp4"];
        let lines = printed(&render(folder.path(), &bin, &turn));
        assert_eq!(lines, ["frames/frame_0000.png", "frames/frame_0001.png", "turn.mp4"]);
        let video = fs::read_to_string(folder.path().join("turn.mp4")).unwrap();
        assert!(
            video.contains("-framerate 12.5 -start_number 0 -i frame_%04d.png -frames:v 2 -c:v libx264"),
            "{video}"
        );
        assert!(video.ends_with(" 2\n"), "{video}");
        assert_eq!(
            listed(&folder.path().join("frames")),
            ["frame_0000.png", "frame_0001.png"],
            "nothing is left behind"
        );

        program(folder.path(), "ffmpeg", &FFMPEG.replace("for last", "echo Broken. >&2; exit 7\nfor last"));
        let message = failure(&render(folder.path(), &bin, &turn), 4);
        assert!(
            message.contains("turn.mp4: ffmpeg failed: exit status: 7: Broken.; the frames are in frames"),
            "{message}"
        );
        assert_eq!(fs::read_to_string(folder.path().join("turn.mp4")).unwrap(), video, "the old one is left alone");
        assert_eq!(listed(&folder.path().join("frames")), ["frame_0000.png", "frame_0001.png"]);

        let webp = ["--path", "turntable", "--frames", "2", "--video", "turn.webp"];
        let message = failure(&render(folder.path(), &bin, &webp), 4);
        assert!(message.contains("found an ffmpeg without that encoder"), "{message}");
        program(folder.path(), "img2webp", r#"[ "$1" = -version ] || cp "$1" "${1%frames.txt}video""#);
        printed(&render(folder.path(), &bin, &webp));
        let script = fs::read_to_string(folder.path().join("turn.webp")).unwrap();
        assert!(script.contains("-d 33 frame_0000.png\n-d 34 frame_0001.png\n-o .video."), "{script}");
    }
}

#[test]
fn sixteen_bits_are_the_graphics_renderers() {
    let folder = folder();
    let message = failure(&render(folder.path(), Path::new(""), &["--orbit", "1", "--half"]), 1);
    assert!(message.contains("--half needs --backend gpu"), "{message}");
}

#[test]
#[cfg(not(feature = "gpu"))]
fn a_build_without_the_graphics_renderer_names_the_feature() {
    let folder = folder();
    let message = failure(&render(folder.path(), Path::new(""), &["--orbit", "1", "--backend", "gpu"]), 1);
    assert!(
        message.contains("needs a build with the feature gpu (cargo install --path . --features gpu)"),
        "{message}"
    );
    assert!(!folder.path().join("frames").exists(), "nothing was made on the way");
}

#[test]
fn cameras_are_drawn_with_their_lens_and_without_it_on_request() {
    let folder = folder();
    let draw = |k1: f64, options: &[&str]| -> Vec<u8> {
        let pose = [[1.0, 0.0, 0.0, 0.0], [0.0, 0.0, -1.0, -4.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]];
        let frames = [serde_json::json!({ "file_path": "a.png", "transform_matrix": pose })];
        let json = serde_json::json!({ "fl_x": 8.0, "w": 8, "h": 6, "k1": k1, "frames": frames });
        fs::write(folder.path().join("cameras.json"), json.to_string()).unwrap();
        let arguments = [&["--cameras", "cameras.json"], options].concat();
        let picture = printed(&render(folder.path(), Path::new(""), &arguments)).remove(0);
        image::open(folder.path().join(picture)).unwrap().into_rgb8().into_raw()
    };
    let pinhole = draw(0.0, &[]);
    assert!(pinhole.iter().any(|byte| *byte != pinhole[0]), "something is seen");
    assert_ne!(draw(0.5, &[]), pinhole, "the distortion shows");
    assert_eq!(draw(0.5, &["--undistort"]), pinhole, "it is gone");
}

/// Needs an adapter, as `tests/field/gpu.rs` does.
#[test]
#[cfg(feature = "gpu")]
fn the_graphics_renderer_draws_what_the_processor_does_and_says_on_what() {
    let folder = folder();
    let json = |arguments: &[&str]| -> (serde_json::Value, Vec<u8>) {
        let output = render(folder.path(), Path::new(""), &[&["--json", "--orbit", "1"], arguments].concat());
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        let report: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
        let picture = image::open(folder.path().join(report["files"][0].as_str().unwrap())).unwrap();
        (report, picture.into_rgb8().into_raw())
    };
    let (on_cpu, expected) = json(&["--renderer", "cpu"]);
    assert_eq!((&on_cpu["backend"], &on_cpu["adapter"]), (&"cpu".into(), &serde_json::Value::Null));
    let (on_gpu, found) = json(&["--backend", "gpu"]);
    assert_eq!(on_gpu["backend"], "gpu");
    assert!(on_gpu["adapter"].as_str().is_some_and(|adapter| adapter.len() > 3), "{on_gpu}");
    if let Some(stages) = on_gpu["stages"].as_array() {
        assert!(stages.iter().any(|stage| stage["stage"] == "march" && stage["milliseconds"].as_f64() > Some(0.0)));
    }
    let close = |found: &[u8], by: u8| found.iter().zip(&expected).filter(|(a, b)| a.abs_diff(**b) > by).count();
    assert_eq!(found.len(), expected.len());
    assert!(expected.iter().any(|byte| *byte != expected[0]), "something is seen");
    assert!(close(&found, 1) * 20 < found.len(), "{found:?}, {expected:?}");
    let (on_gpu, half) = json(&["--backend", "gpu", "--half"]);
    assert_eq!(on_gpu["half"], true);
    assert!(close(&half, 3) * 20 < half.len(), "{half:?}, {expected:?}");
}
