//! A small file whose tensors overlap so much that their index takes gigabytes is refused wherever it would be drawn.

use crate::command::{PACK, STRIVEC, code, command, output_of, printed, text};
use crate::scenes;

use glam::{DVec3, UVec3};
use std::fs;
use strivec_format::container::{EncodeOptions, Encoding, encode};
use strivec_format::geometry::Lattice;
use strivec_format::model::{Block, Factors, Placement, TensorCloud};
use tempfile::TempDir;

/// Tensors along an edge of the cloud.
const ALONG: u32 = 64;

/// A folder with `dear.strivec`: 262 144 tensors, each within reach of 343 cells of the index, without any component.
fn folder() -> TempDir {
    let mut config = scenes::config();
    config.scales.truncate(1);
    (config.scales[0].density_rank, config.scales[0].appearance_rank) = (1, 1);
    let mut scene = scenes::scene(&config);
    let scale = &mut scene.scales[0];
    let along = || 0..ALONG;
    let cells: Vec<UVec3> =
        along().flat_map(|z| along().flat_map(move |y| along().map(move |x| UVec3::new(x, y, z)))).collect();
    let zeros = || vec![Block::cp(1, vec![0.0; 6 * cells.len()])];
    scale.factors = Factors { density: zeros(), appearance: zeros() };
    let lattice = Lattice { origin: DVec3::splat(-0.96), pitch: DVec3::splat(0.03) };
    scale.cloud = TensorCloud {
        placement: Placement::Lattice { lattice, cells },
        half_edge: DVec3::splat(0.3),
        resolution: [1; 3],
    };
    let bytes = encode(&scene, &EncodeOptions::uniform(Encoding::F32)).unwrap();
    assert!(bytes.len() < 200_000, "{} bytes", bytes.len());
    let folder = TempDir::new().unwrap();
    fs::write(folder.path().join("dear.strivec"), bytes).unwrap();
    folder
}

#[test]
fn a_small_file_whose_index_takes_gigabytes_is_refused_by_what_draws_it() {
    let folder = folder();
    for (program, arguments) in [
        (STRIVEC, &["render", "dear.strivec", "--orbit", "1", "--size", "8x8", "--out", "out"][..]),
        (STRIVEC, &["export", "dear.strivec", "-o", "dear.ply"]),
        (STRIVEC, &["export", "dear.strivec", "-o", "dear.tar"]),
        (STRIVEC, &["export", "dear.strivec", "-o", "dear.npz"]),
        (PACK, &["pack", "dear.strivec", "-o", "packed.strivec"]),
        (PACK, &["prune", "dear.strivec", "-o", "pruned.strivec"]),
    ] {
        let output = output_of(program, folder.path(), arguments);
        let message = text(&output.stderr);
        assert_eq!(code(&output), 5, "{arguments:?}: {message}");
        let expected = "the index of the tensors of the scene would take at least";
        let is_named = message.contains("dear.strivec: ");
        assert!(
            is_named && message.contains(expected) && message.contains("more than the 5"),
            "{arguments:?}: {message}"
        );
    }
}

#[test]
fn a_valid_file_that_is_dear_to_draw_is_shown_with_a_warning() {
    let folder = folder();
    printed(&output_of(STRIVEC, folder.path(), &["info", "dear.strivec"]));
    let shown = printed(&output_of(PACK, folder.path(), &["verify", "dear.strivec"]));
    assert!(shown.contains("dear.strivec: valid") && shown.contains("warning: pictures are refused"), "{shown}");
}

#[test]
#[cfg(unix)]
fn devices_pipes_and_streams_without_end_are_not_read_until_memory_ends() {
    let folder = TempDir::new().unwrap();
    let made = std::process::Command::new("mkfifo").arg(folder.path().join("pipe.strivec")).status().unwrap();
    assert!(made.success());
    for (program, arguments) in
        [(STRIVEC, ["info", "/dev/zero"]), (STRIVEC, ["info", "pipe.strivec"]), (PACK, ["verify", "pipe.strivec"])]
    {
        let output = output_of(program, folder.path(), &arguments);
        let message = text(&output.stderr);
        assert_eq!(code(&output), 2, "{arguments:?}: {message}");
        assert!(message.contains("cannot be read: it is a device or a pipe"), "{arguments:?}: {message}");
    }
    let zeros = fs::File::open("/dev/zero").unwrap();
    let output = command(PACK, folder.path(), &["verify", "-"]).stdin(zeros).output().unwrap();
    let message = text(&output.stderr);
    assert_eq!(code(&output), 3, "{message}");
    assert!(message.contains("not a .strivec file"), "{message}");
}
