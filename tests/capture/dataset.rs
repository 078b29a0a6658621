//! Loading photographs: the Blender layout, everything that can be wrong with it, and the original dataset if it is
//! present.

use crate::data;

use std::fs;
use std::path::PathBuf;

use glam::{DMat3, DVec3};
use image::{ImageBuffer, Rgb, Rgba, RgbaImage};
use serde_json::{Value, json};
use strivec_capture::dataset::{
    Error, ErrorKind, Layout, LoadOptions, Pixels, fitting_downscale, load, load_cameras, load_transforms_cameras,
};
use strivec_format::geometry::{Distortion, Projection};
use tempfile::TempDir;

const POSE: [[f64; 4]; 4] = [[1.0, 0.0, 0.0, 0.5], [0.0, 0.0, -1.0, -4.0], [0.0, 1.0, 0.0, 0.25], [0.0, 0.0, 0.0, 1.0]];

/// A dataset of two 6×4 pictures, half transparent red on the left and opaque blue on the right.
struct Small {
    folder: TempDir,
    json: Value,
}

impl Small {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        fs::create_dir(folder.path().join("train")).unwrap();
        let picture =
            RgbaImage::from_fn(6, 4, |x, _| if x < 3 { Rgba([255, 0, 0, 51]) } else { Rgba([0, 0, 255, 255]) });
        picture.save(folder.path().join("train/r_0.png")).unwrap();
        picture.save(folder.path().join("train/r_1.png")).unwrap();
        let json = json!({
            "camera_angle_x": 0.8,
            "frames": [
                { "file_path": "./train/r_0", "rotation": 0.1, "transform_matrix": POSE },
                { "file_path": "train\\r_1.png", "transform_matrix": POSE },
            ],
        });
        Self { folder, json }
    }

    fn path(&self, file: &str) -> PathBuf {
        self.folder.path().join(file)
    }

    fn load(&self, options: &LoadOptions) -> Result<strivec_capture::dataset::Dataset, Error> {
        fs::write(self.path("transforms_train.json"), self.json.to_string()).unwrap();
        load(self.folder.path(), "train", options)
    }

    /// The error of loading: its kind and its line, which must be one line that names a file unless it is an argument.
    fn error(&self) -> (ErrorKind, String) {
        described(self.load(&LoadOptions::default()).unwrap_err())
    }
}

fn described(error: Error) -> (ErrorKind, String) {
    let line = error.to_string();
    assert!(!line.contains('\n'), "{line}");
    (error.kind(), line)
}

#[track_caller]
fn assert_error((kind, line): (ErrorKind, String), expected: ErrorKind, parts: &[&str]) {
    assert_eq!(kind, expected, "{line}");
    for part in parts {
        assert!(line.contains(part), "{part:?} is not in {line:?}");
    }
}

#[test]
fn a_turn_moves_cameras_about_z_and_leaves_their_pictures() {
    let small = Small::new();
    let plain = small.load(&LoadOptions::default()).unwrap();
    let turned = small.load(&LoadOptions { turn_degrees: 90.0, ..LoadOptions::default() }).unwrap();
    // Counterclockwise seen from above: x becomes y, and y becomes -x.
    let turn = DMat3::from_cols(DVec3::Y, -DVec3::X, DVec3::Z);
    for (before, after) in plain.views.iter().zip(&turned.views) {
        assert!((after.camera.position - turn * before.camera.position).length() < 1e-12);
        let difference = after.camera.world_from_camera - turn * before.camera.world_from_camera;
        assert!(difference.to_cols_array().iter().all(|d| d.abs() < 1e-12), "{difference}");
        assert_eq!(after.pixels, before.pixels);
    }
    assert!((turned.views[0].camera.position - DVec3::new(4.0, 0.5, 0.25)).length() < 1e-12);
}

