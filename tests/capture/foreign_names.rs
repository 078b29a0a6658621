//! Names of files as other programs and systems write them.

use std::fs;
use std::path::Path;

use serde_json::json;
use strivec_capture::dataset::{Layout, LoadOptions, describe, load};
use strivec_synth::SynthLayout;

use crate::foreign::{all, assert_same, assert_told, described, edit, error, made, told, write};

fn rename(folder: &Path, name: impl Fn(&str) -> String) {
    for entry in fs::read_dir(folder).unwrap().map(Result::unwrap) {
        let old = entry.file_name().into_string().unwrap();
        fs::rename(entry.path(), folder.join(name(&old))).unwrap();
    }
}

#[test]
fn labels_and_endings_may_differ_in_case_or_from_the_files() {
    let folder = made(SynthLayout::Metashape);
    let expected = all(folder.path()).views;
    let path = folder.path().join("cameras.xml");
    let text = fs::read_to_string(&path).unwrap();
    assert!(text.contains("label=\"00003\""), "{text}");
    for ending in [".PNG", ".tif", ".png"] {
        let mut labeled = text.clone();
        (0..8).for_each(|n| {
            labeled = labeled.replace(&format!("label=\"{n:05}\""), &format!("label=\"{n:05}{ending}\""));
        });
        fs::write(&path, labeled).unwrap();
        assert_same(&all(folder.path()).views, &expected);
    }

    let folder = made(SynthLayout::ScanNet);
    let expected = all(folder.path()).views;
    rename(&folder.path().join("color"), |name| name.to_uppercase());
    assert_same(&all(folder.path()).views, &expected);
}

#[test]
fn numbers_may_have_leading_zeros() {
    let folder = made(SynthLayout::ScanNet);
    let expected = all(folder.path()).views;
    let padded = |name: &str| format!("{name:0>10}");
    rename(&folder.path().join("color"), padded);
    assert_same(&all(folder.path()).views, &expected);
    rename(&folder.path().join("pose"), padded);
    let views = all(folder.path()).views;
    assert_same(&views, &expected);
    let paths: Vec<_> = views.iter().map(|view| view.path.as_str()).collect();
    assert!(paths[0].starts_with("color/00000"), "{paths:?}");

    let folder = made(SynthLayout::Colmap);
    let expected = all(folder.path()).views;
    rename(&folder.path().join("images"), |name| name.trim_start_matches('0').replace("png", "PNG"));
    fs::rename(folder.path().join("images/.PNG"), folder.path().join("images/0.PNG")).unwrap();
    assert_same(&all(folder.path()).views, &expected);
}

#[test]
fn files_that_macos_leaves_beside_pictures_are_passed_over() {
    let folder = made(SynthLayout::Llff);
    let expected = all(folder.path()).views;
    write(&folder.path().join("images/._00000.png"), b"\0\x05\x16\x07");
    write(&folder.path().join("images/.DS_Store"), b"");
    assert_same(&all(folder.path()).views, &expected);
    assert_told(folder.path(), &["not used: images/._00000.png: 1 hidden file with the name of a picture"]);
    let folder = made(SynthLayout::Nsvf);
    let expected = all(folder.path()).views;
    write(&folder.path().join("pose/._0_00000.txt"), b"\0\x05\x16\x07");
    assert_same(&all(folder.path()).views, &expected);
}

#[test]
fn photographs_are_used_where_the_folder_of_smaller_ones_lacks_them() {
    let folder = made(SynthLayout::Colmap);
    let halves = LoadOptions { downscale: 2, ..LoadOptions::default() };
    let expected = load(folder.path(), "all", &halves).unwrap().views;
    let small = image::open(folder.path().join("images/00000.png")).unwrap().thumbnail_exact(12, 8);
    fs::create_dir(folder.path().join("images_2")).unwrap();
    (0..8).for_each(|n| small.save(folder.path().join(format!("images_2/image{n:03}.png"))).unwrap());
    assert_same(&load(folder.path(), "all", &halves).unwrap().views, &expected);
    let lines = told(folder.path(), &halves);
    assert!(
        lines.contains("not used: images_2: it lacks 8 of 8 pictures, of which the photographs are used"),
        "{lines}"
    );
    // LLFF numbers them, so there they are the same ones in order.
    let folder = made(SynthLayout::Llff);
    fs::create_dir(folder.path().join("images_2")).unwrap();
    (0..8).for_each(|n| small.save(folder.path().join(format!("images_2/image{n:03}.png"))).unwrap());
    let views = load(folder.path(), "all", &halves).unwrap().views;
    assert!(views.iter().all(|view| view.path.starts_with("images/0") && view.camera.width == 12), "{}", views[0].path);
}

