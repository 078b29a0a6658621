//! The synthetic dataset as others see it: its files, that they read back, and that a seed fixes every byte.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use glam::DVec3;
use strivec_capture::dataset::{Layout, LoadOptions, Photograph, load};
use strivec_format::geometry::{Camera, Distortion, Lens, Projection};
use strivec_import::npy::{Header, Number};
use strivec_synth::{CameraModel, Error, Surroundings, SynthLayout, SynthOptions, synthesize};
use tempfile::TempDir;

const OPTIONS: SynthOptions = SynthOptions {
    layout: SynthLayout::Blender,
    camera: CameraModel::Pinhole,
    views: 5,
    test_views: 3,
    size: [32, 24],
    seed: 7,
    surroundings: Surroundings::None,
    force: false,
};

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
    assert!(matches!(error, Error::FolderNotEmpty { .. }) && !error.is_io(), "{error}");
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
        assert!(!error.is_io() && error.to_string().contains(what), "{error}");
    }
    assert!(files(folder.path()).is_empty());
    fs::write(folder.path().join("file"), "").unwrap();
    assert!(synthesize(&folder.path().join("file/new"), &OPTIONS).unwrap_err().is_io());
}

/// Views that every layout can split: one in eight is a test view.
const SMALL: SynthOptions = SynthOptions { views: 10, test_views: 2, size: [24, 24], ..OPTIONS };

/// A dataset of `layout` and `camera` made by `options`.
fn folder_of(layout: SynthLayout, camera: CameraModel, options: SynthOptions) -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    synthesize(folder.path(), &SynthOptions { layout, camera, ..options }).unwrap();
    folder
}

fn views(folder: &Path, split: &str) -> Vec<Photograph> {
    load(folder, split, &LoadOptions::default()).unwrap().views
}

/// The largest difference of directions of rays through the same pixels of `a` and `b`, at most 2.
fn difference(a: &Camera, b: &Camera) -> f64 {
    assert!(a.position.distance(b.position) < 1e-12, "{} {}", a.position, b.position);
    assert_eq!((a.width, a.height), (b.width, b.height), "columns and rows");
    let far = a.rays(0..a.height).zip(b.rays(0..b.height)).map(|rays| match rays {
        (Some(a), Some(b)) => a.direction.distance(b.direction),
        (None, None) => 0.0,
        _ => 2.0,
    });
    far.fold(0.0, f64::max)
}

/// The lens of `camera`, by its coefficients once more.
fn lens_of(camera: CameraModel) -> Lens {
    let none = [0.0; 2];
    let (projection, distortion) = match camera {
        CameraModel::Pinhole => return Lens::PINHOLE,
        CameraModel::Equirectangular => return Lens::PANORAMA,
        CameraModel::SimpleRadial => {
            (Projection::Perspective, Distortion::new([-0.4, 0.0, 0.0, 0.0], [0.0; 3], none, none))
        }
        CameraModel::Radial => (Projection::Perspective, Distortion::new([-0.4, 0.3, 0.0, 0.0], [0.0; 3], none, none)),
        CameraModel::OpenCv => {
            (Projection::Perspective, Distortion::new([-0.35, 0.2, 0.0, 0.0], [0.0; 3], [0.004, -0.003], none))
        }
        CameraModel::FullOpenCv => {
            let distortion = Distortion::new([0.15, -0.1, 0.05, 0.0], [0.5, 0.1, 0.02], [-0.003, 0.002], none);
            (Projection::Perspective, distortion)
        }
        CameraModel::OpenCvFisheye => {
            (Projection::Fisheye, Distortion::new([-0.25, 0.1, -0.05, 0.01], [0.0; 3], none, none))
        }
        CameraModel::SimpleRadialFisheye => {
            (Projection::Fisheye, Distortion::new([-0.3, 0.0, 0.0, 0.0], [0.0; 3], none, none))
        }
        CameraModel::RadialFisheye => {
            (Projection::Fisheye, Distortion::new([-0.2, 0.15, 0.0, 0.0], [0.0; 3], none, none))
        }
        CameraModel::ThinPrismFisheye => {
            let distortion = Distortion::new([-0.2, 0.1, -0.03, 0.01], [0.0; 3], [0.003, -0.002], [0.004, -0.003]);
            (Projection::Fisheye, distortion)
        }
    };
    Lens { projection, distortion: distortion.unwrap() }
}

