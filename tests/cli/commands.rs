//! The behavior of the commands: exit codes, standard output and error, one line per error.

use std::fs;
use std::path::Path;
use std::process::{Command, Output};

use crate::command::{PACK, STRIVEC, code, command, json_of, pack, printed, run, strivec, text};
use tempfile::TempDir;

/// Checks that the command failed with `code` and one line on standard error, which is returned.
fn failure(output: &Output, expected: i32) -> String {
    let message = text(&output.stderr);
    assert_eq!(code(output), expected, "{message}");
    assert!(message.starts_with("strivec: "), "{message}");
    assert_eq!(message.lines().count(), 1, "{message}");
    assert!(output.stdout.is_empty(), "{}", text(&output.stdout));
    message
}

#[test]
fn help_and_version_are_results() {
    let folder = TempDir::new().unwrap();
    for arguments in [&["--help"][..], &["--version"], &["render", "--help"], &["help", "eval"]] {
        let output = strivec(folder.path(), arguments);
        assert_eq!(code(&output), 0, "{arguments:?}");
        assert!(!output.stdout.is_empty() && output.stderr.is_empty(), "{arguments:?}");
    }
    assert_eq!(
        text(&strivec(folder.path(), &["--version"]).stdout),
        format!("strivec {}\n", strivec::version::version())
    );
}

#[test]
fn wrong_usage_is_1_and_says_so_on_standard_error() {
    let folder = TempDir::new().unwrap();
    for arguments in [
        &[][..],
        &["nonsense"],
        &["info"],
        &["--threads", "0", "info", "a"],
        &["render", "a", "--out", "b"],
        &["render", "a", "--out", "b", "--orbit", "0"],
        &["render", "a", "--out", "b", "--orbit", "3", "--pose", "1"],
        &["render", "a", "--out", "b", "--orbit", "3", "--downscale", "2"],
        &["render", "a", "--out", "b", "--orbit", "3", "--size", "0x5"],
        &["render", "a", "--out", "b", "--orbit", "3", "--elevation", "90"],
        &["render", "a", "--out", "b", "--orbit", "3", "--step-scale", "long"],
        &["render", "a", "--out", "b", "--orbit", "3", "--backend", "fast"],
        &["render", "a", "--out", "b", "--orbit", "3", "--frames", "2"],
        &["render", "a", "--out", "b", "--orbit", "3", "--fps", "2"],
        &["render", "a", "--out", "b", "--orbit", "3", "--video", "b.mp4"],
        &["render", "a", "--out", "b", "--orbit", "3", "--path", "turntable"],
        &["render", "a", "--out", "b", "--path", "turntable", "--frames", "0"],
        &["render", "a", "--out", "b", "--path", "turntable", "--fps", "0"],
        &["render", "a", "--out", "b", "--path", "turntable", "--downscale", "2"],
        &["eval", "a", "b", "--views", "5"],
        &["train", "a"],
        &["train", "a", "-o", "b", "--preset", "7"],
        &["train", "a", "-o", "b", "--set", "space.near_far=[2]"],
    ] {
        let output = strivec(folder.path(), arguments);
        assert_eq!(code(&output), 1, "{arguments:?}: {}", text(&output.stderr));
        assert!(output.stdout.is_empty() && !output.stderr.is_empty(), "{arguments:?}");
    }
}

#[test]
fn an_absent_file_is_2_and_names_it() {
    let folder = TempDir::new().unwrap();
    for arguments in [
        &["info", "absent.strivec"][..],
        &["render", "absent.strivec", "--orbit", "1", "--out", "frames"],
        &["eval", "absent.strivec", "."],
    ] {
        let message = failure(&strivec(folder.path(), arguments), 2);
        assert!(message.contains("absent.strivec: cannot read it: "), "{message}");
    }
    assert_eq!(fs::read_dir(&folder).unwrap().count(), 0, "nothing was made on the way");
}

#[test]
fn a_malformed_file_is_3_and_names_it() {
    let folder = TempDir::new().unwrap();
    fs::write(folder.path().join("text.strivec"), "This is no scene.\n").unwrap();
    let message = failure(&strivec(folder.path(), &["info", "text.strivec"]), 3);
    assert!(message.contains("text.strivec: "), "{message}");
}

/// The smallest dataset.
const SYNTH: [&str; 8] = ["synth", "toy", "--views", "1", "--test-views", "1", "--size", "8x8"];

fn synth<'a>(more: &[&'a str]) -> Vec<&'a str> {
    [&SYNTH[..], more].concat()
}