#[test]
fn blender_layout_gives_names_cameras_and_composited_pixels() {
    let small = Small::new();
    let dataset = small.load(&LoadOptions::default()).unwrap();
    assert_eq!(dataset.name, small.folder.path().file_name().unwrap().to_str().unwrap());
    assert_eq!(dataset.views.iter().map(|v| v.name.as_str()).collect::<Vec<_>>(), ["r_0", "r_1"]);
    let view = &dataset.views[0];
    assert_eq!((view.camera.width, view.camera.height, view.pixels.len()), (6, 4, 24));
    assert_eq!(view.camera.principal, [3.0, 2.0]);
    assert!((view.camera.focal[0] - 3.0 / 0.4_f64.tan()).abs() < 1e-12);
    assert_eq!(view.camera.position, DVec3::new(0.5, -4.0, 0.25));
    // The camera looks along its −z: here along the world's +y, with the world's z upwards.
    assert!((view.camera.ray_through(3.0, 2.0).unwrap().direction - DVec3::Y).length() < 1e-12);
    assert!(view.camera.ray(0, 0).unwrap().direction.z > 0.0);
    let Pixels::Rgba8(pixels) = &view.pixels else { panic!("8-bit files stay so") };
    assert_eq!([pixels[0], pixels[5]], [[255, 0, 0, 51], [0, 0, 255, 255]]);
    assert_eq!(view.pixels.color(0, [1.0; 3]), [1.0, 0.8, 0.8]);
    assert_eq!(view.pixels.color(0, [0.0, 0.5, 1.0]), [0.2, 0.4, 0.8]);
    assert_eq!(view.pixels.color(5, [1.0; 3]), [0.0, 0.0, 1.0]);
}

#[test]
fn downscaling_averages_blocks_and_drops_what_is_left() {
    let dataset = Small::new().load(&LoadOptions { downscale: 4, ..LoadOptions::default() }).unwrap();
    let view = &dataset.views[0];
    assert_eq!((view.camera.width, view.camera.height), (1, 1));
    assert_eq!(view.camera.principal, [0.75, 0.5]);
    assert_eq!(view.pixels.colors([0.0; 3]), [[0.15, 0.0, 0.25]]);
    assert_eq!(view.pixels.colors([0.0, 1.0, 0.0]), [[0.15, 0.6, 0.25]]);
}

#[test]
fn pictures_without_alpha_are_opaque_and_16_bit_ones_keep_their_depth() {
    let small = Small::new();
    ImageBuffer::from_pixel(6, 4, Rgb([0_u8, 51, 255])).save(small.path("train/r_0.png")).unwrap();
    ImageBuffer::from_pixel(6, 4, Rgba([0_u16, 257, 65_534, 65_535])).save(small.path("train/r_1.png")).unwrap();
    let views = small.load(&LoadOptions::default()).unwrap().views;
    assert_eq!(views[0].pixels.color(7, [1.0; 3]), [0.0, 0.2, 1.0]);
    let deep = [0.0, (257.0 / 65_535.0) as f32, (65_534.0 / 65_535.0_f64) as f32];
    assert_eq!(views[1].pixels.color(7, [1.0; 3]), deep);
    assert!(views.iter().all(|v| v.pixels.is_opaque()));
}

#[test]
fn intrinsics_in_pixels_win_over_the_angle() {
    let mut small = Small::new();
    for (key, value) in [("w", 6.0), ("h", 4.0), ("fl_x", 7.0), ("fl_y", 8.0), ("cx", 2.5), ("cy", 1.5)] {
        small.json[key] = json!(value);
    }
    let camera = small.load(&LoadOptions::default()).unwrap().views[0].camera;
    assert_eq!((camera.focal, camera.principal), ([7.0, 8.0], [2.5, 1.5]));
}

#[test]
fn cameras_take_their_size_from_keys_then_pictures_then_the_caller() {
    let mut small = Small::new();
    small.load(&LoadOptions::default()).unwrap();
    let json = small.path("transforms_train.json");
    let half = LoadOptions { downscale: 2, ..LoadOptions::default() };
    let size =
        |given| load_transforms_cameras(&json, given, &half).map(|c| (c.len(), c[1].camera.width, c[1].camera.height));
    assert_eq!(size(Some([100, 50])).unwrap(), (2, 3, 2));
    fs::remove_dir_all(small.path("train")).unwrap();
    assert_eq!(size(Some([100, 50])).unwrap(), (2, 50, 25));
    assert_error(described(size(None).unwrap_err()), ErrorKind::Malformed, &["transforms_train.json", "picture size"]);
    small.json["w"] = json!(20);
    small.json["h"] = json!(10);
    fs::write(&json, small.json.to_string()).unwrap();
    assert_eq!(size(Some([100, 50])).unwrap(), (2, 10, 5));
}

