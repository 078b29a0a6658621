//! LLFF's layout: `poses_bounds.npy` and `images/`.
//!
//! Each row of the array has a 3x5 matrix, its columns the camera's axes down, right and back, its position, and height,
//! width and focal length in pixels of the full pictures; then the near and far depth of its points.

use std::fs::File;
use std::io::BufReader;
use std::path::{Path, PathBuf};

use super::capture::Capture;
use super::shot::{Focal, Intrinsics, Shot};
use super::{Error, files};
use strivec_format::geometry::{Lens, NotRigid, rigid};
use strivec_import::npy::Header;

/// The array of poses.
pub(super) const POSES: &str = "poses_bounds.npy";
/// Numbers of a row.
const ROW: usize = 17;
/// The most photographs.
const MAX_ROWS: u64 = 1 << 20;

/// The photographs in `folder`, ascending by name; those in `images_N` if there is such a folder for `downscale` N.
pub(super) fn read(folder: &Path, downscale: u32) -> Result<Capture, Error> {
    let path = folder.join(POSES);
    let rows = rows_of(&path)?;
    let (images, reduced) = files::reduced(&folder.join("images"), downscale);
    if !images.is_dir() {
        let expected = format!("a folder with a picture for each of the {} poses in {POSES}", rows.len());
        return Err(Error::text(folder, "images", expected, "no such folder"));
    }
    let pictures = files::pictures_in(&images)?;
    if pictures.len() != rows.len() {
        let expected = format!("a pose for each of the {} pictures in {}", pictures.len(), images.display());
        return Err(Error::text(&path, "poses", expected, rows.len().to_string()));
    }
    let shots = (rows.iter().zip(pictures).enumerate())
        .map(|(n, (row, picture))| shot(&path, n, row, picture, reduced))
        .collect::<Result<Vec<_>, _>>()?;
    Ok(Capture::new(&path, shots))
}

fn rows_of(path: &Path) -> Result<Vec<[f64; ROW]>, Error> {
    let mut input = BufReader::new(File::open(path).map_err(Error::read(path))?);
    let malformed = |found: String| Error::text(path, "the array", "[photographs][17] floats", found);
    let header = Header::read(&mut input).map_err(|e| malformed(e.to_string()))?;
    match header.shape[..] {
        [rows, 17] if (1..=MAX_ROWS).contains(&rows) && !header.fortran_order => {}
        _ => return Err(malformed(format!("the shape {:?}", header.shape))),
    }
    let numbers = header.numbers(&mut input).map_err(|e| malformed(e.to_string()))?;
    Ok(numbers.as_chunks().0.to_vec())
}

fn shot(path: &Path, n: usize, row: &[f64; ROW], picture: PathBuf, reduced: u32) -> Result<Shot, Error> {
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
    let name = picture.file_stem().map_or_else(String::new, |stem| stem.to_string_lossy().into_owned());
    Ok(Shot { name, picture, reduced, mask: None, intrinsics, world_from_camera, position, split: None })
}
