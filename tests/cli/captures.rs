//! Scenes whose cameras stand within them: unbounded ones and rooms, from files to pictures and files.

use crate::command::{PACK, run, run_program};
use crate::scenes;

use std::f64::consts::TAU;
use std::fs;
use std::path::Path;

use glam::DVec3;
use serde_json::Value;
use strivec_field::render::{CpuRenderer, Gaze, Picture, Renderer, Turntable};
use strivec_format::container::{
    EncodeOptions, Encoding, Limits, Metadata, SceneFile, TrainingCamera, decode_scene_file, encode_scene_file,
};
use strivec_format::geometry::{Camera, Viewpoint};
use strivec_format::model::Scene;
use strivec_format::psnr::psnr_of_mse;
use strivec_measure::color_png;
use strivec_train::pack::{ReferencePictures, probe_views};
use tempfile::TempDir;

/// An unbounded scene, and a ring of cameras in its inner cube that look at its middle.
fn unbounded() -> (Scene, Vec<TrainingCamera>) {
    let mut config = scenes::config();
    config.model.density_shift = -4.0;
    config.scales.truncate(2);
    let mut scene = scenes::contracted(scenes::scene(&config));
    (scene.frame.near, scene.frame.far) = (0.2, 2000.0);
    // Coarse, for short tests.
    scene.rules.step = 0.05;
    let cameras = (0..12).map(|n| {
        let (sin, cos) = (TAU * f64::from(n) / 12.0).sin_cos();
        let camera = Camera::looking_at([12, 8], 10.0, DVec3::new(0.8 * cos, 0.8 * sin, 0.3), DVec3::ZERO, DVec3::Z);
        TrainingCamera::from(&camera)
    });
    (scene, cameras.collect())
}

/// A folder with `scene` as scene.strivec, with `cameras`.
fn folder(scene: &Scene, cameras: &[TrainingCamera]) -> TempDir {
    let folder = TempDir::new().unwrap();
    let metadata = Metadata { cameras: cameras.to_vec(), ..Metadata::default() };
    let bytes = encode_scene_file(scene, &metadata, &EncodeOptions::uniform(Encoding::F32)).unwrap();
    fs::write(folder.path().join("scene.strivec"), bytes).unwrap();
    folder
}

fn read(folder: &Path, name: &str) -> SceneFile {
    decode_scene_file(&fs::read(folder.join(name)).unwrap(), Limits::default()).unwrap()
}

fn png(picture: &Picture) -> Vec<u8> {
    let colors: Vec<_> = picture.pixels.iter().map(|pixel| pixel.color).collect();
    color_png([picture.width, picture.height], &colors).unwrap()
}

/// The largest difference of two PNG pictures' channels.
fn apart(a: &[u8], b: &[u8]) -> u8 {
    let [a, b] = [a, b].map(|bytes| image::load_from_memory(bytes).unwrap().into_rgb8().into_raw());
    assert_eq!(a.len(), b.len(), "the sizes of the pictures");
    a.iter().zip(&b).map(|(a, b)| a.abs_diff(*b)).max().unwrap()
}

#[test]
fn a_turntable_of_an_unbounded_scene_is_where_its_photographs_were_taken() {
    let (scene, cameras) = unbounded();
    let folder = folder(&scene, &cameras);
    let arguments = ["render", "scene.strivec", "--quiet", "--size", "12x8", "--out", "frames"];
    run(folder.path(), &[&arguments[..], &["--path", "turntable", "--frames", "2"]].concat());
    let turn = Turntable::of(&scene, None, &cameras).unwrap();
    assert!((turn.radius - 0.8).abs() < 1e-6 && (turn.height - 0.3).abs() < 1e-6, "{turn:?}");
    let renderer = CpuRenderer::unlimited(&scene);
    for (name, share) in [("frame_0000", 0.0), ("frame_0001", 0.5)] {
        let found = fs::read(folder.path().join(format!("frames/{name}.png"))).unwrap();
        let expected = png(&renderer.render(&turn.camera(share, [12, 8])));
        assert!(apart(&found, &expected) <= 1, "{name}");
    }
    // Other distances and elevations are around what the cameras look at.
    run(folder.path(), &[&arguments[..], &["--orbit", "1", "--elevation", "0", "--radius", "2"]].concat());
    assert_ne!(
        fs::read(folder.path().join("frames/orbit_000.png")).unwrap(),
        png(&renderer.render(&turn.camera(0.0, [12, 8])))
    );
}

#[test]
fn near_depths_of_an_unbounded_scene_are_told_apart() {
    let (scene, cameras) = unbounded();
    let folder = folder(&scene, &cameras);
    let arguments =
        ["render", "scene.strivec", "--quiet", "--size", "12x8", "--out", "frames", "--orbit", "1", "--depth"];
    run(folder.path(), &arguments);
    let scale: Value = serde_json::from_slice(&fs::read(folder.path().join("frames/depth.json")).unwrap()).unwrap();
    let scale = scale["scale"].as_f64().unwrap();
    let gray = image::open(folder.path().join("frames/orbit_000_depth.png")).unwrap().into_luma16().into_raw();
    let turn = Turntable::of(&scene, None, &cameras).unwrap();
    let picture = CpuRenderer::unlimited(&scene).render(&turn.camera(0.0, [12, 8]));
    let units = scene.frame.model_from_dataset.scale;
    let mut seen = 0;
    for (&gray, pixel) in gray.iter().zip(&picture.pixels) {
        let depth = f64::from(pixel.depth) / units;
        if depth == 0.0 {
            assert_eq!(gray, 0);
            continue;
        }
        let found = scale * (65535.0 / f64::from(gray) - 1.0);
        // Half a gray value, and the rounding of positions.
        let step = (scale + depth).powi(2) / (65535.0 * scale);
        assert!((found - depth).abs() < step + 1e-3 * depth, "{found} and {depth}");
        seen += usize::from(depth < scale && step < 1e-3 * scale);
    }
    assert!(seen > 10, "{seen} near pixels");
}