#[test]
fn missing_files_are_the_system_s_fault() {
    let mut small = Small::new();
    small.load(&LoadOptions::default()).unwrap();
    assert_error(
        described(load(small.folder.path(), "test", &LoadOptions::default()).unwrap_err()),
        ErrorKind::Io,
        &["transforms_test.json"],
    );
    small.json["frames"][1]["file_path"] = json!("./train/r_7");
    assert_error(
        small.error(),
        ErrorKind::Io,
        &["transforms_train.json: 1 of 2 pictures", "r_7.png", "`skip_missing`"],
    );
    small.json["frames"][1]["file_path"] = json!("train");
    fs::create_dir(small.path("train.png")).unwrap();
    assert_error(small.error(), ErrorKind::Io, &["1 of 2", "train.png"]);
}

#[test]
fn malformed_json_is_reported_with_line_and_column() {
    let folder = tempfile::tempdir().unwrap();
    let deep = format!("{{\"unknown\": {}", "[".repeat(100_000));
    for (text, part) in [
        ("{\n \"frames\": [}", "line 2 column 13"),
        ("", "line 1 column 0"),
        ("{}", "`frames`"),
        ("{\"frames\": [{\"file_path\": \"a\"}]}", "`transform_matrix`"),
        ("{\"frames\": [{\"file_path\": \"a\", \"transform_matrix\": [[1, 2], [3]]}]}", "line 1"),
        ("{\"frames\": 1e999}", "line 1"),
        (&deep, "line 1 column"),
        ("\u{0}\u{1}", "line 1"),
    ] {
        fs::write(folder.path().join("transforms_train.json"), text).unwrap();
        let error = load(folder.path(), "train", &LoadOptions::default()).unwrap_err();
        assert_error(described(error), ErrorKind::Malformed, &["transforms_train.json", part]);
    }
}

#[test]
fn senseless_frames_are_malformed() {
    let mut small = Small::new();
    for (key, value, parts) in [
        ("file_path", json!(""), ["frame 1", "file_path"]),
        ("file_path", json!("train/.."), ["frame 1", "file_path"]),
        ("file_path", json!("train/"), ["frame 1", "file_path"]),
    ] {
        small.json["frames"][1][key] = value;
        assert_error(small.error(), ErrorKind::Malformed, &parts);
    }
    let mut small = Small::new();
    small.json["frames"][1]["transform_matrix"][0][0] = json!(1.01);
    assert_error(small.error(), ErrorKind::Malformed, &["frame 1", "transform_matrix", "orthonormal", "2.0"]);
    small.json["frames"][1]["transform_matrix"][0][0] = json!(-1.0);
    assert_error(small.error(), ErrorKind::Malformed, &["frame 1", "right-handed"]);
    small.json["frames"][1]["transform_matrix"][3][3] = json!(2.0);
    assert_error(small.error(), ErrorKind::Malformed, &["frame 1", "last row"]);
    small.json["frames"] = json!([]);
    assert_error(small.error(), ErrorKind::Malformed, &["no frames", "at least one"]);
}

