//! ScanNet's layout: a synthetic scan read back, and malformed scans.

use std::collections::{BTreeMap, HashSet};
use std::fs;
use std::path::{Path, PathBuf};

use glam::{DVec3, Vec3};
use image::RgbImage;
use strivec_capture::dataset;
use strivec_capture::dataset::{Dataset, Error, ErrorKind, LoadOptions, Scan, load_cameras};
use strivec_synth::{CameraModel, Surroundings, SynthLayout, SynthOptions, Synthesized, synthesize};
use tempfile::TempDir;

const OPTIONS: SynthOptions = SynthOptions {
    layout: SynthLayout::ScanNet,
    camera: CameraModel::Pinhole,
    views: 12,
    test_views: 4,
    size: [48, 36],
    seed: 5,
    surroundings: Surroundings::None,
    force: false,
};

/// The synthetic scan `scene0000_00` in a folder of its own.
fn synthetic(options: &SynthOptions) -> (TempDir, PathBuf, Synthesized) {
    let around = tempfile::tempdir().unwrap();
    let folder = around.path().join("scene0000_00");
    let made = synthesize(&folder, options).unwrap();
    (around, folder, made)
}

/// Vertices, their colors, and triangles of a mesh that the generator wrote.
fn mesh(path: &Path) -> (Vec<DVec3>, Vec<[u8; 3]>, Vec<[u32; 3]>) {
    let bytes = fs::read(path).unwrap();
    let end = bytes.windows(11).position(|w| w == b"end_header\n").unwrap() + 11;
    let header = std::str::from_utf8(&bytes[..end]).unwrap();
    let count = |element: &str| -> usize {
        let line = header.lines().find_map(|line| line.strip_prefix(&format!("element {element} ")));
        line.unwrap().parse().unwrap()
    };
    let (vertices, faces) = bytes[end..].split_at(16 * count("vertex"));
    assert_eq!(faces.len(), 13 * count("face"), "bytes of faces");
    let at =
        |v: &[u8]| Vec3::from_array([0, 4, 8].map(|i| f32::from_le_bytes(v[i..i + 4].try_into().unwrap()))).as_dvec3();
    let triangle = |f: &[u8]| [1, 5, 9].map(|i| u32::from_le_bytes(f[i..i + 4].try_into().unwrap()));
    (
        vertices.chunks(16).map(at).collect(),
        vertices.chunks(16).map(|v| [v[12], v[13], v[14]]).collect(),
        faces.chunks(13).map(triangle).collect(),
    )
}

/// The share of `points` in the pictures of `dataset` that are in front of a pixel which is not white, nor are its
/// neighbors.
fn on_foreground(dataset: &Dataset, points: impl Iterator<Item = DVec3> + Clone) -> f64 {
    let (mut inside, mut covered) = (0_u32, 0_u32);
    for view in &dataset.views {
        let camera = &view.camera;
        let white = |column: i64, row: i64| {
            let pixel = row.clamp(0, i64::from(camera.height) - 1) as usize * camera.width as usize
                + column.clamp(0, i64::from(camera.width) - 1) as usize;
            view.pixels.color(pixel, [0.0; 3]).iter().all(|&channel| channel > 0.96)
        };
        for point in points.clone() {
            // By hand: x right, y up, looking along −z.
            let seen = camera.world_from_camera.transpose() * (point - camera.position);
            let column = (camera.principal[0] + camera.focal[0] * seen.x / -seen.z).floor();
            let row = (camera.principal[1] - camera.focal[1] * seen.y / -seen.z).floor();
            let within =
                (0.0..f64::from(camera.width)).contains(&column) && (0.0..f64::from(camera.height)).contains(&row);
            if seen.z < 0.0 && within {
                let (column, row) = (column as i64, row as i64);
                inside += 1;
                let near = (-1..=1).flat_map(|y| (-1..=1).map(move |x| (x, y)));
                covered += u32::from(near.into_iter().any(|(x, y)| !white(column + x, row + y)));
            }
        }
    }
    assert!(inside > 1000, "{inside} points in all pictures");
    f64::from(covered) / f64::from(inside)
}

