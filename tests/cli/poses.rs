//! `strivec pose` with programs that write prepared results: stages, resuming, failures, left-out pictures.
#![cfg(unix)]

use std::ffi::OsStr;
use std::fs;
use std::os::unix::ffi::OsStrExt;
use std::os::unix::fs::{MetadataExt, PermissionsExt, symlink};
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};

use crate::command::{json_of, text};
use serde_json::Value;
use tempfile::TempDir;

/// The pictures in `photos`.
const NAMES: [&str; 6] = ["a.png", "b b.png", "c.png", "dark.png", "far.png", "twice.png"];

/// `calls` receives one line per stage; a file `fail-STAGE` makes the stage fail, a file `hang-STAGE` makes it wait.
const COLMAP: &str = r#"#!/bin/sh
PATH=/usr/bin:/bin
here=$(dirname "$0")
if [ "$1" = help ]; then echo "COLMAP $(cat "$here/version") -- Structure-from-Motion, $(cat "$here/groups")"; exit 0; fi
if [ "$2" = -h ]; then cat "$here/groups"; exit 0; fi
echo "$@" >> "$here/calls"
if [ -e "$here/hang-$1" ]; then sleep 30; fi
if [ -e "$here/fail-$1" ]; then
  i=0; while [ $i -lt 20 ]; do i=$((i + 1)); echo "line $i of $1"; done
  exit 1
fi
case "$1" in
  feature_extractor) echo "Processed file [6/6]"; touch database.db ;;
  mapper | global_mapper) if [ -e "$here/models" ]; then cp -r "$here/models/." sparse.partial; fi ;;
esac
"#;

/// Versions of pycolmap for `version`; other stages as above, from the arguments of the script.
const PYTHON: &str = r#"#!/bin/sh
PATH=/usr/bin:/bin
here=$(dirname "$0")
shift 2
stage=$1
if [ "$stage" = version ]; then
  if [ -e "$here/python-version" ]; then cat "$here/python-version"; exit 0; fi
  echo "No module named 'pycolmap'" >&2; exit 3
fi
echo "$@" >> "$here/calls"
case "$stage" in
  features) touch database.db ;;
  mapping) cp -r "$here/models/." sparse.partial ;;
esac
"#;

/// Ten frames, of which the fourth and the eighth are sharp.
const FFMPEG: &str = r#"#!/bin/sh
PATH=/usr/bin:/bin
here=$(dirname "$0")
if [ "$1" = -version ]; then echo "ffmpeg version 5.1"; exit 0; fi
echo "$@" >> "$here/calls"
case "$*" in
  *rawvideo*) for n in 0 1 2 3 4 5 6 7 8 9; do
      case $n in 3 | 7) cat "$here/sharp" ;; *) head -c 409600 /dev/zero ;; esac
    done ;;
  *) i=0; while [ $i -lt 5 ]; do touch "frame_0000$i.jpg"; i=$((i + 1)); done ;;
esac
"#;

const FFPROBE: &str = r#"#!/bin/sh
echo '{"streams": [{"avg_frame_rate": "10/1", "duration": "1.0"}], "format": {}}'
"#;

/// A folder with photographs in `photos` and programs in `programs`.
struct Place {
    folder: TempDir,
}

