//! One set of photographs in each layout: cameras, splits, masks, missing pictures, and everything that can be wrong.

use std::fs;
use std::path::Path;

use crate::command::{STRIVEC, command, printed};
use glam::{DMat3, DQuat, DVec3};
use image::RgbaImage;
use serde_json::json;
use strivec_capture::dataset::{Dataset, Error, ErrorKind, Holdout, Layout, LoadOptions, load, load_cameras};
use strivec_format::geometry::{Camera, Distortion, Lens, Projection};
use strivec_import::npy;
use tempfile::TempDir;

/// Columns and rows of the photographs.
const SIZE: [u32; 2] = [24, 16];
const PHOTOGRAPHS: usize = 10;

/// Cameras around the origin: all layouts can express these.
fn cameras() -> Vec<Camera> {
    let place = |n: usize| {
        let angle = 0.6 * n as f64;
        DVec3::new(3.0 * angle.cos(), 3.0 * angle.sin(), 1.0 + 0.1 * n as f64)
    };
    (0..PHOTOGRAPHS).map(|n| Camera::looking_at(SIZE, 20.0, place(n), DVec3::ZERO, DVec3::Z)).collect()
}

/// The name of photograph `n`.
fn name(n: usize) -> String {
    format!("photo {n:02}")
}

/// Writes the pictures into `folder`, each of one color, made `reduced` times smaller.
fn write_pictures(folder: &Path, ending: &str, reduced: u32) {
    fs::create_dir_all(folder).unwrap();
    for n in 0..PHOTOGRAPHS {
        let [width, height] = SIZE.map(|extent| extent / reduced);
        let picture = RgbaImage::from_pixel(width, height, image::Rgba([20 * n as u8, 100, 200, 255]));
        let picture = image::DynamicImage::from(picture).into_rgb8();
        picture.save(folder.join(format!("{}.{ending}", name(n)))).unwrap();
    }
}

/// Axes of OpenCV (x right, y down, z forwards) in the world.
fn in_opencv(camera: &Camera) -> DMat3 {
    camera.world_from_camera * DMat3::from_diagonal(DVec3::new(1.0, -1.0, -1.0))
}

fn colmap_pose(camera: &Camera) -> (DQuat, DVec3) {
    let camera_from_world = in_opencv(camera).transpose();
    (DQuat::from_mat3(&camera_from_world), -(camera_from_world * camera.position))
}

fn write(path: &Path, bytes: impl AsRef<[u8]>) {
    fs::create_dir_all(path.parent().unwrap()).unwrap();
    fs::write(path, bytes).unwrap();
}

fn write_colmap_text(folder: &Path, model: &str) {
    write_pictures(&folder.join("images"), "png", 1);
    let intrinsics = match model {
        "PINHOLE" => "20 20 12 8",
        "OPENCV" => "20 20 12 8 0.1 0.01 0.001 -0.002",
        _ => "20 12 8",
    };
    write(&folder.join("sparse/0/cameras.txt"), format!("# Camera list\n1 {model} 24 16 {intrinsics}\n"));
    let mut images = String::from("# Image list\n");
    for (n, camera) in cameras().iter().enumerate() {
        let (q, t) = colmap_pose(camera);
        images += &format!("{} {} {} {} {} ", n + 1, q.w, q.x, q.y, q.z);
        // The line of points may be empty.
        images += &format!("{} {} {} 1 {}.png\n{}\n", t.x, t.y, t.z, name(n), if n == 3 { "1.0 2.0 -1" } else { "" });
    }
    write(&folder.join("sparse/0/images.txt"), images);
    write(&folder.join("sparse/0/points3D.txt"), "1 0.5 0.25 -0.5 9 9 9 0.1 1 1 2 1\n");
}

