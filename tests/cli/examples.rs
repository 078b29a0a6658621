//! The programs of `examples/`, run by their first lines. `cargo test` builds them beside the tests.

use std::path::{Path, PathBuf};
use std::process::Command;

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

#[test]
fn train_folder_writes_a_scene() {
    let folder = tempfile::tempdir().unwrap();
    let (photographs, scene) = (folder.path().join("photographs"), folder.path().join("scene.strivec"));
    let synth = Command::new(env!("CARGO_BIN_EXE_strivec"))
        .args(["synth".as_ref(), photographs.as_path()])
        .args(["--views", "8", "--test-views", "1", "--size", "24x24", "--quiet"])
        .status();
    assert!(synth.unwrap().success());
    let printed = run("train_folder", &[&photographs, &scene, "100".as_ref()]);
    assert!(printed.contains("step 100: mean squared error"), "{printed}");
    strivec_format::container::decode(&std::fs::read(scene).unwrap()).unwrap().check().unwrap();
}

#[test]
fn mesh_prior_counts_voxels_and_tensors() {
    let folder = tempfile::tempdir().unwrap();
    let mesh = folder.path().join("tetrahedron.obj");
    std::fs::write(&mesh, "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\nf 1 2 4\nf 1 3 4\nf 2 3 4\n").unwrap();
    let printed = run("mesh_prior", &[&mesh, "0.25".as_ref()]);
    assert!(printed.contains("of 4 triangles") && printed.contains("tensors with edges of 0.375"), "{printed}");
}