#[test]
fn senseless_intrinsics_are_malformed() {
    for (key, value, place, part) in [
        ("camera_angle_x", json!(0.0), "frame 0: the angle of view", "between 0 and"),
        ("camera_angle_x", json!(3.2), "frame 0: the angle of view", "between 0 and"),
        ("camera_angle_x", json!(-1.0), "frame 0: the angle of view", "between 0 and"),
        ("camera_angle_x", json!(null), "frame 0: camera_angle_x", "neither"),
        ("fl_x", json!(0.0), "frame 0: the focal length along columns", "positive"),
        ("fl_x", json!(-2.0), "frame 0: the focal length along columns", "positive"),
        ("cx", json!(1e308), "frame 0: the principal point's column", "within"),
        ("cx", json!(5.9), "the principal point's column", "middle half"),
        ("w", json!(6.5), "frame 0: w", "whole"),
        ("w", json!(1e9), "frame 0: w", "whole"),
        ("camera_model", json!("FOV"), "frame 0: camera_model", "OPENCV_FISHEYE"),
        ("aabb_scale", json!(0.0), "aabb_scale", "positive"),
        ("mask_path", json!("../mask.png"), "mask_path", "in the dataset's folder"),
    ] {
        let mut small = Small::new();
        if key == "w" {
            small.json["h"] = json!(4);
        }
        small.json[key] = value;
        assert_error(small.error(), ErrorKind::Malformed, &["transforms_train.json", place, part]);
        // The same of a frame alone.
        if place.starts_with("frame 0") && key != "camera_angle_x" {
            let value = small.json[key].take();
            small.json.as_object_mut().unwrap().remove(key);
            small.json["frames"][1][key] = value;
            small.json["frames"][1]["h"] = json!(4);
            let place = place.replace("frame 0", "frame 1");
            assert_error(small.error(), ErrorKind::Malformed, &["transforms_train.json", &place, part]);
        }
    }
}

#[test]
fn frames_override_the_intrinsics_at_the_top() {
    let mut small = Small::new();
    for (key, value) in [("w", 6.0), ("h", 4.0), ("fl_x", 7.0), ("fl_y", 8.0), ("cx", 2.5), ("cy", 1.5), ("k1", 0.1)] {
        small.json[key] = json!(value);
    }
    small.json["frames"][1]["fl_x"] = json!(20.0);
    small.json["frames"][1]["cx"] = json!(3.5);
    let views = small.load(&LoadOptions::default()).unwrap().views;
    let [common, own] = [views[0].camera, views[1].camera];
    assert_eq!((common.focal, common.principal), ([7.0, 8.0], [2.5, 1.5]));
    // A focal length of its own comes with its own fl_y, or square pixels.
    assert_eq!((own.focal, own.principal), ([20.0, 20.0], [3.5, 1.5]));
    assert!(own.lens == common.lens && !own.lens.is_pinhole());
    small.json["frames"][1]["k1"] = json!(-0.2);
    small.json["frames"][1]["camera_model"] = json!("OPENCV_FISHEYE");
    let own = small.load(&LoadOptions::default()).unwrap().views[1].camera;
    assert_eq!(own.lens.projection, Projection::Fisheye);
    assert_eq!(own.lens.distortion, Distortion::new([-0.2, 0.0, 0.0, 0.0], [0.0; 3], [0.0; 2], [0.0; 2]).unwrap());
}

#[test]
fn distortion_bends_rays_as_opencv_does() {
    let mut small = Small::new();
    for (key, value) in [("w", 6.0), ("h", 4.0), ("fl_x", 5.0), ("k1", 0.1), ("k2", -0.02), ("p1", 0.01), ("p2", 0.003)]
    {
        small.json[key] = json!(value);
    }
    let camera = small.load(&LoadOptions::default()).unwrap().views[0].camera;
    // The point (0.4, −0.3) of the undistorted picture, by OpenCV's formula.
    let (x, y) = (0.4, -0.3);
    let s: f64 = x * x + y * y;
    let radial = 1.0 + 0.1 * s - 0.02 * s * s;
    let at = [
        x * radial + 2.0 * 0.01 * x * y + 0.003 * (s + 2.0 * x * x),
        y * radial + 0.01 * (s + 2.0 * y * y) + 2.0 * 0.003 * x * y,
    ];
    let ray = camera.ray_through(5.0 * at[0] + 3.0, 5.0 * at[1] + 2.0).unwrap();
    let seen = camera.world_from_camera.transpose() * ray.direction;
    assert!((seen / -seen.z - DVec3::new(x, -y, -1.0)).length() < 1e-12, "{seen}");
}

