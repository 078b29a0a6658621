//! Training of scenes for files of a given size.

use crate::command;

use std::fs;
use std::path::Path;
use std::process::Command;

use command::{PACK, STRIVEC, json, output_of, run, run_program};
use strivec_format::container;
use strivec_format::container::Limits;
use tempfile::TempDir;

/// Small enough for seconds.
const SETTINGS: &str = "
preset = \"fast\"
[model]
step = 2.0
[sampling]
batch_rays = 256
[schedule]
upsample_at = [60]
occupancy_at = [60, 120]
steps = 240
[prior]
voxels = 60000
steps = [100, 150]
rays = 256
[[scales]]
pitch = [0.4, 0.4, 0.4]
edge = [0.6, 0.6, 0.6]
resolutions = [[7, 7, 7], [10, 10, 10]]
density_rank = 12
appearance_rank = 12
top_k = 2
[[scales]]
pitch = [0.3, 0.3, 0.3]
edge = [0.4, 0.4, 0.4]
resolutions = [[5, 5, 5], [7, 7, 7]]
density_rank = 12
appearance_rank = 12
top_k = 2
[decoder]
hidden = [64, 64]
[finish]
from = 1.0
";

/// A folder with a dataset and the settings.
fn folder() -> TempDir {
    let folder = TempDir::new().unwrap();
    fs::write(folder.path().join("tiny.toml"), SETTINGS).unwrap();
    let synth = ["synth", "data", "--views", "16", "--test-views", "4", "--size", "32x32", "--seed", "3"];
    run(folder.path(), &[&synth[..], &["--quiet"]].concat());
    folder
}

fn psnr(folder: &Path, file: &str) -> f64 {
    json(folder, &["eval", file, "data", "--split", "test"])["psnr"].as_f64().unwrap()
}

fn bytes(folder: &Path, file: &str) -> u64 {
    fs::metadata(folder.join(file)).unwrap().len()
}

#[test]
fn a_scene_tuned_for_its_file_keeps_the_size_and_its_pictures() {
    let temporary = folder();
    let folder = temporary.path();
    run(folder, &["train", "data", "-o", "whole.strivec", "--config", "tiny.toml"]);
    let pack = ["pack", "whole.strivec", "--target-size", "40kB", "--effort", "0.1", "--probes", "4", "-o"];
    run_program(PACK, folder, &[&pack[..], &["packed.strivec"]].concat());
    let tune = ["--tune", "data", "--tune-steps", "40"];
    run_program(PACK, folder, &[&pack[..], &["tuned.strivec"], &tune].concat());
    let [whole, packed, tuned] = ["whole", "packed", "tuned"].map(|name| psnr(folder, &format!("{name}.strivec")));
    let sizes = ["whole.strivec", "packed.strivec", "tuned.strivec"].map(|file| bytes(folder, file));
    println!("{whole:.2} dB whole, {packed:.2} packed, {tuned:.2} tuned; {sizes:?} bytes");
    assert!(sizes[2] <= 40_000 && sizes[0] > 60_000, "{sizes:?} bytes");
    assert!(tuned > packed - 0.1, "{packed} dB packed, {tuned} dB tuned");
    run_program(PACK, folder, &["verify", "tuned.strivec", "--render"]);

    // Its numbers are integers times steps that the file has, so that packing them again loses nothing.
    let file =
        container::decode_scene_file(&fs::read(folder.join("tuned.strivec")).unwrap(), Limits::default()).unwrap();
    assert!(matches!(file.encoding.density[0].array.encoding, container::Encoding::Grid(16)));

    let output = output_of(
        PACK,
        folder,
        &["pack", "whole.strivec", "--target-size", "1kB", "--tune", "data", "-o", "x.strivec"],
    );
    let message = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.code() == Some(4) && message.contains("is too small; the smallest has about"), "{message}");
}

#[test]
fn training_keeps_the_size_and_goes_on_to_the_same_file() {
    let temporary = folder();
    let folder = temporary.path();
    let train = ["train", "data", "--config", "tiny.toml", "--max-size", "68kB"];
    run(folder, &[&train[..], &["-o", "whole.strivec"]].concat());
    let size = bytes(folder, "whole.strivec");
    assert!((30_000..=68_000).contains(&size), "{size} bytes");
    let scene = container::decode(&fs::read(folder.join("whole.strivec")).unwrap()).unwrap();
    assert_eq!(scene.provenance.steps, 240 + 60, "a quarter more");

    // Interrupted while factors are rounded.
    let arguments = [&train[..], &["-o", "cut.strivec", "--checkpoint-every", "7", "--quiet"]].concat();
    let mut child = Command::new(STRIVEC).current_dir(folder).args(&arguments).spawn().unwrap();
    let state = folder.join("cut.strivec.state");
    let is_rounding = || fs::read(&state).is_ok_and(|bytes| bytes.windows(15).any(|text| text == b"file_bytes_goal"));
    while !is_rounding() && child.try_wait().unwrap().is_none() {
        std::thread::sleep(std::time::Duration::from_millis(5));
    }
    let killed = child.try_wait().unwrap().is_none();
    child.kill().unwrap();
    child.wait().unwrap();
    assert!(killed, "the training ended before its first checkpoint with rounded factors");
    let resume = ["train", "data", "-o", "cut.strivec", "--resume", "--threads", "1"];
    run(folder, &resume);
    assert!(fs::read(folder.join("whole.strivec")).unwrap() == fs::read(folder.join("cut.strivec")).unwrap());
    assert!(!state.exists(), "a finished run leaves no state");
}
