//! Single bad records: they are left out, counted and told, and too many of them are refused.

use std::fs;
use std::path::{Path, PathBuf};

use serde_json::json;
use strivec_capture::dataset::{LoadOptions, load};
use strivec_capture::prior;
use strivec_capture::prior::{BuildOptions, build};
use strivec_synth::SynthLayout;

use crate::foreign::{all, assert_same, assert_told, described, edit, error, made, write};

/// Makes the poses of frames `bad` of a `transforms.json` not finite, as Python writes that.
fn spoil(folder: &Path, bad: &[usize]) {
    let marker = |n: usize| 1e6 + n as f64;
    edit(folder, |json| bad.iter().for_each(|&n| json["frames"][n]["transform_matrix"][1][3] = json!(marker(n))));
    let path = folder.join("transforms.json");
    let mut text = fs::read_to_string(&path).unwrap();
    for (&n, word) in bad.iter().zip(["NaN", "-Infinity", "Infinity"].iter().cycle()) {
        text = text.replace(&format!("{:?}", marker(n)), word);
    }
    fs::write(path, text).unwrap();
}

#[test]
fn one_pose_that_is_not_finite_is_left_out_in_every_layout() {
    let folder = made(SynthLayout::Transforms);
    spoil(folder.path(), &[4]);
    let dataset = all(folder.path());
    assert_eq!((dataset.views.len(), dataset.lost), (8, 1));
    assert_told(
        folder.path(),
        &["not used: transforms.json: 1 of 9 poses left out", "frame 4: transform_matrix", "NaN"],
    );
    let folder = made(SynthLayout::Transforms);
    spoil(folder.path(), &[4, 5]);
    let message = error(folder.path());
    assert!(message.contains("frame 4: transform_matrix") && message.contains("2 of 9 are such"), "{message}");
    // Other numbers have no one record.
    let folder = made(SynthLayout::Transforms);
    let path = folder.path().join("transforms.json");
    edit(folder.path(), |json| json["fl_x"] = json!("NaN"));
    fs::write(&path, fs::read_to_string(&path).unwrap().replace("\"NaN\"", "NaN")).unwrap();
    let message = error(folder.path());
    assert!(message.contains("the focal length along columns") && message.contains("found NaN"), "{message}");

    let folder = made(SynthLayout::ColmapText);
    let path = folder.path().join("sparse/0/images.txt");
    let text = fs::read_to_string(&path).unwrap();
    let line = text.lines().find(|line| line.ends_with("00002.png")).unwrap();
    let words: Vec<&str> = line.split(' ').collect();
    let spoiled = [&words[..5], &["nan"], &words[6..]].concat().join(" ");
    fs::write(&path, text.replace(line, &spoiled)).unwrap();
    let dataset = all(folder.path());
    assert_eq!((dataset.views.len(), dataset.lost), (7, 1));
    assert_told(folder.path(), &["not used: sparse/0/images.txt: 1 of 8 poses left out", "image 3"]);

    let folder = made(SynthLayout::Nsvf);
    let path = folder.path().join("pose/0_00001.txt");
    let text = fs::read_to_string(&path).unwrap();
    let (_, rest) = text.split_once(' ').unwrap();
    fs::write(&path, format!("nan {rest}")).unwrap();
    assert_eq!((all(folder.path()).views.len(), all(folder.path()).lost), (8, 1));

    let folder = made(SynthLayout::Metashape);
    let path = folder.path().join("cameras.xml");
    let text = fs::read_to_string(&path).unwrap();
    fs::write(
        &path,
        text.replacen("<transform>", "<transform>nan ", 1).replacen(" 0 0 0 1</transform>", " 0 0 1</transform>", 1),
    )
    .unwrap();
    assert_eq!((all(folder.path()).views.len(), all(folder.path()).lost), (7, 1));

    let folder = made(SynthLayout::Llff);
    let path = folder.path().join("poses_bounds.npy");
    let mut bytes = fs::read(&path).unwrap();
    let rows = bytes.len() - 8 * 17 * 8;
    bytes[rows + 17 * 8..rows + 18 * 8].copy_from_slice(&f64::NAN.to_le_bytes());
    fs::write(&path, bytes).unwrap();
    assert_eq!((all(folder.path()).views.len(), all(folder.path()).lost), (7, 1));
    assert_told(folder.path(), &["not used: poses_bounds.npy: 1 of 8 poses left out", "pose 1"]);
}

#[test]
fn one_photograph_that_cannot_be_decoded_is_left_out() {
    let folder = made(SynthLayout::Colmap);
    // A picture of a phone with the name of another format.
    write(&folder.path().join("images/00003.png"), b"\0\0\0\x18ftypheic\0\0\0\0mif1heic");
    let dataset = all(folder.path());
    assert_eq!((dataset.views.len(), dataset.unreadable.len()), (7, 1));
    assert!(dataset.unreadable[0].contains("images/00003.png"), "{:?}", dataset.unreadable);
    assert_told(folder.path(), &["not used: images/00003.png: 1 picture left out"]);
    // A file whose header alone is good.
    let path = folder.path().join("images/00005.png");
    let bytes = fs::read(&path).unwrap();
    fs::write(&path, &bytes[..bytes.len() / 2]).unwrap();
    let message = error(folder.path());
    assert!(message.contains("00003.png") && message.contains("2 of 8 are such, of which at most 1 is left out"));
    write(&folder.path().join("images/00003.png"), &bytes);
    assert_eq!(all(folder.path()).unreadable.len(), 1);
}

