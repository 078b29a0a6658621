//! ScanNet's layout, as its exporter (SensReader) writes a scan: `color/N.jpg`, `pose/N.txt`,
//! `intrinsic/intrinsic_color.txt`, the scan's constants and its mesh (see [`Scan`]).
//!
//! Poses are row-major `world_from_camera` matrices in OpenCV's axes (x right, y down, looking along +z); the dataset's
//! space is theirs after the scan's axis alignment, so z is up, and the mesh is aligned in the same way. Frames whose
//! pose is not finite were lost while scanning: they are skipped and counted. ScanNet has no splits: of the frames in
//! the order of their numbers, lost ones included, the fifth of every eight is a test view; all others are for
//! training.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

use glam::DMat3;

use super::capture::Capture;
use super::scan::{Constants, read_matrix};
use super::shot::{Focal, Intrinsics, OPENGL_FROM_OPENCV, Shot, Split};
use super::{Error, Scan, files};
use strivec_format::geometry::{Lens, NotRigid, rigid};

/// The folders by which a scan without a mesh is recognized.
pub(super) const PARTS: [&str; 2] = ["pose", "color"];
/// The interval of test views, in frames.
const TEST_EVERY: usize = 8;
/// The index of the first test view.
const FIRST_TEST: usize = 4;

/// The frames of `scan` that the split `split` needs, ascending by number. Those of other splits are not
/// read.
pub(super) fn read(scan: Scan, split: &str) -> Result<Capture, Error> {
    let intrinsics = intrinsics(&scan)?;
    let (poses, color) = (scan.folder.join("pose"), scan.folder.join("color"));
    let frames = numbers(&poses, &["txt"])?;
    let pictures = if color.is_dir() { numbers(&color, &files::PICTURES)? } else { BTreeMap::new() };
    // Reading the pose of the number of a picture reports pictures without a pose.
    let all: BTreeSet<u32> = frames.keys().chain(pictures.keys()).copied().collect();
    let mut capture = Capture { points: scan.mesh.clone(), ..Capture::new(&scan.folder, Vec::new()) };
    capture.inputs.extend(frames.values().cloned());
    capture.inputs.extend(inputs(&scan));
    for (index, number) in all.into_iter().enumerate() {
        let own = if index % TEST_EVERY == FIRST_TEST { Split::Test } else { Split::Train };
        if !(split == "all" || split == own.name()) {
            continue;
        }
        let path = frames.get(&number).cloned().unwrap_or_else(|| poses.join(format!("{number}.txt")));
        let rows = read_matrix(&path)?;
        if rows.as_flattened().iter().any(|value| !value.is_finite()) {
            capture.lost += 1;
            continue;
        }
        let (rotation, position) =
            rigid(&rows).map_err(|NotRigid { expected, found }| Error::text(&path, "the matrix", expected, found))?;
        capture.shots.push(Shot {
            name: number.to_string(),
            path: String::new(),
            picture: pictures
                .get(&number)
                .cloned()
                .unwrap_or_else(|| files::with_ending(&color.join(number.to_string()))),
            smaller: None,
            reduced: 1,
            mask: None,
            intrinsics,
            world_from_camera: DMat3::from_mat4(scan.alignment) * rotation * OPENGL_FROM_OPENCV,
            position: scan.aligned(position),
            split: Some(own),
        });
    }
    Ok(capture)
}

/// The intrinsics of all color pictures: of their own file, else of the scan's constants, which may also define for
/// which size of pictures they are.
fn intrinsics(scan: &Scan) -> Result<Intrinsics, Error> {
    let constants = Constants::of(&scan.folder, &scan.name)?;
    let number = |key| constants.as_ref().map_or(Ok(None), |constants| constants.number(key));
    let path = scan.folder.join("intrinsic/intrinsic_color.txt");
    let (path, [fx, fy, cx, cy]) = if path.is_file() {
        let rows = read_matrix(&path)?;
        if rows[0][1] != 0.0 || rows[1][0] != 0.0 {
            return Err(Error::text(&path, "the matrix", "without skew", format!("{rows:?}")));
        }
        (path, [rows[0][0], rows[1][1], rows[0][2], rows[1][2]])
    } else {
        let mut values = [0.0; 4];
        for (value, key) in values.iter_mut().zip(["fx_color", "fy_color", "mx_color", "my_color"]) {
            let expected = || format!("in this file, or under {key} in {}.txt", scan.name);
            *value = number(key)?.ok_or_else(|| Error::text(&path, "the intrinsics", expected(), "neither"))?;
        }
        (scan.folder.join(format!("{}.txt", scan.name)), values)
    };
    let size = match (number("colorWidth")?, number("colorHeight")?, &constants) {
        (Some(width), Some(height), Some(constants)) => {
            Some([constants.extent("colorWidth", width)?, constants.extent("colorHeight", height)?])
        }
        _ => None,
    };
    let (focal, principal) = (Focal::Pixels([fx, fy]), [Some(cx), Some(cy)]);
    let intrinsics = Intrinsics { size, focal, principal, lens: Lens::PINHOLE };
    intrinsics.check(&path, "the intrinsics")?;
    Ok(intrinsics)
}

/// The files N.ENDING in `folder` by their numbers N, which may have leading zeros; other files are not frames.
fn numbers(folder: &Path, endings: &[&str]) -> Result<BTreeMap<u32, PathBuf>, Error> {
    let mut numbers: BTreeMap<u32, PathBuf> = BTreeMap::new();
    for entry in fs::read_dir(folder).map_err(Error::read(folder))? {
        let entry = entry.map_err(Error::read(folder))?;
        let file = entry.file_name();
        let Some((stem, ending)) = file.to_str().and_then(|file| file.rsplit_once('.')) else { continue };
        // Without a sign, as in +7.
        let number = stem.parse::<u32>().ok().filter(|_| stem.bytes().all(|byte| byte.is_ascii_digit()));
        let is_frame = endings.iter().any(|known| ending.eq_ignore_ascii_case(known));
        if let Some(number) = number.filter(|_| is_frame) {
            // Of several, the first by name.
            let path = numbers.entry(number).or_insert_with(|| entry.path());
            if entry.path() < *path {
                *path = entry.path();
            }
        }
    }
    Ok(numbers)
}

/// The files of `scan` that are read but for frames and the mesh.
fn inputs(scan: &Scan) -> Vec<PathBuf> {
    let names = ["intrinsic/intrinsic_color.txt".to_owned(), format!("{}.txt", scan.name)];
    names.into_iter().map(|name| scan.folder.join(name)).collect()
}