#[test]
fn results_are_on_standard_output_and_messages_are_silenced_by_quiet() {
    let folder = TempDir::new().unwrap();
    let output = strivec(folder.path(), &synth(&[]));
    assert_eq!(code(&output), 0);
    assert!(text(&output.stdout).starts_with("toy: 3 pictures, "), "{}", text(&output.stdout));
    assert!(!output.stderr.is_empty());

    let output = strivec(folder.path(), &synth(&["--quiet", "--json", "--force"]));
    let json = json_of(&output);
    assert_eq!((&json["folder"], &json["pictures"]), (&"toy".into(), &3.into()));
    assert_eq!(text(&output.stderr), "");
}

#[test]
fn nothing_is_overwritten_without_force() {
    let folder = TempDir::new().unwrap();
    fs::create_dir(folder.path().join("toy")).unwrap();
    fs::write(folder.path().join("toy/mine"), "old").unwrap();
    let message = failure(&strivec(folder.path(), &synth(&["--quiet"])), 1);
    assert!(message.contains("toy: the output folder must be new or empty"), "{message}");
    assert_eq!(fs::read_dir(folder.path().join("toy")).unwrap().count(), 1);
    assert_eq!(code(&strivec(folder.path(), &synth(&["--quiet", "--force"]))), 0);
    assert_eq!(fs::read_to_string(folder.path().join("toy/mine")).unwrap(), "old");
}

#[test]
fn a_reader_that_leaves_is_no_failure() {
    let folder = TempDir::new().unwrap();
    for arguments in [&["--help"][..], &synth(&["--quiet"])] {
        let (reader, writer) = std::io::pipe().unwrap();
        drop(reader);
        let output = command(STRIVEC, folder.path(), arguments).stdout(writer).output().unwrap();
        assert_eq!(code(&output), 0, "{arguments:?}");
        assert_eq!(text(&output.stderr), "", "{arguments:?}");
    }
}

#[test]
#[cfg(target_os = "linux")]
fn results_that_cannot_be_written_are_2() {
    let folder = TempDir::new().unwrap();
    let full = fs::OpenOptions::new().write(true).open("/dev/full").unwrap();
    let output = command(STRIVEC, folder.path(), &synth(&["--quiet"])).stdout(full).output().unwrap();
    let message = failure(&output, 2);
    assert!(message.contains("standard output"), "{message}");
}

#[test]
fn a_plan_is_made_kept_within_its_budget_and_printed_as_settings() {
    let folder = TempDir::new().unwrap();
    let synth = ["synth", "toy", "--views", "12", "--test-views", "1", "--size", "32x32", "--quiet"];
    assert_eq!(code(&strivec(folder.path(), &synth)), 0);
    let short = "preset = \"24\"\n[prior]\nvoxels = 30000\nsteps = [100, 100]\nrays = 512\nmin_views = 1\n";
    fs::write(folder.path().join("short.toml"), short).unwrap();
    let plan = |more: &[&str]| strivec(folder.path(), &[&["plan", "toy", "--config", "short.toml"], more].concat());

    let json = json_of(&plan(&["--auto", "--max-params", "200k", "--set", "lean.max_loss=0", "--json"]));
    let number = |name: &str| json[name].as_f64().unwrap_or_else(|| panic!("{name}: {json}"));
    assert!(number("parameters") <= 200e3 && number("parameters") > 1e3, "{json}");
    assert!(number("file_bytes") > number("parameters") && number("minutes") > 0.0, "{json}");
    let of_scales: f64 = json["scales"].as_array().unwrap().iter().map(|s| s["parameters"].as_f64().unwrap()).sum();
    assert_eq!(of_scales + number("decoder_parameters"), number("parameters"));
    assert!(json["reasons"].as_array().unwrap().len() >= 3, "{json}");
    let lean = json_of(&plan(&["--auto", "--max-params", "200k", "--json"]));
    assert_eq!(lean["parameters"], 200_000, "training begins with more: {lean}");
    assert_eq!((&json["gives_up_parameters"], &lean["gives_up_parameters"]), (&false.into(), &true.into()));
    assert!(text(&plan(&["--auto", "--max-params", "200k"]).stdout).contains("at most 200 000"));
    let at_first: u64 = lean["scales"].as_array().unwrap().iter().map(|s| s["parameters"].as_u64().unwrap()).sum();
    assert!((200_001..=2_000_000).contains(&at_first), "{lean}");

    let planned = printed(&plan(&["--auto", "--max-params", "200k", "--print-config", "--quiet"]));
    fs::write(folder.path().join("planned.toml"), &planned).unwrap();
    let train = ["train", "--config", "planned.toml", "--print-config"];
    assert_eq!(text(&strivec(folder.path(), &train).stdout), planned);

    let message = failure(&plan(&["--max-size", "9B", "--quiet"]), 1);
    assert!(
        message.contains("--max-params or --max-size must be at least ") && message.ends_with("; found 9 bytes\n"),
        "{message}"
    );
    let output = strivec(folder.path(), &["train", "toy", "-o", "b", "--auto", "--print-config"]);
    assert_eq!(code(&output), 1, "it needs the photographs");
}

