//! LLFF's layout: `poses_bounds.npy` and `images/`.
//!
//! Each row of the array has a 3x5 matrix, its columns the camera's axes down, right and back, its position, and height,
//! width and focal length in pixels of the full pictures; then the near and far depth of its points.

use std::fs::File;
use std::io::BufReader;
use std::path::{Path, PathBuf};

use super::capture::Capture;
use super::records::BadRecords;
use super::shot::{Focal, Intrinsics, Shot, SmallerPicture};
use super::{Error, files};
use strivec_format::geometry::{Lens, NotRigid, rigid};
use strivec_import::npy::Header;

/// The array of poses.
pub(super) const POSES: &str = "poses_bounds.npy";
/// Numbers of a row.
const ROW: usize = 17;
/// The share of photographs whose nearest or farthest points are outside the range of all.
const RANGE_OUTLIERS: f64 = 0.02;
/// The most photographs.
const MAX_ROWS: u64 = 1 << 20;

/// The photographs in `folder`, ascending by name; those in `images_N` if there is such a folder for `downscale` N, with as
/// many pictures.
pub(super) fn read(folder: &Path, downscale: u32) -> Result<Capture, Error> {
    let path = folder.join(POSES);
    let rows = rows_of(&path)?;
    let images = folder.join("images");
    let smaller = files::smaller(&images, downscale);
    let count = rows.len();
    if !images.is_dir() && smaller.is_none() {
        let expected = format!("a folder with a picture for each of the {count} poses in {POSES}");
        return Err(Error::text(folder, "images", expected, "no such folder"));
    }
    // LLFF names smaller pictures by their numbers, so both are in the order of their names.
    let smaller_pictures = smaller.as_deref().map(files::pictures_in).transpose()?.filter(|found| found.len() == count);
    let pictures = match &smaller_pictures {
        Some(pictures) if !images.is_dir() => pictures.clone(),
        _ => files::pictures_in(&images)?,
    };
    if pictures.len() != count {
        let expected = format!("a pose for each of the {} pictures in {}", pictures.len(), images.display());
        return Err(Error::text(&path, "poses", expected, count.to_string()));
    }
    let (mut capture, mut bad) = (Capture::new(&path, Vec::new()), BadRecords::default());
    for (n, (row, picture)) in rows.iter().zip(pictures).enumerate() {
        let smaller = smaller_pictures.as_ref().map(|pictures| (pictures[n].clone(), downscale));
        let shot = shot(&path, n, row, picture, smaller);
        if row[..15].iter().all(|value| value.is_finite()) {
            capture.shots.push(shot?);
        } else {
            bad.keep(shot);
        }
    }
    capture.range = range_of(&rows);
    let bad = bad.tolerated(count)?;
    capture.lost = bad.len();
    capture.tell_bad(POSES.into(), &bad, count, "poses");
    Ok(capture)
}

fn rows_of(path: &Path) -> Result<Vec<[f64; ROW]>, Error> {
    let mut input = BufReader::new(File::open(path).map_err(Error::read(path))?);
    let malformed = |found: String| Error::text(path, "the array", "[photographs][17] floats", found);
    let header = Header::read(&mut input).map_err(|e| malformed(e.to_string()))?;
    let count = match header.shape[..] {
        [rows, 17] if (1..=MAX_ROWS).contains(&rows) => rows as usize,
        _ => return Err(malformed(format!("the shape {:?}", header.shape))),
    };
    let numbers = header.numbers(&mut input).map_err(|e| malformed(e.to_string()))?;
    if header.fortran_order {
        // [17][photographs]
        return Ok((0..count).map(|row| std::array::from_fn(|column| numbers[column * count + row])).collect());
    }
    Ok(numbers.as_chunks().0.to_vec())
}

/// The range of depths of the rows, without those of a few photographs; `None` if it is none.
fn range_of(rows: &[[f64; ROW]]) -> Option<[f64; 2]> {
    let sorted = |column: usize| {
        let mut values: Vec<f64> = rows.iter().map(|row| row[column]).filter(|value| value.is_finite()).collect();
        values.sort_by(f64::total_cmp);
        values
    };
    let [nears, fars] = [sorted(15), sorted(16)];
    let few = (RANGE_OUTLIERS * rows.len() as f64) as usize;
    let (&near, &far) = (nears.get(few)?, fars.get(fars.len().checked_sub(few + 1)?)?);
    (0.0 < near && near < far).then_some([near, far])
}

fn shot(
    path: &Path,
    n: usize,
    row: &[f64; ROW],
    picture: PathBuf,
    smaller: Option<SmallerPicture>,
) -> Result<Shot, Error> {
    let place = format!("pose {n}");
    let matrix: [&[f64; 5]; 3] = [0, 1, 2].map(|r| row[5 * r..].first_chunk().expect("a row of five"));
    let [height, width, focal] = matrix.map(|r| r[4]);
    let rows = [0, 1, 2].map(|r| {
        let [down, right, back, position, _] = *matrix[r];
        [right, -down, back, position]
    });
    let (world_from_camera, position) = rigid(&[rows[0], rows[1], rows[2], [0.0, 0.0, 0.0, 1.0]])
        .map_err(|NotRigid { expected, found }| Error::text(path, place.clone(), expected, found))?;
    let whole = |value: f64| if value.fract() == 0.0 { value as u32 } else { 0 };
    let intrinsics = Intrinsics {
        size: Some([whole(width), whole(height)]),
        focal: Focal::Pixels([focal; 2]),
        principal: [None; 2],
        lens: Lens::PINHOLE,
    };
    intrinsics.check(path, &place)?;
    Ok(Shot { smaller, ..Shot::of(picture, intrinsics, world_from_camera, position) })
}