/// The numbers of the lines of COLMAP's text file `name`, comments and names left out.
fn numbers(folder: &Path, name: &str) -> Vec<Vec<f64>> {
    let text = fs::read_to_string(folder.join("sparse/0").join(name)).unwrap();
    let lines = text.lines().filter(|line| !line.starts_with('#'));
    lines.map(|line| line.split_whitespace().filter_map(|word| word.parse().ok()).collect()).collect()
}

#[test]
fn every_layout_has_the_same_views() {
    let truth = folder_of(SynthLayout::Blender, CameraModel::Pinhole, SMALL);
    for layout in SynthLayout::ALL.into_iter().filter(|layout| *layout != SynthLayout::ScanNet) {
        let folder = folder_of(layout, CameraModel::Pinhole, SMALL);
        assert_eq!(Layout::of(folder.path()).unwrap(), layout.layout());
        for (split, count) in [("train", 10), ("val", 1), ("test", 2)] {
            if split == "val" && layout.holds_out_every_eighth() {
                continue;
            }
            let (found, expected) = (views(folder.path(), split), views(truth.path(), split));
            assert_eq!((found.len(), expected.len()), (count, count), "{layout:?} {split}");
            for (found, expected) in found.iter().zip(&expected) {
                assert!(difference(&found.camera, &expected.camera) < 1e-12, "{layout:?} {}", found.name);
                assert!(found.pixels == expected.pixels && found.mask.is_none(), "{layout:?} {}", found.name);
            }
        }
        for name in ["mesh.ply", "mesh.obj", "points.ply", "occupancy.npz"] {
            let bytes = |folder: &TempDir| fs::read(folder.path().join(name)).unwrap();
            assert!(bytes(&folder) == bytes(&truth), "{layout:?} {name}");
        }
    }
}

#[test]
fn every_camera_reads_back_from_every_layout_that_has_it() {
    let truth = folder_of(SynthLayout::Blender, CameraModel::Pinhole, SMALL);
    for camera in CameraModel::ALL {
        let mut first: Option<Vec<Photograph>> = None;
        for layout in SynthLayout::ALL.into_iter().filter(|layout| layout.cameras().contains(&camera)) {
            if layout == SynthLayout::ScanNet {
                continue;
            }
            let folder = folder_of(layout, camera, SMALL);
            let found = views(folder.path(), "train");
            for (view, pinhole) in found.iter().zip(views(truth.path(), "train")) {
                assert_eq!(view.camera.lens, lens_of(camera), "{layout:?}");
                assert!(view.camera.position.distance(pinhole.camera.position) < 1e-12, "{layout:?}");
            }
            let first = first.get_or_insert_with(|| found.clone());
            for (found, first) in found.iter().zip(first) {
                assert!(difference(&found.camera, &first.camera) < 1e-12, "{layout:?} {camera:?}");
                assert!(found.pixels == first.pixels && found.mask == first.mask, "{layout:?} {camera:?}");
            }
        }
    }
}

#[test]
fn a_changed_parameter_changes_rays() {
    for camera in CameraModel::ALL.into_iter().filter(|camera| *camera != CameraModel::Equirectangular) {
        let folder = folder_of(SynthLayout::ColmapText, camera, SMALL);
        let before = views(folder.path(), "test").swap_remove(0).camera;
        let path = folder.path().join("sparse/0/cameras.txt");
        let text = fs::read_to_string(&path).unwrap();
        let (comment, line) = text.trim_end().rsplit_once('\n').unwrap();
        let words: Vec<&str> = line.split(' ').collect();
        for changed in 4..words.len() {
            let mut words: Vec<String> = words.iter().map(|word| (*word).to_owned()).collect();
            words[changed] = (words[changed].parse::<f64>().unwrap() + 1e-3).to_string();
            fs::write(&path, format!("{comment}\n{}\n", words.join(" "))).unwrap();
            let after = views(folder.path(), "test").swap_remove(0).camera;
            let far = difference(&before, &after);
            assert!(far > 1e-6, "{camera:?}: parameter {} moves rays by {far}", changed - 4);
        }
    }
}

