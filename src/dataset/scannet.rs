//! ScanNet's layout, as its exporter (SensReader) writes a scan: `color/N.jpg`, `pose/N.txt`,
//! `intrinsic/intrinsic_color.txt`, the scan's constants and its mesh (see [`Scan`]).
//!
//! Poses are row-major `world_from_camera` matrices in OpenCV's axes (x right, y down, looking along +z); the dataset's
//! space is theirs after the scan's axis alignment, so z is up, and the mesh is aligned in the same way. Frames whose
//! pose is not finite were lost while scanning: they are skipped and counted. ScanNet has no splits: of the frames in
//! the order of their numbers, lost ones included, the fifth of every eight is a test view; all others are for
//! training.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

use glam::{DMat3, DVec3};

use super::photographs::{self, Taken};
use super::picture::{self, MAX_EDGE};
use super::scan::{Constants, read_matrix};
use super::{Dataset, Error, LoadOptions, NamedCamera, Scan};
use crate::geometry::{Camera, NotRigid, rigid};

/// The interval of test views, in frames.
const TEST_EVERY: usize = 8;
/// The index of the first test view.
const FIRST_TEST: usize = 4;
/// Extensions of pictures.
const PICTURES: [&str; 3] = ["jpg", "jpeg", "png"];
/// Signs that turn a camera's axes in OpenCV, the columns of `world_from_camera`, into those in OpenGL.
const OPENGL: DVec3 = DVec3::new(1.0, -1.0, -1.0);

/// The split `split` (`train` or `test`) of the scan in `folder`: the views that `options` select, in the order of
/// their numbers. Every pose must have its picture and every picture its pose.
///
/// # Errors
///
/// If the scan cannot be read or is invalid: all of [`Error`] but those of writing and JSON. Of several invalid files,
/// the first in order is reported.
pub fn load_scannet(folder: &Path, split: &str, options: &LoadOptions) -> Result<Dataset, Error> {
    let frames = Frames::of(folder, split)?;
    let listed = folder.join("pose");
    let pictures = (frames.posed.iter())
        .map(|posed| match frames.picture(posed.number) {
            Some(picture) => Ok((posed.number.to_string(), picture)),
            None => Err(Error::MissingPicture {
                path: listed.clone(),
                frame: posed.number as usize,
                picture: folder.join(format!("color/{}.jpg", posed.number)),
            }),
        })
        .collect::<Result<Vec<_>, _>>()?;
    let chosen = photographs::chosen(folder, pictures.len(), options)?;
    let first = pictures[chosen[0]].1.as_path();
    let size = picture::size(first)?;
    let cameras = frames.cameras(size, options.downscale)?;
    let taken = |&i: &usize| Taken { name: &pictures[i].0, picture: &pictures[i].1, camera: cameras[i] };
    let taken: Vec<_> = chosen.iter().map(taken).collect();
    let views = photographs::load(folder, &taken, size, first, options.downscale)?;
    Ok(Dataset { name: frames.scan.name, views, lost: frames.lost })
}

/// The cameras of a split of the scan in `folder`, as by [`load_scannet`]. No picture is decoded or required.
///
/// The size (columns and rows, before downscaling) is that of the first picture that exists, else `size`, else the
/// scan's `colorWidth` and `colorHeight`.
///
/// # Errors
///
/// If [`load_scannet`] fails, except for errors of pictures; or with [`Error::UnknownSize`].
pub fn load_scannet_cameras(
    folder: &Path,
    split: &str,
    size: Option<[u32; 2]>,
    downscale: u32,
) -> Result<Vec<NamedCamera>, Error> {
    let frames = Frames::of(folder, split)?;
    let size = match (frames.posed.iter().find_map(|posed| frames.picture(posed.number)), size) {
        (Some(picture), _) => picture::size(&picture)?,
        (None, Some(size)) => size,
        (None, None) => frames.color_size()?.ok_or_else(|| Error::UnknownSize { path: folder.to_path_buf() })?,
    };
    let cameras = frames.cameras(size, downscale)?;
    let named = |(posed, camera): (&Posed, Camera)| NamedCamera { name: posed.number.to_string(), camera };
    Ok(frames.posed.iter().zip(cameras).map(named).collect())
}

