//! Datasets as people have them: what is there and not used, what means something else, and what has another size.

use std::fs;
use std::path::Path;

use image::{DynamicImage, GrayImage, ImageBuffer, Luma};
use serde_json::{Value, json};
use strivec_capture::dataset::{
    Dataset, Error, Holdout, LoadOptions, Photograph, Pixels, describe, load, read_distances,
};
use strivec_format::geometry::{Distortion, Lens, Projection};
use strivec_import::npy;
use strivec_synth::{CameraModel, Surroundings, SynthLayout, SynthOptions, synthesize};
use tempfile::TempDir;

/// Seven photographs to train on and a test view, of 24x16 pixels.
pub(super) fn made(layout: SynthLayout) -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    let options = SynthOptions {
        layout,
        camera: CameraModel::Pinhole,
        views: 7,
        test_views: 1,
        size: [24, 16],
        seed: 3,
        surroundings: Surroundings::None,
        force: false,
    };
    synthesize(folder.path(), &options).unwrap();
    folder
}

/// All photographs of `folder`.
#[track_caller]
pub(super) fn all(folder: &Path) -> Dataset {
    load(folder, "all", &LoadOptions::default()).unwrap()
}

/// The error of reading all photographs of `folder`.
#[track_caller]
pub(super) fn error(folder: &Path) -> String {
    described(load(folder, "all", &LoadOptions::default()).unwrap_err())
}

pub(super) fn described(error: Error) -> String {
    let line = error.to_string();
    assert!(!line.contains('\n'), "{line}");
    line
}

/// The inventory's lines of `folder`, with their labels.
#[track_caller]
pub(super) fn told(folder: &Path, options: &LoadOptions) -> String {
    let lines = describe(folder, options).unwrap().inventory.lines();
    assert!(lines.len() <= 10, "{lines:?}");
    lines.into_iter().map(|(label, line)| format!("{label}: {line}\n")).collect()
}

#[track_caller]
pub(super) fn assert_told(folder: &Path, parts: &[&str]) {
    let lines = told(folder, &LoadOptions::default());
    for part in parts {
        assert!(lines.contains(part), "{part:?} is not in {lines}");
    }
}

/// Checks that `found` are the same photographs from the same places as `expected`, in any order.
#[track_caller]
pub(super) fn assert_same(found: &[Photograph], expected: &[Photograph]) {
    assert_eq!(found.len(), expected.len(), "photographs");
    for view in expected {
        let is_same = |other: &&Photograph| other.camera.position.distance(view.camera.position) < 1e-9;
        let other = found.iter().find(is_same).unwrap_or_else(|| panic!("{} is not there", view.name));
        assert!(other.pixels == view.pixels, "{}: other pixels", view.name);
        let far = (other.camera.world_from_camera - view.camera.world_from_camera).to_cols_array();
        assert!(far.iter().all(|v| v.abs() < 1e-9), "{}: another pose", view.name);
        assert_eq!(
            (other.camera.focal, other.camera.principal, other.camera.lens),
            (view.camera.focal, view.camera.principal, view.camera.lens),
            "{}",
            view.name
        );
    }
}

/// Changes the `transforms.json` of `folder`.
pub(super) fn edit(folder: &Path, change: impl FnOnce(&mut Value)) {
    let path = folder.join("transforms.json");
    let mut json = serde_json::from_slice(&fs::read(&path).unwrap()).unwrap();
    change(&mut json);
    fs::write(path, json.to_string()).unwrap();
}

pub(super) fn write(path: &Path, bytes: impl AsRef<[u8]>) {
    fs::create_dir_all(path.parent().unwrap()).unwrap();
    fs::write(path, bytes).unwrap();
}

fn copy_folder(from: &Path, to: &Path) {
    fs::create_dir_all(to).unwrap();
    for entry in fs::read_dir(from).unwrap().map(Result::unwrap) {
        fs::copy(entry.path(), to.join(entry.file_name())).unwrap();
    }
}

/// `model`, a binary file of images with one `camera`, with the first `count` images alone.
fn first_images(model: &Path, count: usize) -> Vec<u8> {
    let bytes = fs::read(model).unwrap();
    let mut at = 8;
    for _ in 0..count {
        at += 64;
        at += bytes[at..].iter().position(|byte| *byte == 0).unwrap() + 1;
        at += 8 + 24 * u64::from_le_bytes(bytes[at..at + 8].try_into().unwrap()) as usize;
    }
    [&(count as u64).to_le_bytes()[..], &bytes[8..at]].concat()
}