#[test]
fn training_that_diverges_is_4_and_says_what_to_change() {
    let folder = TempDir::new().unwrap();
    run(folder.path(), &["synth", "data", "--views", "4", "--test-views", "1", "--size", "24x24", "--quiet"]);
    let wild = "preset = \"24\"\nsampling.batch_rays = 64\noptimizer.factor_learning_rate = 1e6\n";
    fs::write(folder.path().join("wild.toml"), wild).unwrap();
    let prior = ["--prior", "data/mesh.ply", "--max-params", "400k", "--quiet"];
    let train = ["train", "data", "-o", "wild.strivec", "--config", "wild.toml", "--steps", "40"];
    let message = failure(&strivec(folder.path(), &[&train[..], &prior].concat()), 4);
    assert!(message.contains("diverged") && message.contains("factor_learning_rate"), "{message}");
    assert!(!folder.path().join("wild.strivec").exists());
}

#[test]
fn shrink_asks_for_one_goal_and_writes_a_smaller_file_and_grow_a_larger_one() {
    let folder = TempDir::new().unwrap();
    let quiet = |arguments: &[&str]| strivec(folder.path(), &[arguments, &["--quiet"]].concat());
    assert_eq!(code(&quiet(&["synth", "data", "--views", "6", "--test-views", "1", "--size", "32x32"])), 0);
    let small = "preset = \"48\"\nsampling.batch_rays = 128\nschedule = { upsample_at = [], occupancy_at = [100] }\n[[scales]]\npitch = [0.5, 0.5, 0.5]\nedge = [0.8, 0.8, 0.8]\n\
        resolutions = [[12, 12, 12]]\ndensity_rank = 8\nappearance_rank = 12\ntop_k = 2\n";
    fs::write(folder.path().join("small.toml"), small).unwrap();
    let train =
        ["train", "data", "-o", "a.strivec", "--config", "small.toml", "--steps", "150", "--set", "lean.max_loss=0"];
    let known = ["--prior", "data/mesh.ply", "--set", "space.near_far=[2.0154, 6.0463]"];
    printed(&quiet(&[&train[..], &known].concat()));
    let shrink = ["shrink", "a.strivec", "data", "-o", "b.strivec", "--config", "small.toml", "--steps", "60"];
    let with = |more: &[&str]| quiet(&[&shrink[..], more].concat());
    for wrong in
        [&[][..], &["--max-params", "40k", "--max-loss", "1"], &["--max-loss", "-1"], &["--max-params", "none"]]
    {
        assert_eq!(code(&with(wrong)), 1, "{wrong:?}");
    }
    let report = json_of(&with(&["--max-params", "40k", "--picture", "cells.png", "--json"]));
    let after = report["parameters"][1].as_u64().unwrap();
    assert!(after <= 40_000 && report["parameters"][0].as_u64().unwrap() > after, "{report}");
    assert_eq!(report["cells"].as_array().unwrap().len(), 3);
    let size = |name: &str| fs::metadata(folder.path().join(name)).unwrap().len();
    assert!(size("b.strivec") < size("a.strivec") && size("cells.png") > 1000);
    let message = failure(&with(&["--max-params", "40k"]), 1);
    assert!(message.contains("b.strivec"), "{message}");

    let within = ["shrink", "b.strivec", "data", "-o", "same.strivec", "--config", "small.toml", "--steps", "3"];
    let report = printed(&quiet(&[&within[..], &["--max-params", "40k"]].concat()));
    assert!(report.contains("the scene meets the goal already: it is written unchanged"), "{report}");
    // The bytes differ in the stated rounding error alone, which is 0 the second time.
    let scene = |name: &str| strivec_format::container::decode(&fs::read(folder.path().join(name)).unwrap()).unwrap();
    assert!(scene("same.strivec") == scene("b.strivec"), "the scene changed");
}