fn colmap_binary() -> [Vec<u8>; 2] {
    let mut file = 1u64.to_le_bytes().to_vec();
    file.extend([7u32.to_le_bytes(), 1u32.to_le_bytes()].concat());
    SIZE.iter().for_each(|&extent| file.extend(u64::from(extent).to_le_bytes()));
    [20.0, 20.0, 12.0, 8.0f64].iter().for_each(|number| file.extend(number.to_le_bytes()));
    let mut images = (PHOTOGRAPHS as u64).to_le_bytes().to_vec();
    for (n, camera) in cameras().iter().enumerate() {
        let (q, t) = colmap_pose(camera);
        images.extend((n as u32).to_le_bytes());
        [q.w, q.x, q.y, q.z, t.x, t.y, t.z].iter().for_each(|number| images.extend(number.to_le_bytes()));
        images.extend(7u32.to_le_bytes());
        images.extend(format!("{}.png\0", name(n)).bytes());
        images.extend(1u64.to_le_bytes());
        images.extend([0; 24]);
    }
    [file, images]
}

fn write_colmap_binary(folder: &Path) {
    write_pictures(&folder.join("images"), "png", 1);
    let [cameras, images] = colmap_binary();
    write(&folder.join("sparse/cameras.bin"), cameras);
    write(&folder.join("sparse/images.bin"), images);
}

fn matrix_of(rotation: DMat3, position: DVec3) -> [[f64; 4]; 4] {
    let row = |r: usize| [rotation.x_axis[r], rotation.y_axis[r], rotation.z_axis[r], position[r]];
    [row(0), row(1), row(2), [0.0, 0.0, 0.0, 1.0]]
}

fn write_transforms(folder: &Path) {
    write_pictures(&folder.join("images"), "jpg", 1);
    let frames: Vec<_> = (cameras().iter().enumerate())
        .map(|(n, camera)| {
            let matrix = matrix_of(camera.world_from_camera, camera.position);
            json!({ "file_path": format!("images/{}.jpg", name(n)), "transform_matrix": matrix })
        })
        .collect();
    let json = json!({ "fl_x": 20.0, "fl_y": 20.0, "cx": 12.0, "cy": 8.0, "w": 24, "h": 16, "frames": frames });
    write(&folder.join("transforms.json"), json.to_string());
}

fn write_nsvf(folder: &Path) {
    write_pictures(&folder.join("rgb"), "png", 1);
    write(&folder.join("intrinsics.txt"), "20 0 12 0\n0 20 8 0\n0 0 1 0\n0 0 0 1\n");
    write(&folder.join("bbox.txt"), "-1 -2 -3 1 2 3 0.4\n");
    for (n, camera) in cameras().iter().enumerate() {
        let split = if n % 4 == 0 { 1 } else { 0 };
        let renamed = format!("{split}_{}", name(n));
        fs::rename(folder.join(format!("rgb/{}.png", name(n))), folder.join(format!("rgb/{renamed}.png"))).unwrap();
        let rows = matrix_of(in_opencv(camera), camera.position);
        let text = rows.map(|row| row.map(|v| v.to_string()).join(" ")).join("\n");
        write(&folder.join(format!("pose/{renamed}.txt")), text);
    }
}

fn write_llff(folder: &Path) {
    write_pictures(&folder.join("images"), "png", 1);
    let rows: Vec<f64> = (cameras().iter())
        .flat_map(|camera| {
            let m = camera.world_from_camera;
            let row = |r: usize, last: f64| [-m.y_axis[r], m.x_axis[r], m.z_axis[r], camera.position[r], last];
            let near_far = [1.0, 5.0];
            [row(0, 16.0), row(1, 24.0), row(2, 20.0)].concat().into_iter().chain(near_far).collect::<Vec<_>>()
        })
        .collect();
    let mut file = Vec::new();
    npy::write(&mut file, &[PHOTOGRAPHS, 17], rows.iter().copied()).unwrap();
    write(&folder.join("poses_bounds.npy"), file);
}

