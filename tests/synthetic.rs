//! The synthetic dataset as others see it: its files, that they read back, and that a seed fixes every byte.
#![cfg(feature = "toolkit")]

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use strivec::dataset::{Error, ErrorKind, LoadOptions, SynthOptions, load, synthesize};
use strivec::npy::{Header, Number};

const OPTIONS: SynthOptions = SynthOptions { views: 5, test_views: 3, size: [32, 24], seed: 7, force: false };

/// Every file of a folder by its path in it.
fn files(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let mut files = BTreeMap::new();
    for entry in fs::read_dir(folder).unwrap().map(Result::unwrap) {
        let name = entry.file_name().into_string().unwrap();
        if entry.path().is_dir() {
            files.extend(
                self::files(&entry.path()).into_iter().map(|(inner, bytes)| (format!("{name}/{inner}"), bytes)),
            );
        } else {
            files.insert(name, fs::read(entry.path()).unwrap());
        }
    }
    files
}

/// The files that `options` give on `threads` threads.
fn made(options: &SynthOptions, threads: usize) -> BTreeMap<String, Vec<u8>> {
    let folder = tempfile::tempdir().unwrap();
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
    pool.install(|| synthesize(folder.path(), options)).unwrap();
    files(folder.path())
}

#[test]
fn seed_alone_decides_every_byte() {
    let (one, three) = (made(&OPTIONS, 1), made(&OPTIONS, 3));
    assert_eq!(one.keys().collect::<Vec<_>>(), three.keys().collect::<Vec<_>>());
    for (name, bytes) in &one {
        assert!(*bytes == three[name], "{name} depends on the number of threads");
    }
    let other = made(&SynthOptions { seed: 8, ..OPTIONS }, 2);
    for name in ["transforms_train.json", "transforms_test.json", "train/r_0.png", "test/r_2.png", "points.ply"] {
        assert!(one[name] != other[name], "{name} does not depend on the seed");
    }
    for name in ["mesh.ply", "mesh.obj", "occupancy.npz"] {
        assert!(one[name] == other[name], "{name} depends on the seed");
    }
}

#[test]
fn dataset_reads_back_with_distinct_cameras_and_soft_silhouettes() {
    let folder = tempfile::tempdir().unwrap();
    let made = synthesize(folder.path(), &OPTIONS).unwrap();
    assert_eq!(made.pictures, 5 + 1 + 3);
    let mut positions = Vec::new();
    for (split, count) in [("train", 5), ("val", 1), ("test", 3)] {
        let dataset = load(folder.path(), split, &LoadOptions::default()).unwrap();
        assert_eq!(dataset.views.len(), count);
        for view in &dataset.views {
            assert_eq!((view.camera.width, view.camera.height), (32, 24));
            positions.push(view.camera.position);
            // The background contributes in proportion to the pixel's transmittance.
            let [black, white] = [0.0, 1.0].map(|value| view.pixels.colors([value; 3]));
            let through: Vec<f32> = black.iter().zip(&white).map(|(b, w)| w[1] - b[1]).collect();
            let share = |keep: fn(f32) -> bool| through.iter().filter(|&&t| keep(t)).count();
            assert!(share(|t| t < 1e-3) > 60, "opaque");
            assert!(share(|t| t > 0.999) > 200, "empty");
            assert!(share(|t| (0.05..0.95).contains(&t)) > 20, "silhouettes");
        }
    }
    for (i, a) in positions.iter().enumerate() {
        assert!(positions[..i].iter().all(|b| a.distance(*b) > 0.01), "two cameras stand in one place");
    }
}

#[test]
fn grid_reads_back_with_its_bounds() {
    let folder = tempfile::tempdir().unwrap();
    let made = synthesize(folder.path(), &OPTIONS).unwrap();
    let file = fs::File::open(folder.path().join("occupancy.npz")).unwrap();
    let mut archive = zip::ZipArchive::new(file).unwrap();
    let mut array = |name: &str| {
        let mut entry = archive.by_name(name).unwrap();
        let header = Header::read(&mut entry).unwrap();
        let numbers = header.numbers(&mut entry).unwrap();
        (header.number, header.shape, numbers)
    };
    let (number, shape, cells) = array("occupancy.npy");
    assert_eq!((number, shape), (Number::Bool, vec![100, 100, 100]));
    let cells: Vec<bool> = cells.iter().map(|&cell| cell == 1.0).collect();
    assert_eq!(cells.iter().filter(|&&c| c).count(), made.occupied_cells);
    // The plinth's middle is filled, the air above everything is not.
    assert!(cells[(10 * 100 + 50) * 100 + 50] && !cells[(99 * 100 + 50) * 100 + 50]);
    let (number, shape, bounds) = array("bounds.npy");
    assert_eq!((number, shape), (Number::Float(8), vec![2, 3]));
    assert_eq!(bounds, [-1.0, -1.0, -1.0, 1.0, 1.0, 1.0]);
}

#[test]
fn folder_that_is_not_empty_is_left_alone_unless_forced() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("mine"), "kept").unwrap();
    let error = synthesize(folder.path(), &OPTIONS).unwrap_err();
    assert!(matches!(error, Error::FolderNotEmpty { .. }) && error.kind() == ErrorKind::Argument, "{error}");
    assert_eq!(files(folder.path()).len(), 1);
    synthesize(folder.path(), &SynthOptions { force: true, ..OPTIONS }).unwrap();
    assert_eq!(files(folder.path())["mine"], b"kept");
}

#[test]
fn senseless_options_are_refused_before_anything_is_written() {
    let folder = tempfile::tempdir().unwrap();
    for (options, what) in [
        (SynthOptions { views: 0, ..OPTIONS }, "views"),
        (SynthOptions { test_views: 10_001, ..OPTIONS }, "test_views"),
        (SynthOptions { size: [0, 5], ..OPTIONS }, "width"),
        (SynthOptions { size: [5, 4097], ..OPTIONS }, "height"),
    ] {
        let error = synthesize(&folder.path().join("new"), &options).unwrap_err();
        assert!(error.kind() == ErrorKind::Argument && error.to_string().contains(what), "{error}");
    }
    assert!(files(folder.path()).is_empty());
    fs::write(folder.path().join("file"), "").unwrap();
    assert!(synthesize(&folder.path().join("file/new"), &OPTIONS).unwrap_err().is_io());
}