#[test]
fn the_larger_of_several_models_is_used_and_the_others_are_named() {
    let folder = made(SynthLayout::Colmap);
    let expected = all(folder.path()).views;
    let sparse = folder.path().join("sparse");
    fs::rename(sparse.join("0"), sparse.join("1")).unwrap();
    copy_folder(&sparse.join("1"), &sparse.join("0"));
    fs::write(sparse.join("0/images.bin"), first_images(&sparse.join("1/images.bin"), 2)).unwrap();
    assert_same(&all(folder.path()).views, &expected);
    assert_told(folder.path(), &["not used: sparse/0: a model of 2 images; sparse/1, which has 8, is used"]);
    // Also beside it, not in a folder of its own.
    fs::rename(sparse.join("0/cameras.bin"), sparse.join("cameras.bin")).unwrap();
    fs::rename(sparse.join("0/images.bin"), sparse.join("images.bin")).unwrap();
    fs::remove_dir_all(sparse.join("0")).unwrap();
    assert_same(&all(folder.path()).views, &expected);
    assert_told(folder.path(), &["not used: sparse/images.bin: a model of 2 images; sparse/1"]);
}

#[test]
fn images_without_their_lines_of_points_are_all_read() {
    let folder = made(SynthLayout::ColmapText);
    let expected = all(folder.path()).views;
    let path = folder.path().join("sparse/0/images.txt");
    let text = fs::read_to_string(&path).unwrap();
    let images: Vec<&str> = text.lines().filter(|line| line.starts_with('#') || line.ends_with(".png")).collect();
    fs::write(&path, images.join("\n")).unwrap();
    assert_same(&all(folder.path()).views, &expected);
    assert_told(folder.path(), &["check: sparse/0/images.txt: 7 of 8 images lack their line of points"]);
    // An empty line is one without points.
    fs::write(&path, images.iter().map(|line| format!("{line}\n\n")).collect::<String>()).unwrap();
    assert_same(&all(folder.path()).views, &expected);
    assert!(!told(folder.path(), &LoadOptions::default()).contains("line of points"), "nothing lacks");
}

#[test]
fn a_picture_with_two_poses_is_one_photograph() {
    let folder = made(SynthLayout::ColmapText);
    let expected = all(folder.path()).views;
    let path = folder.path().join("sparse/0/images.txt");
    let text = fs::read_to_string(&path).unwrap();
    let line = text.lines().find(|line| line.ends_with("00005.png")).unwrap();
    fs::write(&path, format!("{text}99 {}\n\n", line.split_once(' ').unwrap().1)).unwrap();
    assert_same(&all(folder.path()).views, &expected);
    assert_told(folder.path(), &["not used: images/00005.png: it has 2 poses, of which the first is used"]);
}

#[test]
fn without_a_list_of_training_photographs_the_rest_is_trained_on() {
    let folder = made(SynthLayout::Transforms);
    edit(folder.path(), |json| {
        let keys = json.as_object_mut().unwrap();
        keys.remove("train_filenames");
        keys.remove("val_filenames");
    });
    let count = |split| load(folder.path(), split, &LoadOptions::default()).unwrap().views.len();
    assert_eq!((count("train"), count("test"), count("all")), (8, 1, 9));
    assert_told(
        folder.path(),
        &["check: transforms.json: no train_filenames: 8 frames in no other list are trained on"],
    );
}

#[test]
fn lists_that_match_nothing_are_refused_and_single_names_told() {
    let folder = made(SynthLayout::Transforms);
    edit(folder.path(), |json| json["test_filenames"] = json!(["images/r_0.png"]));
    let message = error(folder.path());
    assert!(message.contains("test_filenames must be a list of file_path of frames"), "{message}");
    assert!(message.contains("no frame of \"images/r_0.png\""), "{message}");
    edit(folder.path(), |json| {
        json["test_filenames"] = json!(["./test/R_0.png", "gone.png"]);
        json["train_filenames"].as_array_mut().unwrap().truncate(5);
    });
    let count = |split| load(folder.path(), split, &LoadOptions::default()).unwrap().views.len();
    assert_eq!((count("train"), count("val"), count("test")), (5, 1, 1));
    assert_told(
        folder.path(),
        &[
            "not there: transforms.json: test_filenames names 1 of no frame, the first is gone.png",
            "not used: transforms.json: 2 frames are in none of its lists",
        ],
    );
}