#[test]
fn masked_pixels_do_not_count() {
    let mut small = Small::new();
    image::GrayImage::from_fn(6, 4, |x, y| image::Luma([if x == 2 && y == 1 { 0 } else { 255 }]))
        .save(small.path("mask.png"))
        .unwrap();
    small.json["frames"][1]["mask_path"] = json!("mask.png");
    let views = small.load(&LoadOptions::default()).unwrap().views;
    assert_eq!(views[0].mask, None);
    assert_eq!((0..24).filter(|&n| !views[1].counts(n)).collect::<Vec<_>>(), [8]);
    let views = small.load(&LoadOptions { downscale: 2, ..LoadOptions::default() }).unwrap().views;
    assert_eq!(views[1].mask.as_deref(), Some(&[true, false, true, true, true, true][..]));
    image::GrayImage::new(4, 6).save(small.path("mask.png")).unwrap();
    assert_error(small.error(), ErrorKind::Malformed, &["mask.png", "must be 6x4", "found 4x6"]);
}

#[test]
fn pixels_beyond_the_fold_of_a_lens_do_not_count() {
    let mut small = Small::new();
    for (key, value) in [("w", 6.0), ("h", 4.0), ("fl_x", 3.0), ("k1", -0.45)] {
        small.json[key] = json!(value);
    }
    let view = &small.load(&LoadOptions::default()).unwrap().views[0];
    // r − 0.45 r³ reaches 0.574 at most: 1.72 pixels from the middle.
    let distance = |n: usize| (n as f64 % 6.0 - 2.5).hypot((n / 6) as f64 - 1.5);
    assert!((0..24).all(|n| view.counts(n) == (distance(n) < 1.72)), "{:?}", view.mask);
}

#[test]
fn harmless_keys_are_ignored() {
    let mut small = Small::new();
    for (key, value) in [
        ("aabb_scale", json!(4)),
        ("scale", json!(0.5)),
        ("offset", json!([0.5, 0.5, 0.5])),
        ("k1", json!(0.0)),
        ("k4", json!(0.0)),
        ("camera_model", json!("OPENCV")),
        ("is_fisheye", json!(false)),
        ("applied_transform", json!([[1, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0]])),
        ("ply_file_path", json!("absent.ply")),
    ] {
        small.json[key] = value;
    }
    small.json["frames"][0]["sharpness"] = json!(12.5);
    let dataset = small.load(&LoadOptions::default()).unwrap();
    assert!(dataset.views.len() == 2 && dataset.views.iter().all(|view| view.camera.lens.is_pinhole()));
    assert_eq!(dataset.points, None);
}

#[test]
fn what_is_no_dataset_is_told_from_what_it_resembles() {
    let small = Small::new();
    small.load(&LoadOptions::default()).unwrap();
    let load = |path: &std::path::Path, split| described(load(path, split, &LoadOptions::default()).unwrap_err());
    let parts = ["transforms_test.json does not exist", "the splits of this dataset are train"];
    assert_error(load(small.folder.path(), "test"), ErrorKind::Io, &parts);
    assert_error(load(&small.path("transforms_train.json"), "train"), ErrorKind::Argument, &["is a file", "folder"]);
    fs::remove_file(small.path("transforms_train.json")).unwrap();
    let parts = ["is not a dataset", "blender (transforms_train.json)", "sparse/0", "poses_bounds.npy", "pose/"];
    assert_error(load(small.folder.path(), "train"), ErrorKind::Malformed, &parts);
    let colmap = LoadOptions { layout: Some(Layout::Colmap), ..LoadOptions::default() };
    let error = described(strivec_capture::dataset::load(small.folder.path(), "train", &colmap).unwrap_err());
    assert!(error.1.contains("colmap (") && !error.1.contains("blender"), "{}", error.1);
}

