//! The Blender layout of NeRF-synthetic: `transforms_{train,val,test}.json` beside folders of PNG (or JPEG) pictures.
//!
//! Poses are row-major `world_from_camera` matrices in [`Camera`]'s axes. The focal length comes from `fl_x` and `fl_y`
//! (pixels) or from `camera_angle_x` (radians across the picture); the principal point from `cx` and `cy`, or is the
//! middle of the picture.
//!
//! Keys that change the meaning of pictures and are not supported are rejected by name: lens distortion, other camera
//! models, masks, and intrinsics within a frame. A distortion of 0 is accepted. All other unknown keys are ignored,
//! such as `aabb_scale`, `scale`, `offset`, and `sharpness` or `rotation` within a frame.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use serde::Deserialize;
use serde::de::IgnoredAny;

use super::photographs::{self, Taken};
use super::picture::{self, MAX_EDGE};
use super::{Dataset, Error, LoadOptions, NamedCamera};
use crate::geometry::{Camera, NotRigid, rigid};

/// A `file_path` that ends in one of these is complete; any other lacks `.png`.
const EXTENSIONS: [&str; 3] = ["png", "jpg", "jpeg"];

/// The JSON file, as far as it is read.
#[derive(Deserialize)]
struct Transforms {
    camera_angle_x: Option<f64>,
    fl_x: Option<f64>,
    fl_y: Option<f64>,
    cx: Option<f64>,
    cy: Option<f64>,
    w: Option<f64>,
    h: Option<f64>,
    #[serde(default)]
    k1: f64,
    #[serde(default)]
    k2: f64,
    #[serde(default)]
    k3: f64,
    #[serde(default)]
    k4: f64,
    #[serde(default)]
    p1: f64,
    #[serde(default)]
    p2: f64,
    camera_model: Option<String>,
    is_fisheye: Option<bool>,
    mask_path: Option<IgnoredAny>,
    frames: Vec<Frame>,
}

#[derive(Deserialize)]
struct Frame {
    file_path: String,
    /// Rows of `world_from_camera`.
    transform_matrix: [[f64; 4]; 4],
    /// All other keys.
    #[serde(flatten)]
    others: BTreeMap<String, IgnoredAny>,
}

/// Keys of intrinsics, which only the top level may have.
const INTRINSICS: [&str; 15] = [
    "camera_angle_x",
    "camera_angle_y",
    "fl_x",
    "fl_y",
    "cx",
    "cy",
    "w",
    "h",
    "k1",
    "k2",
    "k3",
    "k4",
    "p1",
    "p2",
    "camera_model",
];
/// Camera models that are pinhole cameras if their distortion is 0.
const CAMERA_MODELS: [&str; 4] = ["PINHOLE", "SIMPLE_PINHOLE", "OPENCV", "PERSPECTIVE"];

/// The split `split` (as in `train`) of the dataset in `folder`: the views that `options` select, in the order of
/// `frames`. Other views' pictures are not read.
///
/// # Errors
///
/// If the dataset cannot be read or is invalid: all of [`Error`] but those of writing. Of several invalid pictures, the
/// first in order is reported.
pub fn load_blender(folder: &Path, split: &str, options: &LoadOptions) -> Result<Dataset, Error> {
    let json = folder.join(format!("transforms_{split}.json"));
    check_split(folder, &json)?;
    let transforms = Transforms::read(&json)?;
    let pictures = transforms.pictures(&json)?;
    let frames = photographs::chosen(&json, pictures.len(), options)?;
    if let Some(&frame) = frames.iter().find(|&&frame| !pictures[frame].1.is_file()) {
        return Err(Error::MissingPicture { path: json, frame, picture: pictures[frame].1.clone() });
    }
    let (size, like) = match transforms.size(&json)? {
        Some(size) => (size, json.as_path()),
        None => {
            let first = pictures[frames[0]].1.as_path();
            (picture::size(first)?, first)
        }
    };
    let cameras = transforms.cameras(&json, size, options.downscale)?;
    let taken =
        |&frame: &usize| Taken { name: &pictures[frame].0, picture: &pictures[frame].1, camera: cameras[frame] };
    let taken: Vec<_> = frames.iter().map(taken).collect();
    let views = photographs::load(&json, &taken, size, like, options.downscale)?;
    Ok(Dataset { name: photographs::name_of(folder), views, lost: 0 })
}