/// A folder with a scene, `scene.strivec`.
fn folder_with_scene() -> TempDir {
    let folder = TempDir::new().unwrap();
    let fixture = concat!(env!("CARGO_MANIFEST_DIR"), "/fixtures/v1/f32.strivec");
    fs::copy(fixture, folder.path().join("scene.strivec")).unwrap();
    folder
}

/// Standard output, standard error and exit code of `strivec-pack`.
fn packed(folder: &Path, arguments: &[&str]) -> (String, String, i32) {
    let output = pack(folder, arguments);
    (text(&output.stdout), text(&output.stderr), code(&output))
}

#[test]
fn all_inputs_are_reported_and_the_worst_error_is_the_exit_code() {
    let folder = folder_with_scene();
    fs::write(folder.path().join("mesh.ply"), "ply\nformat ascii 1.0\n").unwrap();
    let output = strivec(folder.path(), &["info", "absent.strivec", "mesh.ply", "scene.strivec", "scene.strivec"]);
    assert_eq!(code(&output), 3);
    assert_eq!(text(&output.stdout).matches("file        scene.strivec").count(), 2);
    let messages = text(&output.stderr);
    assert!(
        messages.contains("absent.strivec: cannot read it") && messages.contains("begins like a PLY file"),
        "{messages}"
    );

    let (result, message, code) = packed(folder.path(), &["verify", "mesh.ply", "scene.strivec"]);
    assert!(code == 3 && result.contains("mesh.ply: failed") && result.contains("scene.strivec: valid"), "{result}");
    assert_eq!((message.lines().count(), result.contains("PLY file")), (1, false), "the error is printed once");
}

#[test]
fn a_damaged_thumbnail_closes_no_scene() {
    let folder = folder_with_scene();
    let damaged = concat!(env!("CARGO_MANIFEST_DIR"), "/fixtures/skipped/damaged-thumbnail.strivec");
    let arguments = ["render", damaged, "--out", "out", "--orbit", "1", "--size", "8x8"];
    for arguments in [&["info", damaged][..], &arguments] {
        let output = strivec(folder.path(), arguments);
        let messages = text(&output.stderr);
        assert_eq!(code(&output), 0, "{messages}");
        assert!(messages.contains("warning: ") && messages.contains("section THUMBNAIL is skipped"), "{messages}");
    }
    let newer = concat!(env!("CARGO_MANIFEST_DIR"), "/fixtures/hostile/major-2.strivec");
    assert_eq!([code(&strivec(folder.path(), &["info", newer])), packed(folder.path(), &["info", newer]).2], [5, 5]);
}

#[test]
fn info_reads_standard_input() {
    let folder = folder_with_scene();
    let input = fs::File::open(folder.path().join("scene.strivec")).unwrap();
    let output = command(STRIVEC, folder.path(), &["info", "-"]).stdin(input).output().unwrap();
    assert!(printed(&output).contains("parameters"));
}

#[test]
fn output_names_of_other_formats_are_refused() {
    let folder = folder_with_scene();
    for name in ["a.ply", "a.SPZ", "a.obj", "a.glb", "a.npz", "a.png"] {
        let message = failure(&strivec(folder.path(), &["train", "data", "-o", name]), 1);
        assert!(message.contains("the output is a .strivec file"), "{message}");
        let (_, message, code) = packed(folder.path(), &["convert", "scene.strivec", "-o", name]);
        assert!(code == 1 && message.contains("the output is a .strivec file"), "{message}");
    }
}