/// A split's frames.
struct Frames {
    scan: Scan,
    constants: Option<Constants>,
    /// The frames that were not lost, ascending by number; at least one.
    posed: Vec<Posed>,
    lost: usize,
}

/// A frame with its aligned pose in [`Camera`]'s axes.
struct Posed {
    number: u32,
    world_from_camera: DMat3,
    position: DVec3,
}

impl Frames {
    /// Reads the poses of `split`.
    fn of(folder: &Path, split: &str) -> Result<Self, Error> {
        let remainder = match split {
            "train" => false,
            "test" => true,
            _ => return Err(Error::Split { path: folder.to_path_buf(), found: split.into() }),
        };
        let scan = Scan::open(folder)?.ok_or_else(|| Error::Layout { path: folder.to_path_buf(), found: "neither" })?;
        let constants = Constants::of(folder, &scan.name)?;
        let poses = folder.join("pose");
        let mut numbers = numbers(&poses, &["txt"])?;
        if folder.join("color").is_dir() {
            // Reading the pose of such a number reports pictures without a pose.
            numbers.append(&mut self::numbers(&folder.join("color"), &PICTURES)?);
        }
        let (mut posed, mut lost) = (Vec::new(), 0);
        for (index, number) in numbers.into_iter().enumerate() {
            if (index % TEST_EVERY == FIRST_TEST) != remainder {
                continue;
            }
            let path = poses.join(format!("{number}.txt"));
            let rows = read_matrix(&path)?;
            if rows.as_flattened().iter().any(|value| !value.is_finite()) {
                lost += 1;
                continue;
            }
            let (rotation, position) = rigid(&rows)
                .map_err(|NotRigid { expected, found }| Error::text(&path, "the matrix", expected, found))?;
            let world_from_camera = DMat3::from_mat4(scan.alignment) * rotation * DMat3::from_diagonal(OPENGL);
            posed.push(Posed { number, world_from_camera, position: scan.aligned(position) });
        }
        if posed.is_empty() && lost > 0 {
            let found = format!("only lost frames ({lost})");
            return Err(Error::text(&poses, format!("the poses of {split}"), "finite for at least one frame", found));
        }
        if posed.is_empty() {
            return Err(Error::NoFrames { path: poses });
        }
        Ok(Self { scan, constants, posed, lost })
    }

    /// The picture of frame `number`, if there is one.
    fn picture(&self, number: u32) -> Option<PathBuf> {
        let path = |ending| self.scan.folder.join(format!("color/{number}.{ending}"));
        PICTURES.iter().map(path).find(|picture| picture.is_file())
    }

    /// Columns and rows of the pictures that the intrinsics refer to, if the scan's constants define them.
    fn color_size(&self) -> Result<Option<[u32; 2]>, Error> {
        let Some(constants) = &self.constants else { return Ok(None) };
        let mut size = [0; 2];
        for (extent, key) in size.iter_mut().zip(["colorWidth", "colorHeight"]) {
            let Some(value) = constants.number(key)? else { return Ok(None) };
            if value.fract() != 0.0 || !(1.0..=f64::from(MAX_EDGE)).contains(&value) {
                let expected = format!("a whole number from 1 to {MAX_EDGE}");
                return Err(Error::text(&constants.path, key, expected, value.to_string()));
            }
            *extent = value as u32;
        }
        Ok(Some(size))
    }