#[test]
fn a_copy_of_transforms_json_beside_it_is_not_another_layout() {
    let folder = made(SynthLayout::Transforms);
    let expected = all(folder.path()).views;
    let copy = || fs::copy(folder.path().join("transforms.json"), folder.path().join("transforms_backup.json"));
    copy().unwrap();
    assert_eq!(Layout::of(folder.path()).unwrap(), Layout::Transforms);
    assert_same(&all(folder.path()).views, &expected);
    assert_told(folder.path(), &["not used: transforms_backup.json: transforms.json is used"]);

    let folder = made(SynthLayout::Blender);
    let expected = all(folder.path()).views;
    let file = |name: &str| folder.path().join(name);
    fs::copy(file("transforms_train.json"), file("transforms_train_old.json")).unwrap();
    assert_same(&all(folder.path()).views, &expected);
    assert_eq!(describe(folder.path(), &LoadOptions::default()).unwrap().layout, Layout::Blender);
    assert_told(folder.path(), &["not used: transforms_train_old.json: its name is that of no split"]);
}

#[test]
fn paths_of_another_machine_are_taken_by_their_ends() {
    for prefix in ["/home/someone/scene/", "C:\\Users\\someone\\scene\\", "elsewhere/scene/"] {
        let folder = made(SynthLayout::Transforms);
        let expected = all(folder.path()).views;
        edit(folder.path(), |json| {
            for frame in json["frames"].as_array_mut().unwrap() {
                frame["file_path"] = json!(format!("{prefix}{}", frame["file_path"].as_str().unwrap()));
            }
            json["ply_file_path"] = json!(format!("{prefix}points.ply"));
        });
        assert_same(&all(folder.path()).views, &expected);
        let count = |split| load(folder.path(), split, &LoadOptions::default()).unwrap().views.len();
        assert_eq!((count("train"), count("val"), count("test")), (7, 1, 1), "lists name the ends");
        assert_told(
            folder.path(),
            &["check: transforms.json: 10 paths of another folder are taken by their ends, as "],
        );
    }
    let folder = made(SynthLayout::Transforms);
    edit(folder.path(), |json| json["frames"][3]["file_path"] = json!("/home/someone/none.png"));
    let message = error(folder.path());
    assert!(message.contains("frame 3: file_path") && message.contains("a path of another folder, none of whose ends"));
    // Two photographs of one name must not become one.
    edit(folder.path(), |json| {
        json["frames"][3]["file_path"] = json!("/a/left/train/r_1.png");
        json["frames"][4]["file_path"] = json!("/a/right/train/r_1.png");
    });
    let message = error(folder.path());
    assert!(message.contains("whose ends are both train/r_1.png"), "{message}");
}

#[test]
fn paths_that_leave_the_folder_are_refused_with_the_remedy() {
    let folder = made(SynthLayout::Transforms);
    let inner = folder.path().join("json");
    edit(folder.path(), |json| {
        for frame in json["frames"].as_array_mut().unwrap() {
            frame["file_path"] = json!(format!("../{}", frame["file_path"].as_str().unwrap()));
        }
    });
    fs::create_dir(&inner).unwrap();
    fs::rename(folder.path().join("transforms.json"), inner.join("transforms.json")).unwrap();
    let message = error(&inner);
    for part in ["frame 0: file_path", "../train/r_0.png", "which leaves it", "beside the folders of its pictures"] {
        assert!(message.contains(part), "{message}");
    }
    let message = error(folder.path());
    assert!(message.contains("the layout transforms in its folder json, which is the folder to pass"), "{message}");
}

#[test]
fn names_may_differ_in_case_and_normal_form_and_near_ones_are_shown() {
    let folder = made(SynthLayout::Transforms);
    let expected = all(folder.path()).views;
    fs::rename(folder.path().join("train/r_0.png"), folder.path().join("train/Bu\u{308}hne.PNG")).unwrap();
    edit(folder.path(), |json| {
        json["frames"][0]["file_path"] = json!("Train/B\u{fc}hne.png");
        json.as_object_mut().unwrap().remove("train_filenames");
    });
    assert_same(&all(folder.path()).views, &expected);

    let folder = made(SynthLayout::Colmap);
    fs::rename(folder.path().join("images/00003.png"), folder.path().join("images/photo3.png")).unwrap();
    let message = described(load(folder.path(), "all", &LoadOptions::default()).unwrap_err());
    assert!(message.contains("images/00003.png, whose folder has 0000"), "{message}");
}

#[test]
fn texts_may_begin_with_a_byte_order_mark() {
    for (layout, name) in [
        (SynthLayout::Transforms, "transforms.json"),
        (SynthLayout::Blender, "transforms_train.json"),
        (SynthLayout::ColmapText, "sparse/0/images.txt"),
        (SynthLayout::ColmapText, "sparse/0/cameras.txt"),
        (SynthLayout::Nsvf, "intrinsics.txt"),
        (SynthLayout::Metashape, "cameras.xml"),
    ] {
        let folder = made(layout);
        let expected = all(folder.path()).views;
        let path = folder.path().join(name);
        let bytes = fs::read(&path).unwrap();
        fs::write(&path, [&b"\xef\xbb\xbf"[..], &bytes].concat()).unwrap();
        assert_same(&all(folder.path()).views, &expected);
    }
}