impl Place {
    fn new() -> Self {
        let place = Self { folder: TempDir::new().unwrap() };
        fs::create_dir(place.path("photos")).unwrap();
        for name in NAMES {
            image::RgbImage::new(8, 6).save(place.path("photos").join(name)).unwrap();
        }
        fs::create_dir(place.path("programs")).unwrap();
        place.program("colmap", COLMAP);
        fs::write(place.path("programs/version"), "3.8").unwrap();
        fs::write(place.path("programs/groups"), "--SiftExtraction.use_gpu --SiftMatching.use_gpu").unwrap();
        place.model("models/0", &["a.png", "b b.png", "c.png"], &[0.5, 1.0]);
        place
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn program(&self, name: &str, text: &str) {
        let path = self.path("programs").join(name);
        fs::write(&path, text).unwrap();
        fs::set_permissions(&path, fs::Permissions::from_mode(0o755)).unwrap();
    }

    /// A model of `pictures` with a point per error.
    fn model(&self, folder: &str, pictures: &[&str], errors: &[f64]) {
        let folder = self.path("programs").join(folder);
        fs::create_dir_all(&folder).unwrap();
        let mut images = (pictures.len() as u64).to_le_bytes().to_vec();
        for name in pictures {
            images.extend([0; 4 + 56 + 4]);
            images.extend(name.as_bytes());
            images.push(0);
            images.extend(2_u64.to_le_bytes());
            images.extend([7; 2 * 24]);
        }
        fs::write(folder.join("images.bin"), images).unwrap();
        let mut points = (errors.len() as u64).to_le_bytes().to_vec();
        for error in errors {
            points.extend([1; 8 + 24 + 3]);
            points.extend(error.to_le_bytes());
            points.extend(2_u64.to_le_bytes());
            points.extend([3; 16]);
        }
        fs::write(folder.join("points3D.bin"), points).unwrap();
        fs::write(folder.join("cameras.bin"), 0_u64.to_le_bytes()).unwrap();
    }

    fn command(&self, arguments: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_strivec"));
        command.current_dir(self.folder.path()).arg("pose").args(arguments);
        command.env("PATH", self.path("programs")).env_remove("PYTHON");
        command
    }

    fn run(&self, arguments: &[&str]) -> Output {
        self.command(arguments).output().unwrap()
    }

    fn report(&self, arguments: &[&str]) -> Value {
        json_of(&self.run(&[arguments, &["--json"]].concat()))
    }

    /// The message of a failure with `code`.
    fn failure(&self, arguments: &[&str], code: i32) -> String {
        let output = self.run(arguments);
        let message = text(&output.stderr);
        assert_eq!(output.status.code(), Some(code), "{message}");
        assert!(output.stdout.is_empty(), "{}", text(&output.stdout));
        message
    }

    /// The calls since the last time, one line each.
    fn calls(&self) -> Vec<String> {
        let calls = fs::read_to_string(self.path("programs/calls")).unwrap_or_default();
        let _ = fs::remove_file(self.path("programs/calls"));
        calls.lines().map(str::to_owned).collect()
    }

    /// The first word of each call since the last time.
    fn stages(&self) -> Vec<String> {
        self.calls().iter().map(|call| call.split_whitespace().next().unwrap().to_owned()).collect()
    }
}

const POSE: [&str; 3] = ["photos", "-o", "capture"];

fn pose<'a>(more: &[&'a str]) -> Vec<&'a str> {
    [&POSE[..], more].concat()
}

#[test]
fn stages_run_in_order_and_a_finished_capture_is_only_reported() {
    let place = Place::new();
    let report = place.report(&pose(&[]));
    let calls = place.calls();
    let stages: Vec<&str> = calls.iter().map(|call| call.split_whitespace().next().unwrap()).collect();
    assert_eq!(stages, ["feature_extractor", "exhaustive_matcher", "mapper"]);
    assert!(calls[0].contains("--ImageReader.camera_model OPENCV --ImageReader.single_camera 1"), "{}", calls[0]);
    assert!(calls[0].contains("--SiftExtraction.use_gpu 0"), "{}", calls[0]);
    assert!(calls[1].contains("--SiftMatching.use_gpu 0"), "{}", calls[1]);

    assert_eq!((&report["pictures"], &report["registered"], &report["points"]), (&6.into(), &3.into(), &2.into()));
    assert_eq!((&report["reprojection_error"], &report["models"]), (&0.75.into(), &serde_json::json!([3])));
    let names: Vec<&str> = report["stages"].as_array().unwrap().iter().map(|s| s["stage"].as_str().unwrap()).collect();
    assert_eq!(names, ["pictures", "features", "matching", "mapping"]);
    for name in NAMES {
        let (copy, photo) = (place.path("capture/images").join(name), place.path("photos").join(name));
        assert_eq!(fs::read(&copy).unwrap(), fs::read(&photo).unwrap(), "{name}");
        assert_ne!(fs::metadata(&copy).unwrap().ino(), fs::metadata(&photo).unwrap().ino(), "{name}");
    }
    for file in ["cameras.bin", "images.bin", "points3D.bin"] {
        assert!(place.path("capture/sparse/0").join(file).is_file(), "{file}");
    }
    assert!(!place.path("capture/sparse.partial").exists());

    assert_eq!(place.report(&pose(&[])), report);
    assert_eq!(place.calls(), [""; 0], "nothing is computed again");
    let output = place.run(&POSE);
    let messages = text(&output.stderr);
    assert!(messages.contains("matching: exhaustive (finished before)"), "{messages}");
    let result = text(&output.stdout);
    assert!(
        result.ends_with("capture: 3 of 6 pictures registered, 2 points, mean reprojection error 0.75 pixels\n"),
        "{result}"
    );
}