/// Metashape's file, with `calibration` in its sensor; the last photograph was not aligned.
fn write_metashape(folder: &Path, calibration: &str) {
    write_pictures(&folder.join("images"), "jpg", 1);
    let camera = |(n, camera): (usize, &Camera)| {
        let rows = matrix_of(in_opencv(camera), camera.position);
        let numbers = rows.as_flattened().iter().map(f64::to_string).collect::<Vec<_>>().join(" ");
        // Labels have the ending of the picture or not.
        let ending = if n % 2 == 0 { ".jpg" } else { "" };
        let label = format!("{}{ending}", name(n));
        format!(
            r#"<camera id="{n}" sensor_id="3" component_id="0" label="{label}"><transform>{numbers}</transform></camera>"#
        )
    };
    let cameras: String = cameras().iter().enumerate().map(camera).collect();
    let resolution = r#"<resolution width="24" height="16"/>"#;
    let xml = format!(
        r#"<?xml version="1.0" encoding="UTF-8"?>
        <document version="1.2.0"><chunk label="Chunk 1" enabled="true">
        <sensors next_id="4"><sensor id="3" label="unknown" type="frame">{resolution}
        <calibration type="frame" class="initial">{resolution}<f>7</f></calibration>
        <calibration type="frame" class="adjusted">{resolution}<f>20</f>{calibration}</calibration></sensor></sensors>
        <cameras next_id="11"><group id="0" label="Group 1">{cameras}</group>
        <camera id="10" sensor_id="3" label="not aligned"/></cameras></chunk></document>"#
    );
    write(&folder.join("cameras.xml"), xml);
}

fn folder_of(make: impl FnOnce(&Path)) -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    make(folder.path());
    folder
}

#[track_caller]
fn assert_same(found: &Camera, expected: &Camera) {
    let far = (found.world_from_camera - expected.world_from_camera).to_cols_array().map(f64::abs);
    assert!(far.iter().all(|v| *v < 1e-12), "{found:?}");
    assert!(found.position.distance(expected.position) < 1e-12, "{found:?}");
    assert_eq!((found.width, found.height), (expected.width, expected.height), "columns and rows");
    for axis in 0..2 {
        assert!((found.focal[axis] - expected.focal[axis]).abs() < 1e-12, "{found:?}");
        assert!((found.principal[axis] - expected.principal[axis]).abs() < 1e-12, "{found:?}");
    }
}

#[track_caller]
fn all(folder: &Path) -> Dataset {
    load(folder, "all", &LoadOptions::default()).unwrap()
}

#[test]
fn every_layout_gives_the_same_cameras_and_pictures() {
    let text = folder_of(|folder| write_colmap_text(folder, "PINHOLE"));
    let layouts = [
        (Layout::Colmap, text),
        (Layout::Colmap, folder_of(|folder| write_colmap_text(folder, "SIMPLE_PINHOLE"))),
        (Layout::Colmap, folder_of(write_colmap_binary)),
        (Layout::Transforms, folder_of(write_transforms)),
        (Layout::Nsvf, folder_of(write_nsvf)),
        (Layout::Llff, folder_of(write_llff)),
        (Layout::Metashape, folder_of(|folder| write_metashape(folder, ""))),
    ];
    for (layout, folder) in layouts {
        assert_eq!(Layout::of(folder.path()).unwrap(), layout);
        let dataset = all(folder.path());
        assert_eq!(dataset.views.len(), PHOTOGRAPHS, "{layout:?}");
        for view in &dataset.views {
            let n: usize = view.name.rsplit(' ').next().unwrap().parse().unwrap();
            assert_same(&view.camera, &cameras()[n]);
            assert!(view.camera.lens.is_pinhole());
            let [red, green, blue] = view.pixels.color(5, [0.0; 3]).map(|v| 255.0 * v);
            let near = |found: f32, expected: f32| (found - expected).abs() < 3.0;
            assert!(near(red, 20.0 * n as f32) && near(green, 100.0) && near(blue, 200.0), "{layout:?} {red}");
        }
    }
}