#[test]
fn edited_files_keep_their_encoding_and_growth_is_reported() {
    let folder = folder_with_scene();
    let size = |name: &str| fs::metadata(folder.path().join(name)).unwrap().len();
    // Packing adds to the file: the section QUALITY, its row in the section table and padding.
    const QUALITY: u64 = 128;
    for encode in [
        &["convert", "--encoding", "f16"][..],
        &["convert", "--encoding", "grid6"],
        &["pack", "--quality", "small", "--effort", "0.01", "--no-views", "--no-prefixes"],
    ] {
        let encode = [encode, &["scene.strivec", "-o", "before.strivec", "--force"]].concat();
        let (_, message, code) = packed(folder.path(), &encode);
        assert_eq!(code, 0, "{encode:?}: {message}");
        for (edit, added) in [
            (&["convert"][..], 0),
            (&["transform", "--scale", "2"], 0),
            (&["crop", "--box=-0.4,-0.4,-0.4,0.4,0.4,0.2"], 0),
            (&["pack", "--lossless", "--no-views", "--no-prefixes", "--probes", "0"], QUALITY),
        ] {
            let arguments = [edit, &["before.strivec", "-o", "edited.strivec", "--force"]].concat();
            let (_, message, code) = packed(folder.path(), &arguments);
            let (before, after) = (size("before.strivec"), size("edited.strivec"));
            assert!(code == 0 && after <= before + added, "{encode:?}, {edit:?}: {before} to {after}: {message}");
            assert_eq!(message.contains("grows"), after > before, "{edit:?}: {message}");
        }
    }
    assert_eq!(packed(folder.path(), &["convert", "scene.strivec", "-o", "half.strivec", "--encoding", "f16"]).2, 0);
    let larger = ["convert", "half.strivec", "-o", "large.strivec", "--encoding", "f32"];
    let (_, message, _) = packed(folder.path(), &larger);
    assert!(message.contains("warning: half.strivec grows from 13 680 to "), "{message}");
}

#[test]
fn a_size_that_no_encoding_reaches_is_answered_with_the_smallest() {
    let folder = folder_with_scene();
    let arguments = ["pack", "scene.strivec", "-o", "a.strivec", "--target-size", "100B", "--effort", "0.01"];
    let (_, message, code) = packed(folder.path(), &arguments);
    assert!(code == 4 && message.contains("the smallest file has about ") && message.contains(" dB"), "{message}");
    let (_, message, code) =
        packed(folder.path(), &["pack", "scene.strivec", "-o", "a.strivec", "--target-size", "100"]);
    assert!(code == 1 && message.contains("kB, MB"), "{message}");
}

#[test]
fn a_pattern_needs_a_folder_however_many_files_match() {
    let folder = folder_with_scene();
    for output in ["absent", "absent/"] {
        let (_, message, code) = packed(folder.path(), &["convert", "scene*.strivec", "-o", output]);
        assert!(code == 1 && message.contains("no such folder"), "{message}");
    }
    let (_, message, code) = packed(folder.path(), &["convert", "scene.strivec", "-o", "absent/"]);
    assert!(code == 1 && message.contains("no such folder"), "{message}");
}

#[test]
fn a_box_beside_the_scene_is_answered_with_its_bounds() {
    let folder = folder_with_scene();
    let (_, message, code) =
        packed(folder.path(), &["crop", "scene.strivec", "-o", "a.strivec", "--box", "5,5,5,6,6,6"]);
    assert!(code == 1 && message.contains("the box holds nothing of the scene (bounds (-0.59"), "{message}");
}

#[test]
fn a_scene_on_a_closed_pipe_is_no_failure() {
    let folder = folder_with_scene();
    let (reader, writer) = std::io::pipe().unwrap();
    drop(reader);
    let output =
        command(PACK, folder.path(), &["convert", "scene.strivec", "-o", "-"]).stdout(writer).output().unwrap();
    assert_eq!((code(&output), text(&output.stderr)), (0, String::new()));
}

#[test]
fn errors_in_settings_keep_their_lines() {
    let folder = folder_with_scene();
    fs::write(folder.path().join("bad.toml"), "stps = 3\n").unwrap();
    let output = strivec(folder.path(), &["train", "--config", "bad.toml", "--print-config"]);
    let message = text(&output.stderr);
    assert!(code(&output) == 3 && message.lines().count() > 3 && message.contains("1 | stps = 3\n"), "{message}");
}

#[test]
fn completions_and_man_pages_cover_every_command() {
    let folder = TempDir::new().unwrap();
    for program in ["strivec", "strivec-pack"] {
        assert!(run(folder.path(), &["completions", "bash", "--program", program]).contains(program));
    }
    assert_eq!(code(&strivec(folder.path(), &["man", "pages"])), 0);
    for page in ["strivec.1", "strivec-train.1", "strivec-bench-render.1", "strivec-pack.1", "strivec-pack-crop.1"] {
        assert!(fs::read_to_string(folder.path().join("pages").join(page)).unwrap().contains(".TH"), "{page}");
    }
}

#[test]
fn view_without_a_player_says_how_to_install_it() {
    let folder = folder_with_scene();
    // A copy, beside which there is no player.
    let program = folder.path().join("strivec");
    fs::copy(env!("CARGO_BIN_EXE_strivec"), &program).unwrap();
    let output = Command::new(&program).args(["view", "scene.strivec"]).env("PATH", "").output().unwrap();
    let message = failure(&output, 2);
    assert!(message.contains("--features player"), "{message}");
}