fn built(path: PathBuf) -> Result<(u64, u64), String> {
    let built = build(&[path], &BuildOptions::default(), &mut |_| std::ops::ControlFlow::Continue(()));
    let counts = built.map_err(|error| error.to_string())?.counts;
    Ok((counts.not_finite, counts.points + counts.triangles))
}

#[test]
fn points_and_triangles_that_are_not_finite_are_left_out_of_every_format() {
    let folder = made(SynthLayout::ColmapText);
    let points = folder.path().join("sparse/0/points3D.txt");
    let text = fs::read_to_string(&points).unwrap();
    let line = text.lines().nth(6).unwrap();
    let words: Vec<&str> = line.split(' ').collect();
    fs::write(&points, text.replace(line, &[&words[..1], &["nan"], &words[2..]].concat().join(" "))).unwrap();
    let (count, first) = prior::not_finite_in(&points).unwrap().unwrap();
    assert!(count == 1 && first.contains("line 7"), "{count} {first}");
    assert_eq!(built(points).unwrap().0, 1);

    let file = |name: &str, bytes: &[u8]| {
        let path = folder.path().join(name);
        write(&path, bytes);
        path
    };
    let header = "ply\nformat ascii 1.0\nelement vertex 5\nproperty float x\nproperty float y\nproperty float z\n";
    let vertices = "0 0 0\n1 0 0\n0 1 0\n0 0 1\nnan nan nan\n";
    let cloud = format!("{header}end_header\n{vertices}");
    assert_eq!(built(file("nan-vertex.ply", cloud.as_bytes())), Ok((1, 4)));
    let faces = "element face 2\nproperty list uchar int vertex_indices\nend_header\n";
    let mesh = format!("{header}{faces}{vertices}3 0 1 2\n3 1 2 4\n");
    assert_eq!(built(file("nan-vertex-mesh.ply", mesh.as_bytes())), Ok((1, 1)), "the face of the vertex is left out");

    let mut array = Vec::new();
    let numbers = (0..1503).map(|n| if n == 700 { f64::NAN } else { f64::from(n % 17) + f64::from(n) / 1000.0 });
    strivec_import::npy::write(&mut array, &[501, 3], numbers).unwrap();
    assert_eq!(built(file("points-nan.npy", &array)), Ok((1, 500)));

    let names = ["x", "y", "z", "opacity", "rot_0", "rot_1", "rot_2", "rot_3", "scale_0", "scale_1", "scale_2"];
    let properties: String = names.iter().map(|name| format!("property float {name}\n")).collect();
    let splat = |x: &str| format!("{x} 0 1 5 1 0 0 0 -3 -3 -3\n");
    let splats = format!(
        "ply\nformat ascii 1.0\nelement vertex 3\n{properties}end_header\n{}{}{}",
        splat("0"),
        splat("nan"),
        splat("1")
    );
    assert_eq!(built(file("splats-nan-centre.ply", splats.as_bytes())), Ok((1, 2)));

    let stl = |x: &str| {
        format!("facet normal 0 0 0\nouter loop\nvertex 0 0 0\nvertex {x} 0 0\nvertex 0 1 1\nendloop\nendfacet\n")
    };
    let solid = format!("solid a\n{}{}endsolid a\n", stl("1"), stl("2"));
    assert_eq!(built(file("good.stl", solid.as_bytes())), Ok((0, 2)));

    let message = built(file("bad.xyz", b"0 0 0\n1 1 1\nnan 0 0\n2 inf 0\n")).unwrap_err();
    assert!(message.contains("line 3: expected finite coordinates, found [NaN, 0, 0]"), "{message}");
    assert!(message.contains("2 of 4 are such, and at most 1 left out"), "{message}");
}

#[test]
fn a_model_of_one_photograph_says_so() {
    let folder = made(SynthLayout::ColmapText);
    let path = folder.path().join("sparse/0/images.txt");
    let text = fs::read_to_string(&path).unwrap();
    let line = text.lines().find(|line| line.ends_with("00000.png")).unwrap();
    fs::write(&path, format!("{line}\n\n")).unwrap();
    let message = described(load(folder.path(), "train", &LoadOptions::default()).unwrap_err());
    let expected =
        "the split train has no photograph: 1 photograph with a pose, all in other splits; `test_every` 0 holds";
    assert!(message.contains(expected), "{message}");
    assert_eq!(all(folder.path()).views.len(), 1);
    assert_told(folder.path(), &["not used: images: 7 pictures without a pose"]);
}

#[test]
fn good_datasets_have_nothing_to_tell_but_the_generator_s_own_files() {
    for layout in SynthLayout::ALL {
        let folder = made(layout);
        assert_same(&all(folder.path()).views, &all(folder.path()).views);
        let lines = crate::foreign::told(folder.path(), &LoadOptions::default());
        let is_own =
            |line: &str| ["no file of the dataset names", "occupancy.npz"].iter().any(|part| line.contains(part));
        let is_lost = |line: &str| layout == SynthLayout::ScanNet && line.contains("without a pose");
        assert!(lines.lines().all(|line| is_own(line) || is_lost(line)), "{layout:?}: {lines}");
    }
}