#[test]
fn masks_and_keys_that_are_not_used_are_told() {
    let folder = made(SynthLayout::Transforms);
    let expected = all(folder.path()).views;
    for n in 0..7 {
        GrayImage::new(24, 16).save(folder.path().join(format!("train/dynamic_mask_r_{n}.png"))).unwrap();
    }
    edit(folder.path(), |json| {
        json["fisheye_crop_radius"] = json!(12.0);
        json["applied_transform"] = json!([[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0]]);
        json["frames"][2]["dynamic_mask_path"] = json!("train/dynamic_mask_r_2.png");
    });
    assert_same(&all(folder.path()).views, &expected);
    assert_told(
        folder.path(),
        &[
            "not used: train: 7 pictures, masks by Instant-NGP's names",
            "not used: transforms.json: keys that are not read: dynamic_mask_path, fisheye_crop_radius\n",
        ],
    );

    let folder = made(SynthLayout::Llff);
    let expected = all(folder.path()).views;
    copy_folder(&folder.path().join("images"), &folder.path().join("masks"));
    copy_folder(&folder.path().join("images"), &folder.path().join("images_8"));
    assert_same(&all(folder.path()).views, &expected);
    assert_told(
        folder.path(),
        &[
            "not used: masks: 8 pictures; the layout llff has no masks",
            "not used: images_8: 8 pictures of photographs made 8 times smaller",
        ],
    );
}

#[test]
fn masks_of_colmap_are_found_with_any_ending_and_only_where_a_name_is_the_same() {
    let folder = made(SynthLayout::Colmap);
    let masks = folder.path().join("masks");
    fs::create_dir(&masks).unwrap();
    let half = GrayImage::from_fn(24, 16, |x, _| Luma([if x < 8 { 0 } else { 255 }]));
    half.save(masks.join("00001.jpg")).unwrap();
    half.save(masks.join("00002.PNG")).unwrap();
    half.save(masks.join("other.png")).unwrap();
    let masked: Vec<_> = all(folder.path()).views.into_iter().filter(|view| view.mask.is_some()).collect();
    assert_eq!(masked.iter().map(|view| view.name.as_str()).collect::<Vec<_>>(), ["00001", "00002"]);
    assert!(masked.iter().all(|view| (0..384).all(|n| view.counts(n) == (n % 24 >= 8))), "the left third is black");
    assert_told(folder.path(), &["not used: masks/other.png: 1 picture, none with the name of a photograph"]);
}

#[test]
fn files_that_are_named_but_not_there_are_told() {
    let folder = made(SynthLayout::Transforms);
    fs::remove_file(folder.path().join("points.ply")).unwrap();
    edit(folder.path(), |json| {
        for frame in json["frames"].as_array_mut().unwrap() {
            frame["depth_file_path"] = json!("depth/none.png");
        }
    });
    assert_eq!(all(folder.path()).points, None);
    assert_told(
        folder.path(),
        &[
            "not there: points.ply: named by ply_file_path\n",
            "not there: depth/none.png: named by depth_file_path, the first of 9 that are not there",
        ],
    );
    fs::remove_file(folder.path().join("train/r_3.png")).unwrap();
    assert_told(folder.path(), &["not there: train/r_3.png: 1 picture not there", "whose folder has r_"]);
}

#[test]
fn keys_whose_meaning_is_not_supported_are_refused_by_name() {
    for (key, value, part) in [
        ("distortion_params", json!([0.3, 0.1, 0, 0, 0, 0]), "write its numbers as k1, k2, k3, k4, p1 and p2"),
        ("k5", json!(0.1), "unless camera_model is FULL_OPENCV"),
        ("p3", json!(0.1), "not supported"),
        ("rolling_shutter", json!([0.0, 0.0, 0.1, 0.0]), "a moving camera is not supported"),
    ] {
        for in_frame in [false, true] {
            let folder = made(SynthLayout::Transforms);
            edit(folder.path(), |json| if in_frame { &mut json["frames"][1] } else { json }[key] = value.clone());
            let message = error(folder.path());
            assert!(message.contains(&format!("{key} must be absent or 0")) && message.contains(part), "{message}");
        }
    }
    let folder = made(SynthLayout::Transforms);
    let expected = all(folder.path()).views;
    edit(folder.path(), |json| {
        json["distortion_params"] = json!([0, 0.0, 0, 0, 0, 0]);
        json["rolling_shutter"] = json!([0.0, 0.0, 0.0, 0.0]);
        json["k5"] = json!(0.0);
    });
    assert_same(&all(folder.path()).views, &expected);

    let folder = made(SynthLayout::Metashape);
    let path = folder.path().join("cameras.xml");
    let text = fs::read_to_string(&path).unwrap();
    for key in ["p3", "p4", "b2"] {
        fs::write(&path, text.replace("<cx>", &format!("<{key}>0.05</{key}><cx>"))).unwrap();
        let message = error(folder.path());
        assert!(message.contains(&format!("{key} must be 0, as")) && message.contains("found 0.05"), "{message}");
    }
}