#[test]
fn metashape_s_lens_is_brown_s_with_its_own_order_of_tangential_terms() {
    let (cx, cy, b1, k, p) = (0.7, -0.4, 0.3, [0.05, -0.02, 0.007, -0.001], [0.003, -0.002]);
    let keys = format!(
        "<cx>{cx}</cx><cy>{cy}</cy><b1>{b1}</b1><k1>{}</k1><k2>{}</k2><k3>{}</k3><k4>{}</k4><p1>{}</p1><p2>{}</p2>",
        k[0], k[1], k[2], k[3], p[0], p[1]
    );
    let folder = folder_of(|folder| write_metashape(folder, &keys));
    let dataset = all(folder.path());
    assert_eq!(dataset.lost, 1, "frames without a pose");
    let (camera, pose) = (dataset.views[2].camera, cameras()[2]);
    for seen in [DVec3::new(0.3, -0.2, 1.0), DVec3::new(-0.5, 0.4, 1.1), DVec3::new(0.1, 0.3, 0.9)] {
        // Appendix of Metashape's manual: "Camera models", frame cameras.
        let (x, y) = (seen.x / seen.z, seen.y / seen.z);
        let r2 = x * x + y * y;
        let radial = 1.0 + k[0] * r2 + k[1] * r2.powi(2) + k[2] * r2.powi(3) + k[3] * r2.powi(4);
        let u = x * radial + p[0] * (r2 + 2.0 * x * x) + 2.0 * p[1] * x * y;
        let v = y * radial + p[1] * (r2 + 2.0 * y * y) + 2.0 * p[0] * x * y;
        let expected = [12.0 + cx + u * 20.0 + u * b1, 8.0 + cy + v * 20.0];
        let found = camera.project(pose.position + in_opencv(&pose) * seen).unwrap();
        assert!((found.x - expected[0]).abs() < 1e-9 && (found.y - expected[1]).abs() < 1e-9, "{found} {expected:?}");
    }
}

#[test]
fn hostile_files_of_metashape_are_refused() {
    let folder = folder_of(|folder| write_metashape(folder, ""));
    let path = folder.path().join("cameras.xml");
    let text = fs::read_to_string(&path).unwrap();
    let deep = format!("<document>{}", "<chunk>".repeat(200_000));
    let bomb = r#"<!DOCTYPE a [<!ENTITY b "bbbb"><!ENTITY c "&b;&b;">]><document>&c;</document>"#;
    for (changed, parts) in [
        (deep, &["Metashape's XML"][..]),
        (bomb.into(), &["Metashape's XML"]),
        ("<document/>".into(), &["document", "chunk"]),
        (text.replace("sensor_id=\"3\"", "sensor_id=\"4\""), &["sensor_id", "the id of a sensor"]),
        (text.replace("type=\"frame\"", "type=\"cylindrical\""), &["sensor \"unknown\": type", "spherical"]),
        (text.replace("<f>20</f>", "<f>0</f>"), &["the focal length"]),
        (text.replace("<f>20</f>", "<f>many</f>"), &["sensor \"unknown\": f", "a number"]),
        (text.replace("<f>20</f>", "<f>20</f><b2>1</b2>"), &["b2", "skew"]),
        (text.replace("<f>20</f>", "<f>20</f><p3>1</p3>"), &["p3 must be 0"]),
        (text.replace("<f>20</f>", "<f>20</f><k1>nan</k1>"), &["finite coefficients"]),
        (text.replace("width=\"24\"", "width=\"1e9\""), &["1 to 16384"]),
        (text.replace(" 0 0 0 1</transform>", " 0 0 0</transform>"), &["transform", "16 numbers; found 15"]),
        (text.replace(" 0 0 0 1</transform>", " 0 0 0 nan</transform>"), &["transform"]),
        (text.replace("label=\"photo 00.jpg\"", "label=\"../a.jpg\""), &["label", "a picture in images"]),
    ] {
        assert_ne!(changed, text, "{parts:?}");
        write(&path, changed);
        refused(folder.path(), parts);
    }
}