#[test]
fn left_out_pictures_are_named_with_the_usual_causes() {
    let place = Place::new();
    place.model("models/1", &["far.png", "a.png"], &[0.1]);
    let report = place.report(&pose(&[]));
    let left_out = report["left_out"].as_array().unwrap();
    let rows: Vec<[&str; 2]> =
        left_out.iter().map(|row| ["name", "reason"].map(|key| row[key].as_str().unwrap())).collect();
    assert_eq!(
        rows,
        [
            ["dark.png", "no pose"],
            ["far.png", "in the separate model sparse/1: few matches to the largest"],
            ["twice.png", "no pose"],
        ]
    );
    let result = text(&place.run(&POSE).stdout);
    assert!(
        result.contains("left out: dark.png: no pose\n") && result.contains("blurred, dark or without"),
        "{result}"
    );
}

#[test]
fn the_largest_model_becomes_the_first() {
    let place = Place::new();
    fs::rename(place.path("programs/models/0"), place.path("programs/models/1")).unwrap();
    place.model("models/0", &["far.png", "dark.png"], &[0.1]);
    place.model("models/10", &["dark.png"], &[]);
    let report = place.report(&pose(&[]));
    assert_eq!(report["models"], serde_json::json!([3, 2, 1]));
    let output = place.run(&POSE);
    assert!(
        text(&output.stdout)
            .contains("3 separate models: sparse/0 is the largest; the others, from sparse/1 on, have 2, 1 pictures")
    );
}

#[test]
fn a_stage_that_fails_shows_the_end_of_its_log_and_the_run_resumes_there() {
    let place = Place::new();
    fs::write(place.path("programs/fail-exhaustive_matcher"), "").unwrap();
    let message = place.failure(&pose(&["--quiet"]), 4);
    let expected =
        "strivec: matching: colmap failed (exit status: 1); its log capture/logs/matching.log ends with:\n  line 13 of";
    assert!(message.starts_with(expected), "{message}");
    assert!(message.ends_with("\n  line 20 of exhaustive_matcher\n"), "{message}");
    assert_eq!(place.stages(), ["feature_extractor", "exhaustive_matcher"]);
    fs::remove_file(place.path("programs/fail-exhaustive_matcher")).unwrap();
    place.report(&pose(&[]));
    assert_eq!(place.stages(), ["exhaustive_matcher", "mapper"]);
}

#[test]
fn a_mapping_without_a_model_says_so() {
    let place = Place::new();
    fs::rename(place.path("programs/models"), place.path("programs/away")).unwrap();
    let message = place.failure(&pose(&["--quiet"]), 4);
    assert!(message.contains("mapping: COLMAP found no model; if the pictures overlap too little"), "{message}");
    fs::rename(place.path("programs/away"), place.path("programs/models")).unwrap();
    place.calls();
    place.report(&pose(&[]));
    assert_eq!(place.stages(), ["mapper"]);
}

#[test]
fn an_interrupted_stage_ends_its_program_and_resumes() {
    let place = Place::new();
    fs::write(place.path("programs/hang-mapper"), "").unwrap();
    let child = place.command(&pose(&["--quiet"])).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let start = Instant::now();
    while !fs::read_to_string(place.path("programs/calls")).unwrap_or_default().contains("\nmapper ") {
        assert!(start.elapsed() < Duration::from_secs(60), "the stage of mapping begins");
        std::thread::sleep(Duration::from_millis(20));
    }
    let kill = Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap();
    assert!(kill.success());
    let begun = Instant::now();
    let output = child.wait_with_output().unwrap();
    assert!(begun.elapsed() < Duration::from_secs(20), "the program was not waited for");
    assert_eq!(output.status.code(), Some(4));
    assert_eq!(text(&output.stderr), "strivec: mapping: interrupted; the same command resumes\n");
    fs::remove_file(place.path("programs/hang-mapper")).unwrap();
    place.calls();
    place.report(&pose(&[]));
    assert_eq!(place.stages(), ["mapper"]);
}