    /// The file with the intrinsics, the focal lengths and the principal point, in pixels of the size that they refer
    /// to.
    fn intrinsics(&self) -> Result<(PathBuf, [f64; 2], [f64; 2]), Error> {
        let path = self.scan.folder.join("intrinsic/intrinsic_color.txt");
        let (path, [fx, fy, cx, cy]) = if path.is_file() {
            let rows = read_matrix(&path)?;
            if rows[0][1] != 0.0 || rows[1][0] != 0.0 {
                return Err(Error::text(&path, "the matrix", "without skew", format!("{rows:?}")));
            }
            (path, [rows[0][0], rows[1][1], rows[0][2], rows[1][2]])
        } else {
            let mut values = [0.0; 4];
            for (value, key) in values.iter_mut().zip(["fx_color", "fy_color", "mx_color", "my_color"]) {
                let found = self.constants.as_ref().map_or(Ok(None), |constants| constants.number(key))?;
                let expected = format!("in this file, or under {key} in {}.txt", self.scan.name);
                *value = found.ok_or_else(|| Error::text(&path, "the intrinsics", expected, "neither"))?;
            }
            (self.scan.folder.join(format!("{}.txt", self.scan.name)), values)
        };
        for (what, value) in [("the focal length along columns", fx), ("the focal length along rows", fy)] {
            if !value.is_normal() || value < 0.0 {
                return Err(Error::text(&path, what, "a positive number of pixels", value.to_string()));
            }
        }
        for (what, value) in [("the principal point's column", cx), ("the principal point's row", cy)] {
            if value.is_nan() || value.abs() > 16.0 * f64::from(MAX_EDGE) {
                let expected = "within 262144 pixels of the picture's corner";
                return Err(Error::text(&path, what, expected, value.to_string()));
            }
        }
        Ok((path, [fx, fy], [cx, cy]))
    }

    /// The cameras of pictures of `size` (columns and rows), made `downscale` times smaller.
    fn cameras(&self, size: [u32; 2], downscale: u32) -> Result<Vec<Camera>, Error> {
        if downscale == 0 || size.iter().any(|&extent| extent < downscale) {
            return Err(Error::Downscale { path: self.scan.folder.clone(), factor: downscale, size });
        }
        let (path, mut focal, mut principal) = self.intrinsics()?;
        let declared = self.color_size()?;
        for axis in 0..2 {
            let extent = f64::from(size[axis]);
            if let Some(declared) = declared {
                // Pictures may have been downscaled after the export without their intrinsics.
                let scale = extent / f64::from(declared[axis]);
                focal[axis] *= scale;
                principal[axis] *= scale;
            } else if !(0.25 * extent..=0.75 * extent).contains(&principal[axis]) {
                let place = ["the principal point's column", "the principal point's row"][axis];
                let name = &self.scan.name;
                let expected =
                    format!("in the middle half of {extent} pixels unless {name}.txt has colorWidth and colorHeight");
                return Err(Error::text(&path, place, expected, principal[axis].to_string()));
            }
        }
        let camera = |posed: &Posed| {
            let Posed { world_from_camera, position, .. } = *posed;
            let full = Camera { width: size[0], height: size[1], focal, principal, world_from_camera, position };
            full.downscaled(downscale)
        };
        Ok(self.posed.iter().map(camera).collect())
    }
}

/// The numbers N of the files `N.ENDING` in `folder`; other files are not frames.
fn numbers(folder: &Path, endings: &[&str]) -> Result<BTreeSet<u32>, Error> {
    let mut numbers = BTreeSet::new();
    for entry in fs::read_dir(folder).map_err(Error::read(folder))? {
        let file = entry.map_err(Error::read(folder))?.file_name();
        let Some((stem, ending)) = file.to_str().and_then(|file| file.rsplit_once('.')) else { continue };
        // Only the canonical form: neither 007 nor +7.
        let number = stem.parse().ok().filter(|number: &u32| number.to_string() == stem);
        numbers.extend(number.filter(|_| endings.contains(&ending)));
    }
    Ok(numbers)
}