#[test]
fn every_eighth_photograph_by_name_is_a_test_view_unless_the_layout_has_splits() {
    let folder = folder_of(write_transforms);
    let names = |split: &str, options: &LoadOptions| -> Vec<String> {
        load(folder.path(), split, options).unwrap().views.into_iter().map(|view| view.name).collect()
    };
    let options = LoadOptions::default();
    assert_eq!(names("test", &options), [name(0), name(8)]);
    assert_eq!(names("train", &options).len(), 8);
    let holdout = |holdout| LoadOptions { holdout, ..LoadOptions::default() };
    assert_eq!(names("test", &holdout(Holdout { every: 5, names: None })), [name(0), name(5)]);
    assert_eq!(names("train", &holdout(Holdout { every: 0, names: None })).len(), PHOTOGRAPHS);
    let list = folder.path().join("test.txt");
    write(&list, format!("{}\nimages/{}.jpg\n\n", name(3), name(4)));
    let named = holdout(Holdout { every: 8, names: Some(list.clone()) });
    assert_eq!(names("test", &named), [name(3), name(4)]);
    write(&list, "photo 99.jpg\n");
    let message = load(folder.path(), "test", &named).unwrap_err().to_string();
    assert!(message.contains("test.txt: the name \"photo 99\"") && message.contains("no such photograph"), "{message}");

    let folder = folder_of(write_nsvf);
    let count = |split| load(folder.path(), split, &options).unwrap().views.len();
    assert_eq!((count("train"), count("test"), count("val")), (7, 3, 3));
    let none = folder_of(write_transforms);
    let message = load(none.path(), "valid", &options).unwrap_err().to_string();
    assert!(message.contains("the split must be train"), "{message}");
}

#[test]
fn splits_of_nerfstudio_are_its_lists() {
    let folder = folder_of(write_transforms);
    let path = folder.path().join("transforms.json");
    let mut json: serde_json::Value = serde_json::from_slice(&fs::read(&path).unwrap()).unwrap();
    let file = |n: usize| format!("images/{}.jpg", name(n));
    json["train_filenames"] = json!((0..7).map(file).collect::<Vec<_>>());
    json["val_filenames"] = json!([file(7)]);
    json["test_filenames"] = json!([file(8), file(9)]);
    write(&path, json.to_string());
    let count = |split| load(folder.path(), split, &LoadOptions::default()).unwrap().views.len();
    assert_eq!((count("train"), count("val"), count("test"), count("all")), (7, 1, 2, 10));
}

#[test]
fn smaller_pictures_beside_the_photographs_are_used() {
    let folder = folder_of(write_colmap_binary);
    let halves = LoadOptions { downscale: 2, ..LoadOptions::default() };
    let before = load(folder.path(), "all", &halves).unwrap();
    write_pictures(&folder.path().join("images_2"), "png", 2);
    fs::remove_dir_all(folder.path().join("images")).unwrap();
    let after = load(folder.path(), "all", &halves).unwrap();
    for (before, after) in before.views.iter().zip(&after.views) {
        assert_same(&after.camera, &before.camera);
        assert_eq!((after.camera.width, after.camera.height), (12, 8));
    }
    let error = load(folder.path(), "all", &LoadOptions::default()).unwrap_err();
    assert!(error.to_string().contains("10 of 10 pictures do not exist"), "{error}");
}

#[test]
fn missing_pictures_are_counted_and_left_out_on_request() {
    let folder = folder_of(write_colmap_binary);
    for n in [1, 2, 6] {
        fs::remove_file(folder.path().join(format!("images/{}.png", name(n)))).unwrap();
    }
    let error = load(folder.path(), "all", &LoadOptions::default()).unwrap_err();
    assert_eq!(error.kind(), ErrorKind::Io);
    let message = error.to_string();
    assert!(message.contains("3 of 10 pictures do not exist") && message.contains("photo 01.png"), "{message}");
    let skipping = LoadOptions { skip_missing: true, ..LoadOptions::default() };
    let dataset = load(folder.path(), "all", &skipping).unwrap();
    assert_eq!((dataset.views.len(), dataset.left_out.len()), (7, 3));
    assert_eq!(load_cameras(folder.path(), "all", None, &skipping).unwrap().len(), 7);
    // Instant-NGP's own examples lack pictures, so that layout leaves them out.
    let folder = folder_of(write_transforms);
    fs::remove_file(folder.path().join(format!("images/{}.jpg", name(4)))).unwrap();
    assert_eq!((all(folder.path()).views.len(), all(folder.path()).left_out.len()), (9, 1));
}