#[test]
fn broken_pictures_are_malformed() {
    let small = Small::new();
    let good = fs::read(small.path("train/r_1.png")).unwrap();
    // One alone is left out, with its error.
    let both = ["train/r_0.png", "train/r_1.png"];
    for bytes in [&good[..good.len() / 2], b"no picture"] {
        fs::write(small.path(both[1]), bytes).unwrap();
        let dataset = small.load(&LoadOptions::default()).unwrap();
        assert_eq!((dataset.views.len(), dataset.unreadable.len()), (1, 1));
        assert!(dataset.unreadable[0].contains("r_1.png"), "{:?}", dataset.unreadable);
        fs::write(small.path(both[0]), bytes).unwrap();
        assert_error(small.error(), ErrorKind::Malformed, &["r_0.png", "PNG", "2 of 2 are such"]);
        fs::write(small.path(both[0]), &good).unwrap();
    }
    RgbaImage::new(4, 6).save(small.path("train/r_1.png")).unwrap();
    assert_error(small.error(), ErrorKind::Malformed, &["r_1.png", "must be 6x4", "r_0.png", "found 4x6"]);
    // A header that claims 2³¹−1 columns and rows.
    let mut huge = good.clone();
    huge[16..24].copy_from_slice(&[0x7f, 0xff, 0xff, 0xff, 0x7f, 0xff, 0xff, 0xff]);
    let checksum = crc32fast::hash(&huge[12..29]).to_be_bytes();
    huge[29..33].copy_from_slice(&checksum);
    both.iter().for_each(|name| fs::write(small.path(name), &huge).unwrap());
    assert_error(small.error(), ErrorKind::Malformed, &["r_0.png", "PNG"]);
}

#[test]
fn pictures_that_would_not_fit_into_memory_are_refused_before_decoding() {
    let mut small = Small::new();
    let frame = small.json["frames"][0].clone();
    RgbaImage::new(2000, 1000).save(small.path("train/r_0.png")).unwrap();
    small.json["frames"] = Value::Array(vec![frame; 600]);
    let options = LoadOptions { max_memory: 4_700_000_000, ..LoadOptions::default() };
    let error = small.load(&options).unwrap_err();
    assert_error(described(error), ErrorKind::Limit, &["transforms_train.json", "4.8 GB", "4.7 GB of `max_memory`"]);
    // Averaged pixels take four times as much: half the size does not fit, a third does.
    let fitting = |options: &LoadOptions| fitting_downscale(small.folder.path(), "train", options).unwrap();
    assert_eq!(fitting(&options), (3, 4_800_000_000));
    // Decoding takes 4 bytes per pixel for the picture, 1 for gray, and the file.
    let file = fs::metadata(small.path("train/r_0.png")).unwrap().len();
    let most = 4_800_000_000 + 10_000_000 + file;
    assert_eq!(fitting(&LoadOptions { max_memory: most, ..options.clone() }), (1, 4_800_000_000));
    assert_eq!(fitting(&LoadOptions { max_memory: most - 1, ..options.clone() }).0, 3);
    let error = small.load(&LoadOptions { max_memory: most - 1, ..options }).unwrap_err();
    let parts = ["r_0.png: decoding the picture takes 0.010 GB of memory, more than the 0.010 GB", "set `max_memory`"];
    assert_error(described(error), ErrorKind::Limit, &parts);
}