/// The largest distance of sparse points from the rays through their keypoints, and the share of points that fall on
/// transparent pixels, in the views that `change` changes.
fn misfit(folder: &Path, change: impl Fn(&mut Camera)) -> (f64, f64) {
    let points: BTreeMap<u64, DVec3> = (numbers(folder, "points3D.txt").iter())
        .map(|line| (line[0] as u64, DVec3::new(line[1], line[2], line[3])))
        .collect();
    let images = numbers(folder, "images.txt");
    let (mut farthest, mut outside, mut all): (f64, u32, u32) = (0.0, 0, 0);
    for (mut view, image) in views(folder, "all").into_iter().zip(images.chunks(2)) {
        change(&mut view.camera);
        for keypoint in image[1].chunks(3) {
            let ray = view.camera.ray_through(keypoint[0], keypoint[1]).unwrap();
            let line = points[&(keypoint[2] as u64)] - ray.origin;
            farthest = farthest.max(line.cross(ray.direction).length());
        }
        for &point in points.values() {
            let Some(at) = view.camera.project(point).filter(|at| view.camera.is_inside(*at)) else { continue };
            let pixel = at.y as usize * view.camera.width as usize + at.x as usize;
            let [black, white] = [0.0, 1.0].map(|value| view.pixels.color(pixel, [value; 3])[0]);
            all += 1;
            outside += u32::from(white - black > 0.99);
        }
    }
    (farthest, f64::from(outside) / f64::from(all))
}

#[test]
fn keypoints_and_pictures_are_of_the_camera() {
    for camera in CameraModel::ALL {
        let wide = if camera == CameraModel::Equirectangular { [436, 218] } else { [50, 50] };
        let options = SynthOptions { views: 2, test_views: 1, size: wide, ..OPTIONS };
        let folder = folder_of(SynthLayout::ColmapText, camera, options);
        let (farthest, outside) = misfit(folder.path(), |_| {});
        assert!(farthest < 1e-9, "{camera:?}: keypoints are {farthest} from their points");
        assert!(outside < 0.004, "{camera:?}: {outside} of the points are outside of the scene's picture");
        if camera == CameraModel::Pinhole {
            continue;
        }
        let (farthest, outside) = misfit(folder.path(), |camera| camera.lens = Lens::PINHOLE);
        assert!(farthest > 0.01, "{camera:?}: keypoints of a pinhole are {farthest} from their points");
        assert!(outside > 0.008, "{camera:?}: {outside} of the points are outside of a pinhole's picture");
    }
}

#[test]
fn cameras_and_splits_that_a_layout_cannot_state_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    for (options, message) in [
        (
            SynthOptions { layout: SynthLayout::Llff, camera: CameraModel::OpenCv, ..SMALL },
            "`camera` must be pinhole in the layout llff; found opencv",
        ),
        (
            SynthOptions { layout: SynthLayout::Transforms, camera: CameraModel::ThinPrismFisheye, ..SMALL },
            "`camera` must be pinhole, simple-radial, radial, opencv, full-opencv, opencv-fisheye, \
             simple-radial-fisheye, radial-fisheye, equirectangular in the layout transforms; found thin-prism-fisheye",
        ),
        (
            SynthOptions { layout: SynthLayout::ColmapText, views: 48, test_views: 8, ..SMALL },
            "`test_views` must be 7 for 48 training views, as the layout colmap-text holds out every eighth picture; \
             found 8",
        ),
    ] {
        let error = synthesize(folder.path(), &options).unwrap_err();
        assert_eq!((error.is_io(), error.to_string().as_str()), (false, message));
        assert!(files(folder.path()).is_empty());
    }
    let folder = folder_of(SynthLayout::Transforms, CameraModel::OpenCvFisheye, SMALL);
    let path = folder.path().join("transforms.json");
    let text = fs::read_to_string(&path).unwrap().replace("OPENCV_FISHEYE", "THIN_PRISM_FISHEYE");
    fs::write(&path, text).unwrap();
    let message = load(folder.path(), "all", &LoadOptions::default()).unwrap_err().to_string();
    assert!(message.contains("camera_model") && message.contains("RADIAL_FISHEYE or EQUIRECTANGULAR"), "{message}");
}