#[test]
fn exports_are_of_the_kind_of_their_extension() {
    let folder = TempDir::new().unwrap();
    let fixture = concat!(env!("CARGO_MANIFEST_DIR"), "/fixtures/v1/explicit.strivec");
    let export = |output: &str, more: &[&str]| {
        let arguments = ["export", fixture, "--quiet", "--resolution", "12", "--alpha", "0.02", "-o", output];
        strivec(folder.path(), &[&arguments[..], more].concat())
    };
    for (output, more, kind, start) in [
        ("a.ply", &[][..], "mesh", &b"ply\n"[..]),
        ("a.OBJ", &[], "mesh", b"v "),
        ("a.glb", &[], "mesh", b"glTF"),
        ("points.ply", &["--as", "points"], "points", b"ply\n"),
        ("splats.ply", &["--as", "splats"], "splats", b"ply\n"),
        ("a.spz", &[], "splats", b"\x1f\x8b"),
        ("a.sog", &["--harmonics", "1"], "splats", b"PK"),
        ("a.npz", &[], "occupancy", b"PK"),
        ("a.tar", &[], "dvgo", b"PK"),
    ] {
        let report = json_of(&export(output, &[more, &["--json"]].concat()));
        assert_eq!(report["kind"], kind, "{output}");
        assert!(fs::read(folder.path().join(output)).unwrap().starts_with(start), "{output}");
        assert!(failure(&export(output, more), 1).contains("the file exists"), "{output}");
        assert_eq!(code(&export(output, &[more, &["--force"]].concat())), 0, "{output}");
    }
    assert!(failure(&export("a.xyz", &[]), 1).contains("no kind of file has the extension \"xyz\""));
    assert!(failure(&export("a", &["--as", "splats"]), 1).contains("has the extension .ply or .spz or .sog, not \"\""));
    assert!(failure(&export("b.ply", &["--harmonics", "1"]), 1).contains("--harmonics is for splats"));
    let wrong = export("b.sog", &["--harmonics", "4"]);
    assert!(code(&wrong) == 1 && text(&wrong.stderr).contains("--harmonics"), "{}", text(&wrong.stderr));
    let empty = failure(&export("b.ply", &["--min-triangles", "1000000"]), 4);
    assert!(empty.contains("b.ply: no density has a surface at an --alpha of 0.02; "), "{empty}");
    assert_eq!(fs::read_dir(&folder).unwrap().count(), 9, "nothing is left of what failed");
}

#[test]
fn exports_far_from_the_origin_warn_if_their_format_has_32_bits_alone_and_say_how_to_move_the_scene() {
    let folder = TempDir::new().unwrap();
    let fixture = concat!(env!("CARGO_MANIFEST_DIR"), "/fixtures/v1/explicit.strivec");
    let moved = |from: &str, to: &str, by: &str| {
        printed(&pack(folder.path(), &["transform", from, "-o", to, "--force", "--move", by]));
    };
    moved(fixture, "far.strivec", "500000,5000000,300");
    let warning = |scene: &str, output: &str, more: &[&str]| {
        let arguments = ["export", scene, "--force", "--resolution", "12", "--alpha", "0.02", "-o", output];
        let output = strivec(folder.path(), &[&arguments[..], more].concat());
        assert_eq!(code(&output), 0, "{}", text(&output.stderr));
        text(&output.stderr).lines().find(|line| line.starts_with("warning: ")).map(str::to_owned)
    };
    let points = ("points.ply", &["--as", "points"][..]);
    for (output, more) in [("a.ply", &[][..]), ("a.obj", &[]), ("a.glb", &[]), points, ("a.npz", &[])] {
        assert_eq!(warning("far.strivec", output, more), None, "{output}");
    }
    for (output, more) in [("splats.ply", &["--as", "splats"][..]), ("a.tar", &[])] {
        let told = warning("far.strivec", output, more).expect("a warning");
        let start = format!("warning: {output}: numbers of this format have 32 bits and are 0.5 apart near 50000");
        assert!(told.starts_with(&start), "{told}");
        assert_eq!(warning("far.strivec", output, &[more, &["--space", "model"]].concat()), None, "{output}");
        let (_, command) = told.split_once("`strivec-pack transform --move ").expect("a command");
        let (by, _) = command.split_once('`').expect("its end");
        moved("far.strivec", "near.strivec", by);
        assert_eq!(warning("near.strivec", output, more), None, "{output}, moved by {by}");
    }
}