#[test]
fn other_inputs_need_force_which_begins_anew() {
    let place = Place::new();
    place.report(&pose(&[]));
    place.calls();
    let message = place.failure(&pose(&["--camera-model", "PINHOLE", "--max-features", "500"]), 1);
    let expected = "strivec: capture: the capture was begun with other inputs: --camera-model was OPENCV, now PINHOLE; \
                    --max-features was 8192, now 500; --force begins anew\n";
    assert_eq!(message, expected);
    fs::write(place.path("capture/mine.txt"), "kept").unwrap();
    fs::write(place.path("capture/images/mine.png"), "kept").unwrap();
    fs::remove_file(place.path("photos/far.png")).unwrap();
    assert!(place.failure(&POSE, 1).contains("photographs was 6 files (checksum "));
    let report = place.report(&pose(&["--camera-each", "--force"]));
    assert_eq!(report["pictures"], 5);
    assert!(place.calls()[0].contains("--ImageReader.single_camera 0 --ImageReader.single_camera_per_image 1"));
    assert!(!place.path("capture/images/far.png").exists());
    assert!(place.path("capture/mine.txt").exists() && place.path("capture/images/mine.png").exists());
}

#[test]
fn missing_programs_are_named_with_how_to_install_them() {
    let place = Place::new();
    let missing = |arguments: &[&str]| place.failure(&pose(arguments), 4);
    fs::remove_file(place.path("programs/colmap")).unwrap();
    assert_eq!(
        missing(&[]),
        "strivec: COLMAP 3.8 or later, or pycolmap 4 or later, is needed, but colmap is not installed and python3 is not \
         installed; install one of them: apt install colmap, or pip install pycolmap\n"
    );
    place.program("python3", PYTHON);
    assert!(missing(&[]).contains("and python3 cannot import pycolmap (No module named 'pycolmap');"));
    fs::write(place.path("programs/python-version"), r#"{"version": "3.13.0", "global": false}"#).unwrap();
    assert!(missing(&["--program", "pycolmap"]).contains("but python3 has pycolmap 3.13.0; install it: pip install"));
    assert!(
        missing(&["--program", "colmap", "--colmap", "no/colmap"])
            .ends_with("is not installed; install it: apt install colmap\n")
    );
    place.program("colmap", COLMAP);
    fs::write(place.path("programs/version"), "3.7").unwrap();
    assert!(missing(&["--program", "colmap"]).contains("but colmap is version 3.7;"));
    fs::write(place.path("programs/version"), "3.8").unwrap();
    assert!(missing(&["--mapper", "global"]).contains("COLMAP 3.8 (colmap) has no global mapper"));
    assert!(!place.path("capture").exists(), "nothing was made on the way");
    fs::write(place.path("film.mp4"), "").unwrap();
    let message = place.failure(&["film.mp4", "-o", "capture"], 4);
    assert_eq!(message, "strivec: a video needs ffmpeg, which is not installed; install it: apt install ffmpeg\n");
}

#[test]
fn the_newer_program_is_used_and_newer_options_have_other_names() {
    let place = Place::new();
    place.program("python3", PYTHON);
    fs::write(place.path("programs/python-version"), r#"{"version": "4.2.1", "global": true}"#).unwrap();
    image::RgbImage::new(8, 6).save(place.path("photos/d.webp")).unwrap();
    let report = place.report(&pose(&["--mapper", "global"]));
    let skipped = "d.webp: a WebP picture, which pycolmap 4.2.1 (python3) does not read; convert it to JPEG or PNG";
    assert_eq!(report["skipped"], serde_json::json!([skipped]));
    assert_eq!(report["program"], "pycolmap 4.2.1 (python3)");
    let calls = place.calls();
    assert!(calls[0].starts_with("features --database database.db --threads "), "{}", calls[0]);
    assert!(calls[1].ends_with("--pairs exhaustive --block-size 10"), "{}", calls[1]);
    assert!(calls[2].ends_with("--output sparse.partial --mapper global"), "{}", calls[2]);

    fs::write(place.path("programs/version"), "4.3").unwrap();
    let groups = "--FeatureExtraction.use_gpu --FeatureMatching.use_gpu global_mapper";
    fs::write(place.path("programs/groups"), groups).unwrap();
    let report = place.report(&pose(&["--gpu", "--force", "--mapper", "global"]));
    assert_eq!((&report["program"], &report["pictures"]), (&"COLMAP 4.3 (colmap)".into(), &7.into()));
    let calls = place.calls();
    assert!(calls[0].contains("--FeatureExtraction.use_gpu 1"), "{}", calls[0]);
    assert!(calls[1].contains("--FeatureMatching.use_gpu 1"), "{}", calls[1]);
    assert_eq!(calls[2], "view_graph_calibrator --database_path database.db");
    let expected = "global_mapper --database_path database.db --image_path images --output_path sparse.partial";
    assert_eq!(calls[3..], [expected]);
}

#[test]
fn faster_ways_to_match_many_pairs_are_named() {
    let place = Place::new();
    let said = |arguments: &[&str]| text(&place.run(&pose(arguments)).stderr);
    assert!(!said(&[]).contains("pycolmap 4"), "few pairs need no advice");
    (0..60).for_each(|n| image::RgbImage::new(8, 6).save(place.path(&format!("photos/z{n}.png"))).unwrap());
    let said = said(&["--force", "--matching", "exhaustive"]);
    assert!(
        said.contains("matching: pycolmap 4 (pip install pycolmap) matched 292 photographs in a twentieth"),
        "{said}"
    );
    assert!(said.contains("pairs; --matching sequential tries "), "{said}");
}

#[test]
fn sequential_matching_without_a_vocabulary_tree_says_so() {
    let place = Place::new();
    let output = place.run(&pose(&["--matching", "sequential"]));
    assert!(text(&output.stderr).contains("matching: sequential without loop detection; --vocab-tree FILE adds it\n"));
    let call = &place.calls()[1];
    assert!(
        call.starts_with("sequential_matcher") && call.contains("--SequentialMatching.quadratic_overlap 1"),
        "{call}"
    );
    assert!(place.failure(&["photos", "-o", "other", "--vocab-tree", "absent"], 2).contains("absent: cannot read it"));
    fs::write(place.path("tree.bin"), "").unwrap();
    place.report(&["photos", "-o", "other", "--matching", "sequential", "--vocab-tree", "tree.bin"]);
    let call = &place.calls()[1];
    let expected = format!("--SequentialMatching.vocab_tree_path {}", place.path("tree.bin").display());
    assert!(call.contains("--SequentialMatching.loop_detection 1") && call.contains(&expected), "{call}");
}

#[test]
fn the_sharpest_frames_of_a_video_are_extracted() {
    let place = Place::new();
    place.program("ffmpeg", FFMPEG);
    place.program("ffprobe", FFPROBE);
    let sharp: Vec<u8> = (0..640 * 640).map(|n| if n / 8 % 2 == 0 { 0 } else { 255 }).collect();
    fs::write(place.path("programs/sharp"), sharp).unwrap();
    fs::write(place.path("a film.mp4"), "").unwrap();
    let report = place.report(&["a film.mp4", "-o", "capture", "--frames", "5", "--min-gap", "0.1"]);
    assert_eq!(report["pictures"], 5);
    let calls = place.calls();
    let film = place.path("a film.mp4");
    assert!(calls[0].contains(&format!("-i {} -map 0:v:0 -vf fps=10/1,scale=640:640", film.display())), "{}", calls[0]);
    let chosen = "select='eq(n,0)+eq(n,3)+eq(n,4)+eq(n,7)+eq(n,8)'";
    assert!(calls[1].contains(chosen), "{}", calls[1]);
    let listed = fs::read_to_string(place.path("capture/pictures.txt")).unwrap();
    assert!(listed.starts_with("frame_00000.jpg\n") && listed.ends_with("frame_00004.jpg\n"), "{listed}");
    let few = place.failure(&["a film.mp4", "-o", "few", "--frames", "5", "--min-gap", "0.5"], 3);
    assert!(few.contains("a film.mp4: too short for 3 frames"), "{few}");
}

#[test]
fn files_that_are_no_pictures_are_skipped_with_a_reason() {
    let place = Place::new();
    let photos = place.path("photos");
    fs::write(photos.join("notes.txt"), "text").unwrap();
    fs::write(photos.join("photo.webp"), "RIFF0000WEBPVP8 ").unwrap();
    fs::write(photos.join("broken.jpg"), b"\xff\xd8\xff\xe0").unwrap();
    fs::write(photos.join(".hidden"), "").unwrap();
    fs::create_dir(photos.join("more")).unwrap();
    fs::copy(photos.join("a.png"), photos.join(OsStr::from_bytes(b"caf\xe9.png"))).unwrap();
    symlink("nowhere", photos.join("lost.png")).unwrap();
    fs::rename(photos.join("c.png"), place.path("elsewhere")).unwrap();
    symlink("../elsewhere", photos.join("c.png")).unwrap();
    let report = place.report(&pose(&["--link"]));
    let skipped: Vec<&str> = report["skipped"].as_array().unwrap().iter().map(|s| s.as_str().unwrap()).collect();
    let starts = [
        "broken.jpg: cannot be decoded: ",
        "caf\u{fffd}.png: the name is not UTF-8",
        "lost.png: cannot be read: ",
        "more: a folder; its pictures are not used",
        "notes.txt: not a picture; the first bytes are ",
        "photo.webp: cannot be decoded: ",
    ];
    assert_eq!(skipped.len(), starts.len(), "{skipped:?}");
    for (skipped, start) in skipped.iter().zip(starts) {
        assert!(skipped.starts_with(start), "{skipped}");
    }
    let c = fs::symlink_metadata(place.path("capture/images/c.png")).unwrap();
    assert!(c.is_file());
    assert_eq!(c.ino(), fs::metadata(place.path("elsewhere")).unwrap().ino(), "a hard link to the link's target");
    let output = place.run(&pose(&["--link"]));
    assert!(text(&output.stderr).contains("skipped: 1 more\n"), "{}", text(&output.stderr));
}

#[test]
fn photographs_of_two_sizes_need_a_camera_each() {
    let place = Place::new();
    image::RgbImage::new(6, 8).save(place.path("photos/c.png")).unwrap();
    let message = place.failure(&POSE, 1);
    let expected = "photos: a.png has 8x6 pixels and c.png has 6x8, but one camera is shared; give pictures of one size, or --camera-each\n";
    assert!(message.ends_with(expected), "{message}");
    place.report(&pose(&["--camera-each"]));
}

#[test]
fn only_a_free_folder_becomes_a_capture() {
    let place = Place::new();
    fs::create_dir(place.path("capture")).unwrap();
    fs::write(place.path("capture/thesis.txt"), "").unwrap();
    for more in [&[][..], &["--force"]] {
        let message = place.failure(&pose(more), 1);
        let expected =
            "capture: the output folder must be new, empty or a capture of this command, but holds thesis.txt\n";
        assert!(message.ends_with(expected), "{message}");
    }
    let message = place.failure(&["photos", "-o", "photos"], 1);
    assert!(message.contains("photos: the folder of the photographs cannot be the output"), "{message}");
    assert!(place.failure(&["absent", "-o", "x"], 2).contains("absent: cannot read it"));
    fs::create_dir(place.path("few")).unwrap();
    fs::copy(place.path("photos/a.png"), place.path("few/a.png")).unwrap();
    let message = place.failure(&["few", "-o", "x"], 3);
    assert!(
        message.contains("few: 1 photograph in the folder; at least 3 JPEG, PNG, TIFF, WebP or BMP files are needed"),
        "{message}"
    );
    assert_eq!(place.calls(), [""; 0]);
}

#[test]
fn photographs_may_already_be_in_the_capture() {
    let place = Place::new();
    fs::create_dir(place.path("capture")).unwrap();
    fs::rename(place.path("photos"), place.path("capture/images")).unwrap();
    let inside = ["capture/images", "-o", "capture"];
    let report = place.report(&inside);
    assert_eq!(report["stages"][0]["found"], "6 photographs in place");
    place.report(&[&inside[..], &["--force"]].concat());
    assert_eq!(fs::read_dir(place.path("capture/images")).unwrap().count(), 6, "--force keeps them");

    let place = Place::new();
    place.report(&pose(&[]));
    let report = place.report(&[&inside[..], &["--force"]].concat());
    assert_eq!(report["stages"][0]["found"], "6 photographs in place", "the copies of the run before");

    let place = Place::new();
    fs::create_dir(place.path("capture")).unwrap();
    fs::rename(place.path("photos"), place.path("capture/photos")).unwrap();
    let report = place.report(&["capture/photos", "-o", "capture"]);
    assert_eq!(report["stages"][0]["found"], "6 photographs copied");
    assert!(Path::is_file(&place.path("capture/photos/a.png")) && Path::is_file(&place.path("capture/images/a.png")));
}