#[test]
fn pictures_of_many_kinds_are_read_whatever_their_names_are() {
    use image::{DynamicImage, ImageBuffer, ImageFormat, Luma, Rgb};
    let small = Small::new();
    let path = small.path("train/r_0.png");
    let color = |x: u32, y: u32| [x as u8 * 40, y as u8 * 60, 9];
    let rgb = DynamicImage::ImageRgb8(ImageBuffer::from_fn(6, 4, |x, y| Rgb(color(x, y))));
    let deep = ImageBuffer::from_fn(6, 4, |x, y| Rgb(color(x, y).map(|channel| u16::from(channel) * 257)));
    let gray = ImageBuffer::from_fn(6, 4, |x, y| Luma([u16::from(color(x, y)[0]) * 257]));
    let expected = |x: u32, y: u32| color(x, y).map(|channel| f32::from(channel) / 255.0);
    let near = |of: &dyn Fn(u32, u32) -> [f32; 3]| {
        let pixels = small.load(&LoadOptions::default()).unwrap().views[0].pixels.colors([0.0; 3]);
        let far = |n: usize| pixels[n].iter().zip(of(n as u32 % 6, n as u32 / 6)).any(|(a, b)| (a - b).abs() > 1e-6);
        assert_eq!((pixels.len(), (0..24).find(|&n| far(n))), (24, None));
    };
    for format in [ImageFormat::Png, ImageFormat::WebP, ImageFormat::Tiff] {
        rgb.save_with_format(&path, format).unwrap();
        near(&expected);
    }
    for format in [ImageFormat::Png, ImageFormat::Tiff] {
        DynamicImage::ImageRgb16(deep.clone()).save_with_format(&path, format).unwrap();
        near(&expected);
        DynamicImage::ImageLuma16(gray.clone()).save_with_format(&path, format).unwrap();
        near(&|x, y| [expected(x, y)[0]; 3]);
    }
    // A bitmap of 24 bits: rows from the bottom, blue first, each of a multiple of four bytes.
    let mut bitmap = b"BM\0\0\0\0\0\0\0\0\x36\0\0\0\x28\0\0\0\x06\0\0\0\x04\0\0\0\x01\0\x18\0".to_vec();
    bitmap.resize(0x36, 0);
    for y in (0..4).rev() {
        (0..6).for_each(|x| bitmap.extend(color(x, y).iter().rev()));
        bitmap.extend([0; 2]);
    }
    fs::write(&path, &bitmap).unwrap();
    near(&expected);
    // A palette of two colors, the second half transparent: PNG chunks are a length, a name, data and a checksum.
    let chunk = |name: &[u8; 4], data: &[u8]| {
        let named = [name, data].concat();
        [&(data.len() as u32).to_be_bytes()[..], &named, &crc32fast::hash(&named).to_be_bytes()].concat()
    };
    let rows = [0, 0b0101_0100].repeat(4);
    let mut checksum = [1_u32, 0];
    rows.iter().for_each(|&byte| {
        checksum[0] += byte;
        checksum[1] += checksum[0];
    });
    let data: Vec<u8> = rows.iter().map(|&byte| byte as u8).collect();
    let deflated =
        [b"\x78\x01\x01\x08\0\xf7\xff", &data[..], &(checksum[1] << 16 | checksum[0]).to_be_bytes()].concat();
    let palette = [
        &b"\x89PNG\r\n\x1a\n"[..],
        &chunk(b"IHDR", &[0, 0, 0, 6, 0, 0, 0, 4, 1, 3, 0, 0, 0]),
        &chunk(b"PLTE", &[255, 0, 0, 0, 0, 255]),
        &chunk(b"tRNS", &[255, 51]),
        &chunk(b"IDAT", &deflated),
        &chunk(b"IEND", &[]),
    ];
    fs::write(&path, palette.concat()).unwrap();
    near(&|x, _| if x % 2 == 0 { [1.0, 0.0, 0.0] } else { [0.0, 0.0, 0.2] });
    for name in ["train/r_0.png", "train/r_1.png"] {
        fs::write(small.path(name), b"\0\0\0\x18ftypheic\0\0\0\0mif1heic").unwrap();
    }
    let parts = ["r_0.png", "found a HEIC picture; convert it, for example by `heif-convert", "2 of 2 are such"];
    assert_error(small.error(), ErrorKind::Malformed, &parts);
}

#[test]
fn senseless_arguments_are_the_caller_s_fault() {
    let small = Small::new();
    for downscale in [0, 5, u32::MAX] {
        let error = small.load(&LoadOptions { downscale, ..LoadOptions::default() }).unwrap_err();
        assert_error(described(error), ErrorKind::Argument, &["downscale", "1 to 4", &downscale.to_string()]);
    }
    for (start, end, every) in [(0, 3, 1), (1, 1, 1), (2, 1, 1), (5, usize::MAX, 1), (0, 2, 0)] {
        let error = small.load(&LoadOptions { views: Some(start..end), every, ..LoadOptions::default() }).unwrap_err();
        let found = format!("found {start}..{end} by {every}");
        assert_error(described(error), ErrorKind::Argument, &["transforms_train.json: views", "0..2", &found]);
    }
}