#[test]
fn an_unbounded_scene_is_packed_as_its_cameras_see_it() {
    let (scene, cameras) = unbounded();
    let folder = folder(&scene, &cameras);
    let arguments = [
        "pack",
        "scene.strivec",
        "-o",
        "small.strivec",
        "--quiet",
        "--quality",
        "small",
        "--effort",
        "0.002",
        "--probes",
        "8",
    ];
    run_program(PACK, folder.path(), &arguments);
    run_program(PACK, folder.path(), &["verify", "--render", "small.strivec"]);
    let small = read(folder.path(), "small.strivec");
    let quality = small.metadata.quality.unwrap();
    let distortion = |size| ReferencePictures::from_own_pictures(&scene, probe_views(&scene, None, &cameras, 12, size));
    let measured = psnr_of_mse(distortion(24).mse(&small.scene));
    let stated = quality.encoded.unwrap();
    assert!(stated >= 45.0 && (stated - measured).abs() < 1.5, "{stated} stated, {measured} measured");
    assert!(quality.prefixes[0].is_some_and(|psnr| psnr > 5.0), "{:?}", quality.prefixes);

    let views = small.metadata.views.unwrap();
    assert!(views.path.iter().all(|pose| pose.position.abs().max_element() < 1.0), "{views:?}");
    assert!(views.center.length() < 1e-6);
    let camera = Viewpoint {
        position: views.first.position,
        rotation: views.first.rotation,
        vertical_angle: views.angle_of_view,
    };
    let thumbnail = small.metadata.thumbnail.unwrap();
    let picture = CpuRenderer::unlimited(&small.scene).render(&camera.camera(thumbnail.size.map(u32::from)));
    let found = image::load_from_memory(&thumbnail.file).unwrap().into_rgb8();
    let errors = found.pixels().zip(&picture.pixels).flat_map(|(found, expected)| {
        (0..3).map(|c| (f64::from(found.0[c]) / 255.0 - f64::from(expected.color[c])).powi(2)).collect::<Vec<_>>()
    });
    let psnr = psnr_of_mse(errors.sum::<f64>() / (3 * picture.pixels.len()) as f64);
    assert!(psnr > 20.0, "the thumbnail is the first view, but differs by {psnr} dB");
}

#[test]
fn what_changes_files_and_what_measures_them_takes_unbounded_scenes() {
    let (scene, cameras) = unbounded();
    let folder = folder(&scene, &cameras);
    let pack = |arguments: &[&str]| run_program(PACK, folder.path(), arguments);
    pack(&["transform", "scene.strivec", "-o", "moved.strivec", "--scale", "3", "--turn", "x", "--move=1,2,3"]);
    pack(&["crop", "moved.strivec", "-o", "crop.strivec", "--scales", "1"]);
    pack(&["extract", "scene.strivec", "-o", "parts"]);
    pack(&["assemble", "parts", "-o", "again.strivec"]);
    let again = read(folder.path(), "again.strivec");
    assert_eq!((&again.scene, &again.metadata.cameras), (&scene, &cameras));
    // The turn is that of the model, which no transformation changes.
    let moved = read(folder.path(), "moved.strivec");
    let turn = |file: &SceneFile| Turntable::of(&file.scene, None, &file.metadata.cameras).unwrap();
    assert!((turn(&moved).center - turn(&again).center).length() < 1e-9);
    for (file, arguments) in [("moved.strivec", &["--orbit", "1"][..]), ("scene.strivec", &["--orbit", "1"])] {
        let out = format!("{file}.out");
        let all = [&["render", file, "--quiet", "--size", "12x8", "--out", &out], arguments].concat();
        run(folder.path(), &all);
    }
    let picture = |file: &str| fs::read(folder.path().join(format!("{file}.out/orbit_000.png"))).unwrap();
    assert!(apart(&picture("moved.strivec"), &picture("scene.strivec")) <= 2, "a turntable moves with its scene");

    let trade = [
        "trade",
        "scene.strivec",
        "--quiet",
        "--size",
        "16",
        "--views",
        "2",
        "--rounds",
        "1",
        "--combinations",
        "1",
        "--out",
        "trade",
    ];
    let report = run(folder.path(), &trade);
    assert!(report.contains("exact"), "{report}");
}

#[test]
fn a_room_is_seen_from_its_middle_by_default() {
    let scene = scenes::scene(&scenes::config());
    let cameras: Vec<_> = (0..12)
        .map(|n| {
            let (sin, cos) = (TAU * f64::from(n) / 12.0).sin_cos();
            let at = DVec3::new(0.2 * cos, 0.2 * sin, 0.1);
            TrainingCamera::from(&Camera::looking_at([12, 8], 8.0, at, at + DVec3::new(cos, sin, 0.1), DVec3::Z))
        })
        .collect();
    let turn = Turntable::of(&scene, None, &cameras).unwrap();
    assert_eq!(turn.gaze, Gaze::Outward);
    let folder = folder(&scene, &cameras);
    let arguments = [
        "render",
        "scene.strivec",
        "--quiet",
        "--size",
        "12x8",
        "--out",
        "frames",
        "--path",
        "turntable",
        "--frames",
        "3",
    ];
    run(folder.path(), &arguments);
    let found = fs::read(folder.path().join("frames/frame_0001.png")).unwrap();
    let expected = CpuRenderer::unlimited(&scene).render(&turn.camera(1.0 / 3.0, [12, 8]));
    assert!(apart(&found, &png(&expected)) <= 1);
}