/// The cameras of one JSON file in the order of `frames`, for rendering; no picture is decoded.
///
/// The size (columns and rows, before downscaling) is that of the keys `w` and `h`, else of the first picture that
/// exists, else `size`.
///
/// # Errors
///
/// If [`load_blender`] fails, except for errors of pictures; or with [`Error::UnknownSize`].
pub fn load_blender_cameras(json: &Path, size: Option<[u32; 2]>, downscale: u32) -> Result<Vec<NamedCamera>, Error> {
    let transforms = Transforms::read(json)?;
    let pictures = transforms.pictures(json)?;
    let size = match (transforms.size(json)?, pictures.iter().find(|(_, picture)| picture.is_file()), size) {
        (Some(size), _, _) => size,
        (None, Some((_, picture)), _) => picture::size(picture)?,
        (None, None, Some(size)) => size,
        (None, None, None) => return Err(Error::UnknownSize { path: json.to_path_buf() }),
    };
    let cameras = transforms.cameras(json, size, downscale)?;
    Ok(pictures.into_iter().zip(cameras).map(|((name, _), camera)| NamedCamera { name, camera }).collect())
}

impl Transforms {
    /// Reads a file with at least one frame.
    fn read(json: &Path) -> Result<Self, Error> {
        let bytes = picture::read_file(json)?;
        let transforms: Self =
            serde_json::from_slice(&bytes).map_err(|source| Error::Json { path: json.to_path_buf(), source })?;
        if transforms.frames.is_empty() {
            return Err(Error::NoFrames { path: json.to_path_buf() });
        }
        transforms.check_supported(json)?;
        Ok(transforms)
    }

    /// Rejects keys that change the meaning of pictures and are not supported.
    fn check_supported(&self, json: &Path) -> Result<(), Error> {
        let refuse = |place: String, reason| Err(Error::Unsupported { path: json.to_path_buf(), place, reason });
        if let Some(model) = &self.camera_model
            && !CAMERA_MODELS.iter().any(|known| known.eq_ignore_ascii_case(model))
        {
            return refuse(
                format!("camera_model {model:?}"),
                "only pinhole cameras are supported; undistort the pictures first",
            );
        }
        if self.is_fisheye == Some(true) {
            return refuse("is_fisheye".into(), "only pinhole cameras are supported; undistort the pictures first");
        }
        let distortion =
            [("k1", self.k1), ("k2", self.k2), ("k3", self.k3), ("k4", self.k4), ("p1", self.p1), ("p2", self.p2)];
        if let Some((key, value)) = distortion.into_iter().find(|(_, value)| *value != 0.0) {
            return refuse(format!("lens distortion ({key} = {value:e})"), "undistort the pictures first");
        }
        if self.mask_path.is_some() {
            return refuse("mask_path".into(), "masks are not read; use transparent pictures");
        }
        for (n, frame) in self.frames.iter().enumerate() {
            if let Some(key) = INTRINSICS.into_iter().find(|key| frame.others.contains_key(*key)) {
                return refuse(format!("frame {n}: {key}"), "all frames share the intrinsics at the top of the file");
            }
            if frame.others.contains_key("mask_path") {
                return refuse(format!("frame {n}: mask_path"), "masks are not read; use transparent pictures");
            }
        }
        Ok(())
    }

    /// Name and path of each frame's picture.
    fn pictures(&self, json: &Path) -> Result<Vec<(String, PathBuf)>, Error> {
        let folder = json.parent().unwrap_or(Path::new(""));
        let picture = |(frame, Frame { file_path, .. }): (usize, &Frame)| {
            // Blender on Windows writes backslashes.
            let mut path = folder.join(file_path.replace('\\', "/"));
            let complete =
                path.extension().is_some_and(|e| EXTENSIONS.iter().any(|known| e.eq_ignore_ascii_case(known)));
            if !complete && path.file_name().is_some() {
                path.as_mut_os_string().push(".png");
            }
            match path.file_stem().and_then(|stem| stem.to_str()) {
                Some(name) if !file_path.is_empty() && !file_path.ends_with(['/', '\\']) => Ok((name.to_owned(), path)),
                _ => Err(Error::FilePath { path: json.to_path_buf(), frame, found: file_path.clone() }),
            }
        };
        self.frames.iter().enumerate().map(picture).collect()
    }