#[test]
fn what_else_a_layout_says_is_kept() {
    let folder = folder_of(|folder| write_colmap_text(folder, "OPENCV"));
    let dataset = all(folder.path());
    assert_eq!(dataset.points, Some(folder.path().join("sparse/0/points3D.txt")));
    let distortion = Distortion::new([0.1, 0.01, 0.0, 0.0], [0.0; 3], [0.001, -0.002], [0.0; 2]).unwrap();
    let lens = Lens { projection: Projection::Perspective, distortion };
    assert!(dataset.views.iter().all(|view| view.camera.lens == lens));
    let folder = folder_of(write_nsvf);
    let bounds = all(folder.path()).bounds.unwrap();
    assert_eq!((bounds.min, bounds.max), (DVec3::new(-1.0, -2.0, -3.0), DVec3::new(1.0, 2.0, 3.0)));
    let folder = folder_of(write_colmap_binary);
    fs::create_dir(folder.path().join("masks")).unwrap();
    let mask = image::GrayImage::from_fn(24, 16, |x, _| image::Luma([if x < 12 { 255 } else { 0 }]));
    mask.save(folder.path().join(format!("masks/{}.png.png", name(2)))).unwrap();
    mask.save(folder.path().join(format!("masks/{}.png", name(5)))).unwrap();
    let masked: Vec<_> = all(folder.path()).views.into_iter().filter(|view| view.mask.is_some()).collect();
    assert_eq!(masked.iter().map(|view| view.name.as_str()).collect::<Vec<_>>(), [name(2), name(5)]);
    assert!((0..384).all(|n| masked[0].counts(n) == (n % 24 < 12)));
}

#[test]
fn photographs_are_turned_as_their_camera_held_them() {
    // A JPEG of 24x16 pixels that EXIF turns by a quarter: upright it has 16 columns and 24 rows.
    let folder = folder_of(write_transforms);
    let turned = |path: &Path| {
        let bytes = fs::read(path).unwrap();
        let exif = b"\xff\xe1\x00\x22Exif\0\0MM\0\x2a\0\0\0\x08\0\x01\x01\x12\0\x03\0\0\0\x01\0\x06\0\0\0\0\0\0";
        write(path, [&bytes[..2], exif, &bytes[2..]].concat());
    };
    (0..PHOTOGRAPHS).for_each(|n| turned(&folder.path().join(format!("images/{}.jpg", name(n)))));
    // Intrinsics for the picture as stored: it stays as it is.
    assert_eq!(all(folder.path()).views[0].camera.width, 24);
    let path = folder.path().join("transforms.json");
    let text = fs::read_to_string(&path).unwrap();
    let text = text.replace("\"w\":24", "\"w\":16").replace("\"h\":16", "\"h\":24");
    write(&path, text);
    let view = &all(folder.path()).views[0];
    assert_eq!((view.camera.width, view.camera.height, view.pixels.len()), (16, 24, 384));
}

#[test]
fn the_command_says_what_it_understood_and_draws_it() {
    let folder = folder_of(|folder| write_colmap_text(folder, "OPENCV"));
    fs::remove_file(folder.path().join(format!("images/{}.png", name(4)))).unwrap();
    let drawn = folder.path().join("cameras.png");
    let info = |arguments: &[&std::ffi::OsStr]| {
        let mut command = command(STRIVEC, folder.path(), &["dataset", "info"]);
        printed(&command.arg(folder.path()).args(arguments).output().unwrap())
    };
    let text = info(&["--picture".as_ref(), drawn.as_ref()]);
    for part in
        ["10 photographs in the layout colmap", "8 train, 2 test", "1 camera of 24x16: perspective with distortion"]
    {
        assert!(text.contains(part), "{part:?} is not in {text}");
    }
    assert!(text.contains("not there     images/photo 04.png: 1 picture not there"), "{text}");
    let picture = image::open(&drawn).unwrap().into_rgb8();
    assert!(picture.pixels().any(|p| p.0 == [31, 119, 180]), "training cameras are blue");
    assert!(picture.pixels().any(|p| p.0 == [255, 127, 14]), "test cameras are orange");
    let json: serde_json::Value = serde_json::from_str(&info(&["--json".as_ref()])).unwrap();
    assert_eq!((&json["layout"], &json["splits"][0]["photographs"]), (&json!("colmap"), &json!(8)));
}