/// The test views of `folder`, all opaque, and the exact distances of their pixels.
fn distances(folder: &Path) -> Vec<(Photograph, Vec<f64>)> {
    let of_view = |view: Photograph| {
        assert!(view.pixels.is_opaque(), "{}", view.name);
        let stem = view.name.trim_start_matches("test_");
        let file = fs::read(folder.join(format!("distances/{stem}.npy"))).unwrap();
        let mut input = &file[..];
        let header = Header::read(&mut input).unwrap();
        assert_eq!(header.shape, [30, 40], "{}", view.name);
        let distances = header.numbers(&mut input).unwrap();
        (view, distances)
    };
    views(folder, "test").into_iter().map(of_view).collect()
}

#[test]
fn outdoors_every_pixel_is_opaque_and_its_distance_is_known() {
    let folder = tempfile::tempdir().unwrap();
    let surroundings = Surroundings::Meadow;
    let options = SynthOptions { surroundings, views: 2, test_views: 2, size: [40, 30], ..OPTIONS };
    synthesize(folder.path(), &options).unwrap();
    for (view, distances) in distances(folder.path()) {
        let mut on_meadow = 0;
        for (ray, distance) in view.camera.rays(0..30).zip(&distances) {
            let point = ray.unwrap().at(*distance);
            assert!(*distance > 2.0 && (distance.is_infinite() || point.z > -0.861), "{distance} {point}");
            on_meadow += usize::from((point.z + 0.86).abs() < 1e-4);
        }
        assert!(on_meadow > 200, "{on_meadow}");
    }
    let scan = SynthOptions { layout: SynthLayout::ScanNet, ..options };
    assert!(synthesize(folder.path(), &scan).unwrap_err().to_string().contains("meadow"));
}

#[test]
fn before_a_plain_floor_exposures_differ_and_depth_maps_are_of_the_scene() {
    let folder = tempfile::tempdir().unwrap();
    let (surroundings, layout) = (Surroundings::Floor, SynthLayout::Transforms);
    let options = SynthOptions { surroundings, layout, views: 6, test_views: 2, size: [40, 30], ..OPTIONS };
    synthesize(folder.path(), &options).unwrap();
    let is_on_floor = |point: &DVec3| (point.z + 0.86).abs() < 1e-4;
    for (view, distances) in distances(folder.path()) {
        let places: Vec<DVec3> = view.camera.rays(0..30).zip(&distances).map(|(ray, &t)| ray.unwrap().at(t)).collect();
        assert!(places.iter().all(|place| !place.is_finite() || place.z > -0.861));
        assert!(places.iter().filter(|place| is_on_floor(place)).count() > 200);
    }
    let dataset = load(folder.path(), "train", &LoadOptions::default()).unwrap();
    assert!(dataset.depth_maps.len() >= 6, "{}", dataset.depth_maps.len());
    for map in &dataset.depth_maps {
        let points = map.points(10_000).unwrap();
        assert!(
            points.iter().all(|point| point.z > -0.861) && points.iter().filter(|at| is_on_floor(at)).count() > 200
        );
    }
    // The lower left corner is on the floor, away from shadows.
    let corners = dataset.views.iter().map(|view| view.pixels.color(29 * 40, [0.0; 3])[1]);
    let (least, most) = corners.fold((1.0_f32, 0.0_f32), |(least, most), v| (least.min(v), most.max(v)));
    assert!(most > 1.1 * least && most < 0.99, "{least} to {most}");
}

#[test]
fn a_room_is_closed_and_its_sparse_points_are_what_cameras_see() {
    let folder = tempfile::tempdir().unwrap();
    let (surroundings, layout) = (Surroundings::Room, SynthLayout::Colmap);
    let options = SynthOptions { surroundings, layout, views: 7, test_views: 1, size: [40, 30], ..OPTIONS };
    synthesize(folder.path(), &options).unwrap();
    for (view, distances) in distances(folder.path()) {
        for (ray, distance) in view.camera.rays(0..30).zip(&distances) {
            let at = ray.unwrap().at(*distance);
            assert!(at.x.abs() < 2.301 && at.y.abs() < 1.901 && (-0.861..1.141).contains(&at.z), "{at}");
        }
    }
    let points = fs::metadata(folder.path().join("sparse/0/points3D.bin")).unwrap().len();
    assert!(points > 1000 * 43, "{points} bytes");
}