#[test]
fn k4_alone_is_the_coefficient_of_the_eighth_power_as_in_nerfstudio() {
    let folder = made(SynthLayout::Transforms);
    edit(folder.path(), |json| {
        json["camera_model"] = json!("OPENCV");
        json["k4"] = json!(0.5);
    });
    let lens = |radial, divisor| Lens {
        projection: Projection::Perspective,
        distortion: Distortion::new(radial, divisor, [0.0; 2], [0.0; 2]).unwrap(),
    };
    assert_eq!(all(folder.path()).views[0].camera.lens, lens([0.0, 0.0, 0.0, 0.5], [0.0; 3]));
    edit(folder.path(), |json| json["camera_model"] = json!("FULL_OPENCV"));
    assert_eq!(all(folder.path()).views[0].camera.lens, lens([0.0; 4], [0.5, 0.0, 0.0]));
}

/// A folder of pictures `images/left/0000.png` and `images/right/0000.png` and so on, with depth maps, each of one depth.
fn two_sides() -> TempDir {
    let folder = made(SynthLayout::Transforms);
    edit(folder.path(), |json| {
        for key in ["train_filenames", "val_filenames", "test_filenames"] {
            json.as_object_mut().unwrap().remove(key);
        }
        for (n, frame) in json["frames"].as_array_mut().unwrap().iter_mut().enumerate() {
            let name = format!("{}/{:04}.png", if n % 2 == 0 { "left" } else { "right" }, n / 2);
            let from = folder.path().join(frame["file_path"].as_str().unwrap());
            write(&folder.path().join("images").join(&name), fs::read(from).unwrap());
            let depth = ImageBuffer::<Luma<u16>, _>::from_pixel(24, 16, Luma([1000 * (n as u16 + 1)]));
            let path = folder.path().join("depths").join(&name);
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            DynamicImage::ImageLuma16(depth).save(path).unwrap();
            frame["file_path"] = json!(format!("images/{name}"));
            frame["depth_file_path"] = json!(format!("depths/{name}"));
        }
    });
    folder
}

#[test]
fn photographs_of_one_name_in_two_folders_keep_their_depths_and_names() {
    let folder = two_sides();
    let mut dataset = all(folder.path());
    assert_eq!(read_distances(&mut dataset).unwrap(), 9);
    for (n, view) in dataset.views.iter().enumerate() {
        let side = if n % 2 == 0 { "left" } else { "right" };
        assert_eq!(view.path, format!("images/{side}/{:04}.png", n / 2));
        // The depth along the optical axis.
        let least = view.distances.iter().copied().fold(f32::INFINITY, f32::min);
        assert!((least - (n as f32 + 1.0)).abs() < 0.01, "{}: {least}", view.path);
    }
    let names: std::collections::BTreeSet<_> = dataset.views.iter().map(|view| &view.name).collect();
    assert_eq!(names.len(), 9, "names of files are unique: {names:?}");
}

#[test]
fn test_views_are_named_by_their_paths() {
    let folder = two_sides();
    let list = folder.path().join("test.txt");
    let test = |text: &str| {
        write(&list, text);
        let holdout = Holdout { every: 8, names: Some(list.clone()) };
        let named = load(folder.path(), "test", &LoadOptions { holdout, ..LoadOptions::default() });
        named.map(|dataset| dataset.views.into_iter().map(|view| view.path).collect::<Vec<_>>())
    };
    let [left, right] = ["images/left/0001.png", "images/right/0001.png"];
    assert_eq!(test("images/left/0001.png").unwrap(), [left]);
    assert_eq!(test("right\\0001\n\nLEFT/0001.PNG\n").unwrap(), [left, right]);
    assert_eq!(test("0004.png").unwrap(), ["images/left/0004.png"]);
    let message = described(test("0001").unwrap_err());
    assert!(message.contains("the name \"0001\" must be that of a photograph; found those of images/left/0001.png"));
}