#[track_caller]
fn refused(folder: &Path, parts: &[&str]) {
    let error: Error = load(folder, "all", &LoadOptions::default()).unwrap_err();
    let message = error.to_string();
    assert_eq!(error.kind(), ErrorKind::Malformed, "{message}");
    assert!(!message.contains('\n'), "{message}");
    for part in parts {
        assert!(message.contains(part), "{part:?} is not in {message:?}");
    }
}

/// A change of a file's bytes.
type Change<'a> = &'a dyn Fn(&mut Vec<u8>);

#[test]
fn hostile_colmap_projects_are_refused() {
    let [cameras, images] = colmap_binary();
    let with = |name: &str, change: Change<'_>| {
        let folder = folder_of(write_colmap_binary);
        let mut bytes = if name == "cameras.bin" { cameras.clone() } else { images.clone() };
        change(&mut bytes);
        write(&folder.path().join("sparse").join(name), bytes);
        folder
    };
    let cases: [(&str, Change<'_>, &[&str]); 12] = [
        ("cameras.bin", &|b| b[..8].fill(0xff), &["cameras.bin: byte 0", "at most 2 cameras", "18446744073709551615"]),
        ("cameras.bin", &|b| b[12] = 99, &["cameras.bin: byte 8", "number 0 to 17", "99"]),
        ("cameras.bin", &|b| b.truncate(30), &["cameras.bin"]),
        ("cameras.bin", &|b| b.push(0), &["cameras.bin: byte 64", "the end of the file", "1 more"]),
        ("cameras.bin", &|b| b[32..40].fill(0), &["camera 7: the focal length", "positive", "found 0"]),
        ("cameras.bin", &|b| b[32..40].fill(0xff), &["camera 7: the focal length", "NaN"]),
        ("cameras.bin", &|b| b[16..24].fill(0xff), &["camera 7: the width", "4294967295"]),
        ("images.bin", &|b| b[..8].fill(0xff), &["images.bin: byte 0", "images"]),
        ("images.bin", &|b| b[12..44].fill(0), &["image 0", "unit quaternion"]),
        ("images.bin", &|b| b[68] = 9, &["image 0", "a camera of", "found 9"]),
        ("images.bin", &|b| b[72..77].copy_from_slice(b"../.."), &["image 0", "the name of a picture"]),
        ("images.bin", &|b| b[85..93].fill(0x7f), &["points of an image", "9187201950435737471"]),
    ];
    for (name, change, parts) in cases {
        refused(with(name, change).path(), parts);
    }
    let folder = folder_of(|folder| write_colmap_text(folder, "PINHOLE"));
    let file = |name: &str| folder.path().join("sparse/0").join(name);
    for (name, text, parts) in [
        ("cameras.txt", "1 PINHOLE 24 16 20 20 12", &["camera 1", "PINHOLE with 3 parameters"][..]),
        ("cameras.txt", "1 PINHOLE 24 sixteen 20 20 12 8", &["cameras.txt: line 1", "\"sixteen\""]),
        ("cameras.txt", "1 PINHOLE 24 16 inf 20 12 8", &["camera 1: the focal length", "inf"]),
        ("cameras.txt", "1 FOV 24 16 20 20 12 8 0.9", &["camera 1", "FOV with 5 parameters", "OPENCV"]),
        ("images.txt", "1 0 0 0 0 0 0 0 1 a.png\n\n", &["image 1", "unit quaternion"]),
        ("images.txt", "1 1 0 0 0 0 0 0 1 /etc/passwd\n\n", &["image 1", "/etc/passwd"]),
        ("images.txt", "1 1 0 0 0 0 0\n", &["line 1", "the end of the line"]),
        ("images.txt", "# nothing\n", &["at least one frame"]),
    ] {
        let before = fs::read(file(name)).unwrap();
        write(&file(name), text);
        refused(folder.path(), parts);
        write(&file(name), before);
    }
}