    /// Columns and rows by the keys `w` and `h`, if both are present.
    fn size(&self, json: &Path) -> Result<Option<[u32; 2]>, Error> {
        let (Some(w), Some(h)) = (self.w, self.h) else { return Ok(None) };
        for (key, value) in [("w", w), ("h", h)] {
            if value.fract() != 0.0 || !(1.0..=f64::from(MAX_EDGE)).contains(&value) {
                return Err(intrinsics(json, key, "a whole number from 1 to 16384", value));
            }
        }
        Ok(Some([w as u32, h as u32]))
    }

    /// The cameras of pictures of `size` (columns and rows), made `downscale` times smaller.
    fn cameras(&self, json: &Path, size: [u32; 2], downscale: u32) -> Result<Vec<Camera>, Error> {
        if downscale == 0 || size.iter().any(|&extent| extent < downscale) {
            return Err(Error::Downscale { path: json.to_path_buf(), factor: downscale, size });
        }
        let focal = self.focal(json, size[0])?;
        let principal = [self.cx.unwrap_or(0.5 * f64::from(size[0])), self.cy.unwrap_or(0.5 * f64::from(size[1]))];
        for (key, value) in [("cx", principal[0]), ("cy", principal[1])] {
            if !(0.0..=16.0 * f64::from(MAX_EDGE)).contains(&value.abs()) {
                return Err(intrinsics(json, key, "within 262144 pixels of the picture's corner", value));
            }
        }
        let camera = |(frame, Frame { transform_matrix, .. }): (usize, &Frame)| {
            let (world_from_camera, position) = rigid(transform_matrix).map_err(|NotRigid { expected, found }| {
                Error::Pose { path: json.to_path_buf(), frame, expected, found }
            })?;
            let full = Camera { width: size[0], height: size[1], focal, principal, world_from_camera, position };
            Ok(full.downscaled(downscale))
        };
        self.frames.iter().enumerate().map(camera).collect()
    }

    /// Focal lengths in pixels of a picture of `width` columns.
    fn focal(&self, json: &Path, width: u32) -> Result<[f64; 2], Error> {
        if let Some(angle) = self.camera_angle_x
            && !(angle > 0.0 && angle < std::f64::consts::PI)
        {
            return Err(intrinsics(json, "camera_angle_x", "an angle between 0 and π", angle));
        }
        for (key, value) in [("fl_x", self.fl_x), ("fl_y", self.fl_y)] {
            if let Some(value) = value.filter(|v| !v.is_normal() || *v < 0.0) {
                return Err(intrinsics(json, key, "a positive number of pixels", value));
            }
        }
        let x = match (self.fl_x, self.camera_angle_x) {
            (Some(focal), _) => focal,
            (None, Some(angle)) => Camera::focal_of_angle(width, angle),
            (None, None) => return Err(intrinsics(json, "camera_angle_x", "present unless fl_x is", "neither")),
        };
        Ok([x, self.fl_y.unwrap_or(x)])
    }
}

/// Checks that `json` exists. The error lists the splits of `folder`, if it has any.
fn check_split(folder: &Path, json: &Path) -> Result<(), Error> {
    if json.exists() {
        return Ok(());
    }
    let entries = fs::read_dir(folder).map_err(Error::read(folder))?;
    let names = entries.flatten().filter_map(|entry| entry.file_name().into_string().ok());
    let split = |name: String| Some(name.strip_prefix("transforms_")?.strip_suffix(".json")?.to_owned());
    let mut splits: Vec<String> = names.filter_map(split).collect();
    splits.sort();
    if splits.is_empty() { Ok(()) } else { Err(Error::MissingSplit { path: json.to_path_buf(), splits }) }
}

fn intrinsics(json: &Path, key: &'static str, expected: &'static str, found: impl ToString) -> Error {
    Error::Intrinsics { path: json.to_path_buf(), key, expected, found: found.to_string() }
}
