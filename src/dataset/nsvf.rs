//! NSVF's layout, as of its Tanks and Temples scenes: `intrinsics.txt`, `pose/NAME.txt`, `rgb/NAME.png`, `bbox.txt`.
//!
//! Poses are row-major `world_from_camera` matrices in OpenCV's axes. Names begin with `0_` for training, `1_` for
//! validation and `2_` for test views; scenes without `2_` test on `1_`.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

use glam::DVec3;

use super::capture::Capture;
use super::records::BadRecords;
use super::scan::{numbers_of, read_matrix};
use super::shot::{Focal, Intrinsics, OPENGL_FROM_OPENCV, Shot, Split};
use super::{Error, files, names};
use strivec_format::geometry::{Aabb, Lens, NotRigid, rigid};

/// The files and folders by which the layout is recognized.
pub(super) const PARTS: [&str; 3] = ["intrinsics.txt", "pose", "rgb"];

/// The photographs in `folder`, ascending by name.
pub(super) fn read(folder: &Path) -> Result<Capture, Error> {
    let intrinsics = intrinsics(&folder.join("intrinsics.txt"))?;
    let poses = folder.join("pose");
    let mut found = Vec::new();
    for entry in fs::read_dir(&poses).map_err(Error::read(&poses))? {
        let file = PathBuf::from(entry.map_err(Error::read(&poses))?.file_name());
        if file.extension().is_some_and(|ending| ending == "txt")
            && !files::is_hidden(file.as_os_str())
            && let Some(name) = file.file_stem().and_then(|stem| stem.to_str())
        {
            found.push(name.to_owned());
        }
    }
    found.sort();
    let known: BTreeSet<String> = found.iter().map(|name| names::normal(name)).collect();
    let has_pose = |picture: &PathBuf| {
        let stem = picture.file_stem().and_then(|stem| stem.to_str());
        stem.is_some_and(|stem| known.contains(&names::normal(stem)))
    };
    let lost = files::pictures_in(&folder.join("rgb"))?.iter().filter(|picture| !has_pose(picture)).count();
    let (mut capture, mut bad) = (Capture::new(&poses, Vec::new()), BadRecords::default());
    let total = found.len();
    for name in found {
        let path = poses.join(format!("{name}.txt"));
        let rows = read_matrix(&path)?;
        let shot = shot(folder, &path, name, &rows, intrinsics);
        capture.inputs.push(path);
        if rows.as_flattened().iter().all(|value| value.is_finite()) {
            capture.shots.push(shot?);
        } else {
            bad.keep(shot);
        }
    }
    let bad = bad.tolerated(total)?;
    capture.tell_bad("pose".into(), &bad, total, "poses");
    let bounds = folder.join("bbox.txt");
    capture.bounds = if bounds.is_file() { Some(bounds_of(&bounds)?) } else { None };
    capture.inputs.extend([folder.join("intrinsics.txt"), bounds]);
    capture.lost = lost + bad.len();
    Ok(capture)
}

fn shot(folder: &Path, path: &Path, name: String, rows: &[[f64; 4]; 4], intrinsics: Intrinsics) -> Result<Shot, Error> {
    let (rotation, position) =
        rigid(rows).map_err(|NotRigid { expected, found }| Error::text(path, "the matrix", expected, found))?;
    let split = match name.get(..2) {
        Some("0_") => Some(Split::Train),
        Some("1_") => Some(Split::Validation),
        Some("2_") => Some(Split::Test),
        _ => None,
    };
    Ok(Shot {
        picture: files::with_ending(&folder.join("rgb").join(&name)),
        name,
        path: String::new(),
        smaller: None,
        reduced: 1,
        mask: None,
        intrinsics,
        world_from_camera: rotation * OPENGL_FROM_OPENCV,
        position,
        split,
    })
}

/// A 4x4 matrix, or a first line of focal length and principal point.
fn intrinsics(path: &Path) -> Result<Intrinsics, Error> {
    let numbers = numbers_of(path)?;
    let [fx, fy, cx, cy] = match numbers[..] {
        [fx, skew, cx, _, _, fy, cy, ..] if numbers.len() == 16 => {
            if skew != 0.0 {
                return Err(Error::text(path, "the matrix", "no skew", skew.to_string()));
            }
            [fx, fy, cx, cy]
        }
        [f, cx, cy, ..] if numbers.len() != 16 => [f, f, cx, cy],
        _ => return Err(Error::text(path, "intrinsics", "16 numbers, or f, cx and cy", numbers.len().to_string())),
    };
    let intrinsics =
        Intrinsics { size: None, focal: Focal::Pixels([fx, fy]), principal: [Some(cx), Some(cy)], lens: Lens::PINHOLE };
    intrinsics.check(path, "intrinsics")?;
    Ok(intrinsics)
}

/// The box of the first six numbers; the seventh is the size of NSVF's voxels.
fn bounds_of(path: &Path) -> Result<Aabb, Error> {
    let numbers = numbers_of(path)?;
    if let [x, y, z, u, v, w, ..] = numbers[..] {
        let bounds = Aabb { min: DVec3::new(x, y, z), max: DVec3::new(u, v, w) };
        if bounds.is_solid() {
            return Ok(bounds);
        }
    }
    Err(Error::text(path, "the box", "two corners, the smallest coordinates first", format!("{numbers:?}")))
}