#[test]
fn hostile_files_of_the_other_layouts_are_refused() {
    let folder = folder_of(write_nsvf);
    let pose = folder.path().join(format!("pose/0_{}.txt", name(1)));
    for (path, text, parts) in [
        (&pose, "1 0 0 0 0 1 0 0 0 0 1 0 0 0 0", &["the matrix", "16 numbers"][..]),
        (&pose, "1 0 0 0 0 2 0 0 0 0 1 0 0 0 0 1", &["orthonormal"]),
        (&folder.path().join("intrinsics.txt"), "0 12 8 0", &["the focal length"]),
        (&folder.path().join("intrinsics.txt"), "20 900 8 0", &["the principal point's column", "middle half"]),
        (&folder.path().join("intrinsics.txt"), "20", &["f, cx and cy"]),
        (&folder.path().join("bbox.txt"), "1 1 1 0 0 0", &["two corners"]),
    ] {
        let before = fs::read(path).unwrap();
        write(path, text);
        refused(folder.path(), parts);
        write(path, before);
    }
    fs::remove_file(&pose).unwrap();
    assert_eq!(all(folder.path()).lost, 1, "pictures without a pose");

    let folder = folder_of(write_llff);
    let images = folder.path().join("images");
    fs::rename(&images, folder.path().join("photos")).unwrap();
    refused(folder.path(), &["images must be a folder with a picture for each of the 10 poses"]);
    fs::rename(folder.path().join("photos"), &images).unwrap();
    let array = |shape: &[usize], values: &[f64]| {
        let mut file = Vec::new();
        npy::write(&mut file, shape, values.iter().copied()).unwrap();
        write(&folder.path().join("poses_bounds.npy"), file);
    };
    array(&[9, 17], &[0.0; 9 * 17]);
    refused(folder.path(), &["poses", "10 pictures", "found 9"]);
    array(&[10, 17], &[f64::NAN; 170]);
    refused(folder.path(), &["pose 0"]);
    array(&[17, 10], &[0.0; 170]);
    refused(folder.path(), &["[photographs][17]"]);
}

#[test]
fn a_folder_with_a_part_of_a_layout_is_told_the_rest() {
    let folder = folder_of(write_nsvf);
    fs::remove_file(folder.path().join("intrinsics.txt")).unwrap();
    refused(
        folder.path(),
        &["is not a dataset: it has pose and rgb of nsvf without intrinsics.txt; the layouts are blender"],
    );
    let folder = folder_of(write_colmap_binary);
    fs::remove_file(folder.path().join("sparse/images.bin")).unwrap();
    refused(folder.path(), &["it has sparse/cameras.bin of colmap without sparse/images.bin"]);
    let folder = folder_of(|folder| write_colmap_text(folder, "PINHOLE"));
    fs::remove_file(folder.path().join("sparse/0/cameras.txt")).unwrap();
    refused(folder.path(), &["it has sparse/0/images.txt of colmap without sparse/0/cameras.txt"]);
    fs::remove_dir_all(folder.path().join("sparse")).unwrap();
    refused(folder.path(), &["it has 10 pictures without poses, which `strivec pose` estimates"]);
    fs::remove_dir_all(folder.path().join("images")).unwrap();
    refused(folder.path(), &["it has neither files of a layout nor pictures"]);
}

#[cfg(unix)]
#[test]
fn links_in_circles_end_with_an_error() {
    let folder = folder_of(write_transforms);
    let circle = |path: &str| {
        let path = folder.path().join(path);
        fs::remove_file(&path).unwrap();
        std::os::unix::fs::symlink(path.file_name().unwrap(), &path).unwrap();
    };
    circle(&format!("images/{}.jpg", name(3)));
    let dataset = all(folder.path());
    assert_eq!((dataset.views.len(), dataset.left_out.len()), (PHOTOGRAPHS - 1, 1), "the picture does not exist");
    circle("transforms.json");
    let options = LoadOptions { layout: Some(Layout::Transforms), ..LoadOptions::default() };
    let error = load(folder.path(), "all", &options).unwrap_err();
    assert_eq!(error.kind(), ErrorKind::Io, "{error}");

    let folder = folder_of(write_llff);
    fs::remove_dir_all(folder.path().join("images")).unwrap();
    std::os::unix::fs::symlink("images", folder.path().join("images")).unwrap();
    refused(folder.path(), &["images must be a folder"]);
}