#[test]
fn sizes_that_are_no_whole_fraction_are_told_and_larger_ones_averaged() {
    let folder = made(SynthLayout::Colmap);
    let images = folder.path().join("images");
    let halves = LoadOptions { downscale: 2, ..LoadOptions::default() };
    let expected = load(folder.path(), "all", &halves).unwrap().views;
    // Pictures as large as the photographs in a folder of smaller ones.
    copy_folder(&images, &folder.path().join("images_2"));
    let found = load(folder.path(), "all", &halves).unwrap().views;
    assert_same(&found, &expected);
    assert_eq!((found[0].camera.width, found[0].camera.height), (12, 8));
    let lines = told(folder.path(), &halves);
    assert!(lines.contains("check: images_2: 8 pictures as large as the photographs (24x16), not 2 times"), "{lines}");

    for n in 0..8 {
        let path = images.join(format!("{n:05}.png"));
        image::open(&path).unwrap().crop_imm(0, 0, 23, 15).save(&path).unwrap();
    }
    assert_told(
        folder.path(),
        &["check: images: 8 pictures of 23x15 pixels, no whole fraction of their camera's 24x16"],
    );
}

#[test]
fn a_principal_point_outside_of_its_picture_is_refused() {
    let folder = made(SynthLayout::Transforms);
    edit(folder.path(), |json| json["cx"] = json!(48.0));
    let message = error(folder.path());
    assert!(message.contains("the principal point's column must be in the picture, 0 to 24; found 48"), "{message}");
    edit(folder.path(), |json| json["cx"] = json!(24.0));
    assert_eq!(all(folder.path()).views.len(), 9);
}

#[test]
fn one_focal_length_is_that_of_both_directions() {
    let folder = made(SynthLayout::Transforms);
    let expected = all(folder.path()).views;
    edit(folder.path(), |json| drop(json.as_object_mut().unwrap().remove("fl_x")));
    assert_same(&all(folder.path()).views, &expected);
    edit(folder.path(), |json| {
        let focal = json.as_object_mut().unwrap().remove("fl_y").unwrap().as_f64().unwrap();
        json["camera_angle_y"] = json!(2.0 * (8.0 / focal).atan());
    });
    let camera = all(folder.path()).views[0].camera;
    assert!((camera.focal[0] - expected[0].camera.focal[0]).abs() < 1e-9 && camera.focal[0] == camera.focal[1]);
}

#[test]
fn poses_in_fortran_s_order_are_read() {
    let folder = made(SynthLayout::Llff);
    let expected = all(folder.path()).views;
    let path = folder.path().join("poses_bounds.npy");
    let bytes = fs::read(&path).unwrap();
    let mut input = &bytes[..];
    let header = npy::Header::read(&mut input).unwrap();
    let numbers = header.numbers(&mut input).unwrap();
    let rows = numbers.len() / 17;
    let columns = (0..17).flat_map(|column| (0..rows).map(move |row| (row, column)));
    let mut turned = Vec::new();
    npy::write(&mut turned, &[rows, 17], columns.map(|(row, column)| numbers[17 * row + column])).unwrap();
    let at = turned.windows(5).position(|bytes| bytes == b"False").unwrap();
    turned.splice(at..at + 5, *b"True ");
    fs::write(&path, turned).unwrap();
    assert_same(&all(folder.path()).views, &expected);
}

#[test]
fn masks_of_sixteen_bits_count_by_all_of_them_and_black_ones_are_refused() {
    let folder = made(SynthLayout::Colmap);
    let expected = all(folder.path()).views;
    let masks = folder.path().join("masks");
    fs::create_dir(&masks).unwrap();
    let mask = |n: usize| masks.join(format!("{n:05}.png"));
    for n in 0..8 {
        DynamicImage::ImageLuma16(ImageBuffer::from_pixel(24, 16, Luma([1]))).save(mask(n)).unwrap();
    }
    let views = all(folder.path()).views;
    assert_same(&views, &expected);
    assert!(views.iter().all(|view| (0..384).all(|n| view.counts(n))), "1 of 65535 is not black");
    (0..8).for_each(|n| GrayImage::new(24, 16).save(mask(n)).unwrap());
    let message = error(folder.path());
    assert!(message.contains("masks/00000.png: the mask must be white where the photograph counts"), "{message}");
    assert!(message.contains("black alone, as are the masks of all 8 photographs"), "{message}");
    assert_told(folder.path(), &["check: masks/00000.png: the first mask is black alone"]);
    assert!(matches!(expected[0].pixels, Pixels::Rgba8(_)), "8-bit files stay so");
}