#[test]
fn only_the_chosen_views_are_looked_at() {
    let mut small = Small::new();
    let frame = small.json["frames"][1].clone();
    small.json["frames"] = (0..10).map(|_| frame.clone()).collect();
    for frame in [0, 1, 3, 4, 6, 7, 9] {
        small.json["frames"][frame]["file_path"] = json!(format!("absent/r_{frame}"));
    }
    for (frame, x) in [(2, 0.0), (5, 1.0), (8, 2.0)] {
        small.json["frames"][frame]["transform_matrix"][0][3] = json!(x);
    }
    let options = LoadOptions { views: Some(2..9), every: 3, ..LoadOptions::default() };
    let views = small.load(&options).unwrap().views;
    assert_eq!(views.iter().map(|v| v.camera.position.x).collect::<Vec<_>>(), [0.0, 1.0, 2.0]);
    assert!(views.iter().all(|v| v.path == "train/r_1.png" && v.pixels.len() == 24));
    let far = LoadOptions { every: 100, views: Some(5..10), ..LoadOptions::default() };
    assert_eq!(small.load(&far).unwrap().views.len(), 1);
    let error = small.load(&LoadOptions { every: 2, ..options }).unwrap_err();
    assert_error(described(error), ErrorKind::Io, &["2 of 4 pictures", "r_4.png"]);
}

#[test]
fn lego_loads_with_orthonormal_poses_and_white_corners() {
    let Some(folder) = data::folder("lego") else { return };
    let dataset = load(&folder, "train", &LoadOptions { downscale: 8, ..LoadOptions::default() }).unwrap();
    assert_eq!((dataset.name.as_str(), dataset.views.len()), ("lego", 100));
    for view in &dataset.views {
        assert_eq!((view.camera.width, view.camera.height, view.pixels.len()), (100, 100, 10_000));
        let gram = view.camera.world_from_camera.transpose() * view.camera.world_from_camera;
        assert!(gram.abs_diff_eq(DMat3::IDENTITY, 1e-15), "{}", view.name);
        // The cameras stand on a sphere of radius 4.03 around the origin and look at it.
        assert!((view.camera.position.length() - 4.031).abs() < 1e-3, "{}", view.name);
        let middle = view.camera.ray_through(50.0, 50.0).unwrap();
        assert!(middle.at(view.camera.position.length()).length() < 1e-3, "{}", view.name);
        assert_eq!(view.pixels.color(0, [1.0; 3]), [1.0; 3], "{}", view.name);
    }
    let cameras = load_cameras(&folder, "test", None, &LoadOptions { downscale: 2, ..LoadOptions::default() }).unwrap();
    assert_eq!((cameras.len(), cameras[0].camera.width), (200, 400));
}

/// JSON has no NaN and no infinity, but Python writes them. One such pose is left out; elsewhere the errors name them.
#[test]
fn numbers_that_are_not_finite_are_named() {
    let text = Small::new().json.to_string();
    for bad in ["NaN", "Infinity", "-Infinity", "1e999", "null"] {
        for (place, from) in [("pose", "0.25"), ("angle", "0.8")] {
            let small = Small::new();
            fs::write(small.path("transforms_train.json"), text.replacen(from, bad, 1)).unwrap();
            match load(small.folder.path(), "train", &LoadOptions::default()) {
                Ok(dataset) if place == "pose" => assert_eq!((dataset.views.len(), dataset.lost), (1, 1), "{bad}"),
                Ok(_) => panic!("{bad} as {place} is read"),
                Err(error) => assert_error(described(error), ErrorKind::Malformed, &["transforms_train.json"]),
            }
        }
    }
    for (key, value) in [("w", 1e300), ("fl_x", -1.0), ("fl_x", 0.0), ("cx", 1e300)] {
        let mut small = Small::new();
        small.json["w"] = json!(6);
        small.json["h"] = json!(4);
        small.json[key] = json!(value);
        let named = match key {
            "w" => "w",
            "fl_x" => "focal length",
            _ => "principal point",
        };
        assert_error(small.error(), ErrorKind::Malformed, &["transforms_train.json", named]);
    }
}