#[test]
fn cameras_see_the_aligned_mesh_of_a_synthetic_scan() {
    let (_around, folder, made) = synthetic(&OPTIONS);
    assert_eq!((made.pictures, made.lost), (18, 2));
    let train = dataset::load(&folder, "train", &LoadOptions::default()).unwrap();
    let test = dataset::load(&folder, "test", &LoadOptions::default()).unwrap();
    assert_eq!((train.name.as_str(), train.views.len(), train.lost), ("scene0000_00", 14, 2));
    assert_eq!((test.views.len(), test.lost), (2, 0));
    assert_eq!(test.views.iter().map(|v| v.name.as_str()).collect::<Vec<_>>(), ["4", "12"]);
    let numbers: Vec<u32> = train.views.iter().map(|v| v.name.parse().unwrap()).collect();
    assert!(numbers.is_sorted() && !numbers.contains(&4) && !numbers.contains(&12), "{numbers:?}");
    for view in train.views.iter().chain(&test.views) {
        assert_eq!((view.camera.width, view.camera.height, view.pixels.len()), (48, 36, 48 * 36));
        assert!(view.pixels.is_opaque());
        // Around a room of 4.8 m, its middle in check_alignment, upright.
        assert!((view.camera.position.length() - 2.4 * 4.031).abs() < 1e-2);
        let middle = view.camera.ray_through(24.0, 18.0).unwrap();
        assert!(middle.at(view.camera.position.length()).length() < 1e-3);
        assert!(view.camera.ray_through(24.0, 0.0).unwrap().direction.z > middle.direction.z, "up is up");
    }

    let scan = Scan::open(&folder).unwrap().unwrap();
    let (vertices, colors, triangles) = mesh(scan.mesh.as_deref().unwrap());
    assert_eq!(triangles.len(), made.triangles);
    let some = || vertices.iter().step_by(97).copied();
    let (aligned, stored) = (on_foreground(&train, some().map(|v| scan.aligned(v))), on_foreground(&train, some()));
    assert!(aligned > 0.98 && stored < 0.8, "{aligned} {stored}");
    let reach = vertices.iter().map(|&v| scan.aligned(v).abs().max_element()).fold(0.0, f64::max);
    assert!((2.2..2.4).contains(&reach), "{reach}");
    assert!(colors.iter().collect::<HashSet<_>>().len() > 1000, "colors differ");

    assert!((0.08..0.09).contains(&made.torn), "{}", made.torn);
    let edges: HashSet<_> = triangles.iter().flat_map(|&[a, b, c]| [(a, b), (b, c), (c, a)]).collect();
    let open = edges.iter().filter(|&&(a, b)| !edges.contains(&(b, a))).count();
    assert!(open > 300 && 20 * open < edges.len(), "{open} of {} edges are at holes", edges.len());
    let longest = edges.iter().map(|&(a, b)| vertices[a as usize].distance(vertices[b as usize])).fold(0.0, f64::max);
    assert!(longest < 0.0721, "holes are local: {longest}");
}

fn files(folder: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let mut files = BTreeMap::new();
    for entry in fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()) {
        if entry.is_dir() {
            files.extend(self::files(&entry));
        } else {
            files.insert(entry.clone(), fs::read(entry).unwrap());
        }
    }
    files
}

#[test]
fn seed_alone_decides_every_byte_of_a_synthetic_scan() {
    let around = tempfile::tempdir().unwrap();
    let folder = around.path().join("room");
    let make = |threads: usize, seed| {
        let options = SynthOptions { views: 3, test_views: 1, size: [12, 9], seed, force: true, ..OPTIONS };
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| synthesize(&folder, &options)).unwrap();
        files(&folder)
    };
    let (one, three) = (make(1, 1), make(3, 1));
    assert!(one == three, "the number of threads shows");
    for part in ["room.txt", "room_vh_clean_2.ply", "intrinsic/intrinsic_color.txt", "pose/5.txt", "color/0.jpg"] {
        assert!(one.contains_key(&folder.join(part)), "{part}");
    }
    assert_eq!(one.len(), 3 + 6 + 6);
    let other = make(2, 2);
    for part in ["room_vh_clean_2.ply", "color/0.jpg", "pose/1.txt"] {
        assert!(one[&folder.join(part)] != other[&folder.join(part)], "{part} does not depend on the seed");
    }
    let again = synthesize(&folder, &SynthOptions { force: false, ..OPTIONS }).unwrap_err();
    assert!(!again.is_io(), "{again}");
}

