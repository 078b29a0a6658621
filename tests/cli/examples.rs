//! The programs of `examples/`, run by their first lines. `cargo test` builds them beside the tests.

use std::path::{Path, PathBuf};
use std::process::Command;

use crate::command;

/// Runs example `name` and returns what it prints.
fn run(name: &str, arguments: &[&Path]) -> String {
    // target/PROFILE/deps/examples-HASH, target/PROFILE/examples/NAME.
    let test = std::env::current_exe().unwrap();
    let program = test
        .parent()
        .unwrap()
        .parent()
        .unwrap()
        .join("examples")
        .join(name)
        .with_extension(std::env::consts::EXE_EXTENSION);
    assert!(
        program.is_file(),
        "{} is missing: run `cargo test` for all targets, or `cargo build --examples`",
        program.display()
    );
    let output = Command::new(program).args(arguments).output().unwrap();
    assert!(output.status.success(), "{name}: {}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}

fn fixture(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("fixtures/v1").join(name)
}

#[test]
fn query_scene_prints_density_and_color() {
    let scene = fixture("f32.strivec");
    let covered = strivec_format::container::decode(&std::fs::read(&scene).unwrap()).unwrap().bounds.center();
    let position = covered.to_array().map(|x| PathBuf::from(x.to_string()));
    let printed = run("query_scene", &[&scene, &position[0], &position[1], &position[2]]);
    assert!(printed.contains("parameters") && printed.contains("density"), "{printed}");
    let outside = run("query_scene", &[&scene, "9e9".as_ref(), "0".as_ref(), "0".as_ref()]);
    assert!(outside.contains("no tensor covers"), "{outside}");
}

#[test]
fn render_picture_writes_a_png() {
    let folder = tempfile::tempdir().unwrap();
    let png = folder.path().join("picture.png");
    run("render_picture", &[&fixture("f32.strivec"), &png]);
    let picture = image::open(png).unwrap().into_rgb8();
    assert_eq!(picture.dimensions(), (320, 240));
    assert!(picture.pixels().any(|pixel| pixel != picture.get_pixel(0, 0)), "one color everywhere");
}

/// Settings for seconds.
const SETTINGS: &str = "
preset = \"fast\"
[model]
step = 1.5
[sampling]
batch_rays = 128
[schedule]
upsample_at = [40]
occupancy_at = [40, 80]
steps = 100
[prior]
voxels = 60000
steps = [100, 150]
rays = 256
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

/// A transparent background has a coarse reconstruction, and an opaque room matched points, a background and viewpoints.
#[test]
fn train_folder_writes_the_bytes_of_the_command() {
    let temporary = tempfile::tempdir().unwrap();
    let folder = temporary.path();
    let strivec = |arguments: &[&str]| command::run(folder, &[arguments, &["--quiet"]].concat());
    let settings = folder.join("settings.toml");
    std::fs::write(&settings, SETTINGS).unwrap();
    strivec(&["synth", "object", "--views", "8", "--test-views", "1", "--size", "24x24"]);
    strivec(&["synth", "room", "--room", "--views", "10", "--test-views", "1", "--size", "48x48"]);
    for (dataset, said) in [("object", "photographs to train on"), ("room", "matching:")] {
        let [of_example, of_command] = ["example", "command"].map(|name| format!("{dataset}-{name}.strivec"));
        let printed = run("train_folder", &[&folder.join(dataset), &folder.join(&of_example), &settings]);
        assert!(printed.contains("step 100: mean squared error") && printed.contains(said), "{printed}");
        strivec(&["train", dataset, "-o", &of_command, "--config", "settings.toml"]);
        let [example, command] = [of_example, of_command].map(|name| std::fs::read(folder.join(name)).unwrap());
        assert!(example == command, "{dataset}: the files differ");
        strivec_format::container::decode(&example).unwrap().check().unwrap();
    }
}

#[test]
fn mesh_prior_counts_voxels_and_tensors() {
    let folder = tempfile::tempdir().unwrap();
    let mesh = folder.path().join("tetrahedron.obj");
    std::fs::write(&mesh, "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\nf 1 2 4\nf 1 3 4\nf 2 3 4\n").unwrap();
    let printed = run("mesh_prior", &[&mesh, "0.25".as_ref()]);
    assert!(printed.contains("of 4 triangles") && printed.contains("tensors with edges of 0.375"), "{printed}");
}