#[test]
fn a_scanned_room_has_the_inner_sides_of_its_walls() {
    let options = SynthOptions { surroundings: Surroundings::Room, views: 3, test_views: 1, size: [12, 9], ..OPTIONS };
    let (_around, folder, _) = synthetic(&options);
    let scan = Scan::open(&folder).unwrap().unwrap();
    let (vertices, ..) = mesh(scan.mesh.as_deref().unwrap());
    // 1.2 m per unit.
    let walls = 1.2 * DVec3::new(2.3, 1.9, 1.14);
    let mut on_walls = 0;
    for at in vertices.iter().map(|&vertex| scan.aligned(vertex)) {
        // The floor and the ceiling reach under and over the walls.
        assert!((at.abs() - walls).max_element() < 0.1201, "{at}");
        on_walls += usize::from((at.abs() - walls).abs().min_element() < 1e-4);
    }
    assert!(3 * on_walls > vertices.len(), "{on_walls} of {}", vertices.len());
}

const IDENTITY: &str = "1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n";

/// A scan of ten frames of 8×6 pixels; frame N stands at (N, 0, 0) and its picture is of the gray 10 N.
struct Small {
    folder: TempDir,
}

impl Small {
    fn new() -> Self {
        let small = Self { folder: tempfile::tempdir().unwrap() };
        for part in ["color", "pose", "intrinsic"] {
            fs::create_dir(small.folder.path().join(part)).unwrap();
        }
        for n in 0..10 {
            small.write(&format!("pose/{n}.txt"), IDENTITY.replacen("0 0 0\n", &format!("0 0 {n}\n"), 1));
            let picture = RgbImage::from_pixel(8, 6, image::Rgb([10 * n as u8; 3]));
            picture.save(small.path(&format!("color/{n}.png"))).unwrap();
        }
        small.write("intrinsic/intrinsic_color.txt", "7 0 4 0\n0 7.5 3 0\n0 0 1 0\n0 0 0 1");
        small
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn write(&self, name: &str, bytes: impl AsRef<[u8]>) {
        fs::write(self.path(name), bytes).unwrap();
    }

    /// The constants, in the file that has the folder's name.
    fn constants(&self, text: impl AsRef<[u8]>) {
        let name = self.folder.path().file_name().unwrap().to_str().unwrap().to_owned();
        self.write(&format!("{name}.txt"), text);
    }

    fn load(&self, split: &str) -> Result<Dataset, Error> {
        dataset::load(self.folder.path(), split, &LoadOptions::default())
    }

    /// Fails to load `train` with an error of `kind` that is one line and has `part`.
    fn fails(&self, kind: ErrorKind, part: &str) {
        let error = self.load("train").unwrap_err();
        let message = error.to_string();
        assert!(message.contains(part) && !message.contains('\n'), "{message} lacks {part}");
        assert_eq!(error.kind(), kind, "{message}");
    }
}

#[test]
fn frames_intrinsics_and_splits_are_as_the_files_say() {
    let small = Small::new();
    let train = small.load("train").unwrap();
    let positions: Vec<f64> = train.views.iter().map(|v| v.camera.position.x).collect();
    assert_eq!(positions, [0.0, 1.0, 2.0, 3.0, 5.0, 6.0, 7.0, 8.0, 9.0]);
    let camera = train.views[1].camera;
    assert_eq!((camera.focal, camera.principal), ([7.0, 7.5], [4.0, 3.0]));
    // OpenCV looks along +z with y down.
    assert_eq!(camera.ray_through(4.0, 3.0).unwrap().direction, DVec3::Z);
    assert!(
        camera.ray_through(4.0, 0.0).unwrap().direction.y < 0.0
            && camera.ray_through(8.0, 3.0).unwrap().direction.x > 0.0
    );
    assert_eq!(train.views[4].pixels.color(0, [0.0; 3]), [50.0 / 255.0; 3]);
    assert_eq!(small.load("test").unwrap().views.len(), 1);

    small.write("pose/4.txt", "-inf ".repeat(16));
    small.write("pose/5.txt", "-1.#INF ".repeat(16));
    let message = small.load("test").unwrap_err().to_string();
    assert!(message.contains("must have at least one frame with a pose; found 1 frame without a pose"), "{message}");
    let train = small.load("train").unwrap();
    assert_eq!((train.views.len(), train.lost), (8, 1));
    assert_eq!(train.views[4].name, "6", "the split of others stays");

    let options = LoadOptions { views: Some(2..8), every: 3, downscale: 2, ..LoadOptions::default() };
    let some = dataset::load(small.folder.path(), "train", &options).unwrap();
    assert_eq!(some.views.iter().map(|v| v.name.as_str()).collect::<Vec<_>>(), ["2", "7"]);
    assert_eq!((some.views[0].camera.width, some.views[0].camera.focal), (4, [3.5, 3.75]));
    let cameras =
        load_cameras(small.folder.path(), "train", None, &LoadOptions { downscale: 2, ..LoadOptions::default() })
            .unwrap();
    assert_eq!((cameras.len(), cameras[5].name.as_str(), cameras[5].camera), (8, "7", some.views[1].camera));
}

#[test]
fn alignment_turns_cameras_and_names_what_is_wrong() {
    let small = Small::new();
    small.constants("axisAlignment = 0 -1 0 3 1 0 0 4 0 0 1 5 0 0 0 1 \n");
    let view = &small.load("train").unwrap().views[2];
    assert_eq!(view.camera.position, DVec3::new(3.0, 6.0, 5.0));
    assert!(view.camera.ray_through(8.0, 3.0).unwrap().direction.y > 0.0, "x has become y");
    small.constants("axisAlignment = 1 2 3\n");
    small.fails(ErrorKind::Malformed, "axisAlignment must be 16 numbers; found 3");
    small.constants(b"axisAlignment = \xff\xfe");
    small.fails(ErrorKind::Malformed, "byte 16 must be UTF-8 text");
}

#[test]
fn intrinsics_of_another_size_are_scaled_where_the_scan_says_so() {
    let small = Small::new();
    small.write("intrinsic/intrinsic_color.txt", "14 0 8 0 0 15 6 0 0 0 1 0 0 0 0 1");
    small.fails(ErrorKind::Malformed, "column must be in the middle half of 8 pixels unless ");
    small.constants("colorWidth = 16\ncolorHeight = 12\n");
    let camera = small.load("train").unwrap().views[0].camera;
    assert_eq!((camera.focal, camera.principal), ([7.0, 7.5], [4.0, 3.0]));
    for (value, part) in [
        ("colorWidth = 1e9\ncolorHeight = 12", "colorWidth must be a whole number from 1 to 16384"),
        ("colorWidth = 32\ncolorHeight = twelve", "colorHeight must be a number; found \"twelve\""),
    ] {
        small.constants(value);
        small.fails(ErrorKind::Malformed, part);
    }

    fs::remove_dir_all(small.path("intrinsic")).unwrap();
    small.constants("colorWidth = 8\ncolorHeight = 6\nfx_color = 7\nfy_color = 7.5\nmx_color = 4");
    small.fails(ErrorKind::Malformed, "the intrinsics must be in this file, or under my_color in");
    small.constants("colorWidth = 8\ncolorHeight = 6\nfx_color = 7\nfy_color = 7.5\nmx_color = 4\nmy_color = 3");
    let camera = small.load("train").unwrap().views[0].camera;
    assert_eq!((camera.focal, camera.principal), ([7.0, 7.5], [4.0, 3.0]));

    fs::remove_dir_all(small.path("color")).unwrap();
    fs::create_dir(small.path("color")).unwrap();
    let cameras = |size| load_cameras(small.folder.path(), "train", size, &LoadOptions::default()).unwrap();
    assert_eq!((cameras(None).len(), cameras(None)[0].camera), (9, camera));
    let same = cameras(Some([16, 12]))[0].camera;
    assert_eq!((same.width, same.focal), (8, [7.0, 7.5]), "the scan says the size");
}

#[test]
fn broken_poses_and_intrinsics_are_named() {
    for (text, part) in [
        (IDENTITY.replace('1', "one"), "3.txt: the matrix must be 16 numbers; found the word \"one\""),
        (IDENTITY.replacen('1', "", 1), "3.txt: the matrix must be 16 numbers; found 15"),
        (String::new(), "3.txt: the matrix must be 16 numbers; found 0"),
        (IDENTITY.replacen('1', "2", 1), "3.txt: the matrix must be an orthonormal rotation"),
        (IDENTITY.replacen('1', "-1", 1), "3.txt: the matrix must be a right-handed rotation"),
        (format!("{}0 0 0 2", &IDENTITY[..24]), "3.txt: the matrix must be one with the last row 0 0 0 1"),
    ] {
        let small = Small::new();
        small.write("pose/3.txt", text);
        small.fails(ErrorKind::Malformed, part);
    }
    let small = Small::new();
    small.write("pose/3.txt", " ".repeat((1 << 20) + 1));
    small.fails(ErrorKind::Limit, "3.txt: at most 1048576 bytes are supported; found 1048577");
    for (text, part) in [
        ("7 0 4 0 0 0 3 0 0 0 1 0 0 0 0 1", "the focal length along rows must be a positive number of pixels; found 0"),
        ("inf 0 4 0 0 7 3 0 0 0 1 0 0 0 0 1", "the focal length along columns must be a positive number"),
        ("7 0 nan 0 0 7 3 0 0 0 1 0 0 0 0 1", "the principal point's column must be within 262144 pixels"),
        ("7 1 4 0 0 7 3 0 0 0 1 0 0 0 0 1", "must be without skew"),
        ("7 0 4 0 0 7 3", "intrinsic_color.txt: the matrix must be 16 numbers; found 7"),
    ] {
        let small = Small::new();
        small.write("intrinsic/intrinsic_color.txt", text);
        small.fails(ErrorKind::Malformed, part);
    }
}

#[test]
fn missing_parts_are_named() {
    let small = Small::new();
    fs::remove_file(small.path("color/3.png")).unwrap();
    small.fails(ErrorKind::Io, "1 of 9 pictures do not exist, the first is ");
    let small = Small::new();
    fs::remove_file(small.path("pose/3.txt")).unwrap();
    small.fails(ErrorKind::Io, "3.txt: No such file");
    let small = Small::new();
    fs::remove_dir_all(small.path("intrinsic")).unwrap();
    small.fails(ErrorKind::Malformed, "the intrinsics must be in this file, or under fx_color in");
    let small = Small::new();
    for part in ["pose", "color"] {
        fs::remove_dir_all(small.path(part)).unwrap();
        fs::create_dir(small.path(part)).unwrap();
    }
    small.write("pose/readme.txt", "no pose");
    small.fails(ErrorKind::Malformed, "at least one frame with a pose; found no frames");
    let error = small.load("val").unwrap_err();
    assert!(error.to_string().contains("the split must be train, test or all; found \"val\""), "{error}");
    let nothing = tempfile::tempdir().unwrap();
    let error = dataset::load(nothing.path(), "train", &LoadOptions::default()).unwrap_err();
    assert!(error.to_string().contains("is not a dataset"), "{error}");
    let absent = nothing.path().join("absent");
    assert_eq!(dataset::load(&absent, "train", &LoadOptions::default()).unwrap_err().kind(), ErrorKind::Io);
}

#[test]
fn jpeg_pictures_are_read_by_their_bytes_and_broken_ones_named() {
    let small = Small::new();
    let gray = RgbImage::from_pixel(8, 6, image::Rgb([120; 3]));
    gray.save(small.path("color/3.jpg")).unwrap();
    fs::remove_file(small.path("color/3.png")).unwrap();
    let train = small.load("train").unwrap();
    assert!(train.views[3].pixels.color(20, [0.0; 3]).iter().all(|c| (c - 120.0 / 255.0).abs() < 0.01));
    // A name that does not fit the bytes is no harm.
    let jpeg = fs::read(small.path("color/3.jpg")).unwrap();
    small.write("color/2.png", &jpeg);
    assert_eq!(small.load("train").unwrap().views[2].pixels, train.views[3].pixels);

    for (bytes, part) in [
        (
            &jpeg[..jpeg.len() - 20],
            "3.jpg: the file must be a PNG, JPEG, WebP, TIFF or BMP picture: the JPEG file is truncated",
        ),
        (&jpeg[..30], "the JPEG file is truncated"),
        (b"GIF89a", "picture; found a GIF picture; convert it"),
        (b"", "picture; found an empty file"),
    ] {
        // One alone is left out, with its error.
        small.write("color/3.jpg", bytes);
        let unreadable = small.load("train").unwrap().unreadable;
        assert!(unreadable.len() == 1 && unreadable[0].contains(part), "{unreadable:?} lacks {part}");
    }
    small.write("color/2.png", b"");
    small.fails(
        ErrorKind::Malformed,
        "2.png: the file must be a PNG, JPEG, WebP, TIFF or BMP picture; found an empty file",
    );
    small.write("color/2.png", &jpeg);
    // A header that claims 65 535 columns and rows.
    let mut huge = jpeg.clone();
    let frame = huge.windows(2).position(|marker| marker == [0xff, 0xc0]).unwrap();
    huge[frame + 5..frame + 9].copy_from_slice(&[0xff; 4]);
    small.write("color/3.jpg", &huge);
    small.fails(ErrorKind::Limit, "3.jpg: at most 16384 pixels along an edge are supported; found 65535");
    RgbImage::new(6, 8).save(small.path("color/3.jpg")).unwrap();
    small.fails(ErrorKind::Malformed, "3.jpg: the picture size must be 8x6 as in ");
}
