//! `transforms.json`: Blender's layout of NeRF-synthetic (`transforms_train.json`, `_val`, `_test`), and that of
//! Instant-NGP and nerfstudio (one file, split by `train_filenames` and its kin or not at all).
//!
//! Poses are row-major `world_from_camera` matrices in OpenGL's axes. Every key of the intrinsics may stand at the top or in
//! a frame, which overrides it: `fl_x`, `fl_y` (pixels) or `camera_angle_x`, `camera_angle_y` (radians across the picture);
//! `cx`, `cy`, or the picture's middle; `w`, `h`; `camera_model` or `is_fisheye`; `k1` to `k6`, `p1`, `p2` as in OpenCV.
//! `mask_path` names a mask, at the top for all frames. `ply_file_path` names points, `depth_file_path` a depth map;
//! `aabb_scale`, `scale` and `offset` are the box of Instant-NGP's scene. All other keys are ignored; `applied_transform`
//! is, as poses contain it.

use std::collections::BTreeSet;
use std::fmt;
use std::fs;
use std::path::{Path, PathBuf};

use glam::DVec3;
use serde::de::{Error as _, SeqAccess, Visitor};
use serde::{Deserialize, Deserializer};

use super::capture::Capture;
use super::depth::DepthMap;
use super::shot::{self, Focal, Intrinsics, MODELS, Shot, Split};
use super::{Error, files};
use strivec_format::geometry::{Aabb, Distortion, Lens, NotRigid, Projection, rigid};

/// The unit of depth maps without the key `integer_depth_scale`, as in nerfstudio.
const MILLIMETERS: f64 = 1e-3;
/// Instant-NGP's scale of scenes without the key `scale`.
const NGP_SCALE: f64 = 0.33;
/// The place of the middle of Instant-NGP's scene.
const NGP_CENTER: DVec3 = DVec3::splat(0.5);

/// The most frames of a file, each of some kilobytes in memory until its photograph is known.
const MAX_FRAMES: usize = 1 << 18;

/// The JSON file, as far as it is read.
#[derive(Deserialize)]
struct Transforms {
    /// Read from the file by itself: serde would keep all keys that it does not know in memory.
    #[serde(skip)]
    camera: CameraKeys,
    #[serde(deserialize_with = "frames")]
    frames: Vec<FrameEntry>,
    mask_path: Option<String>,
    ply_file_path: Option<String>,
    integer_depth_scale: Option<f64>,
    aabb_scale: Option<f64>,
    scale: Option<f64>,
    offset: Option<[f64; 3]>,
    train_filenames: Option<BTreeSet<String>>,
    val_filenames: Option<BTreeSet<String>>,
    test_filenames: Option<BTreeSet<String>>,
}

#[derive(Deserialize)]
struct FrameEntry {
    file_path: String,
    /// Rows of `world_from_camera`; the last may be missing.
    transform_matrix: Vec<[f64; 4]>,
    mask_path: Option<String>,
    #[serde(alias = "depth_path")]
    depth_file_path: Option<String>,
    #[serde(flatten)]
    camera: CameraKeys,
}

/// The keys of intrinsics.
#[derive(Clone, Default, Deserialize)]
struct CameraKeys {
    camera_model: Option<String>,
    is_fisheye: Option<bool>,
    camera_angle_x: Option<f64>,
    camera_angle_y: Option<f64>,
    fl_x: Option<f64>,
    fl_y: Option<f64>,
    cx: Option<f64>,
    cy: Option<f64>,
    w: Option<f64>,
    h: Option<f64>,
    k1: Option<f64>,
    k2: Option<f64>,
    k3: Option<f64>,
    k4: Option<f64>,
    k5: Option<f64>,
    k6: Option<f64>,
    p1: Option<f64>,
    p2: Option<f64>,
}

/// The list of frames, of at most [`MAX_FRAMES`].
fn frames<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<FrameEntry>, D::Error> {
    struct Frames;
    impl<'de> Visitor<'de> for Frames {
        type Value = Vec<FrameEntry>;

        fn expecting(&self, text: &mut fmt::Formatter<'_>) -> fmt::Result {
            write!(text, "a list of at most {MAX_FRAMES} frames")
        }

        fn visit_seq<A: SeqAccess<'de>>(self, mut entries: A) -> Result<Self::Value, A::Error> {
            let mut frames = Vec::new();
            while let Some(frame) = entries.next_element()? {
                if frames.len() == MAX_FRAMES {
                    return Err(A::Error::custom(format_args!("more than {MAX_FRAMES} frames")));
                }
                frames.push(frame);
            }
            Ok(frames)
        }
    }
    deserializer.deserialize_seq(Frames)
}

/// The photographs of `json`. `split` is that of all of them, if the file's name contains one. Pictures that were made
/// `downscale` times smaller beforehand, as nerfstudio's in `images_4`, are used if they are there.
pub(super) fn read(json: &Path, split: Option<Split>, downscale: u32) -> Result<Capture, Error> {
    let transforms = Transforms::read(json)?;
    let folder = json.parent().unwrap_or(Path::new(""));
    let shots = (transforms.frames.iter().enumerate())
        .map(|(n, frame)| transforms.shot(json, folder, n, frame, split, downscale))
        .collect::<Result<Vec<_>, _>>()?;
    let ply = transforms.ply_file_path.as_ref().map(|path| inside_folder(json, folder, "ply_file_path", path));
    let ply = ply.transpose()?.filter(|path| path.is_file());
    // Its depth maps are read as a file of points.
    let has_depth = || transforms.frames.iter().any(|frame| frame.depth_file_path.is_some());
    let points = ply.or_else(|| has_depth().then(|| json.to_path_buf()));
    let depth_maps = transforms.depth_maps(json)?;
    Ok(Capture { bounds: transforms.bounds(json)?, points, depth_maps, ..Capture::new(json, shots) })
}

/// The depth maps that the `transforms.json` file `json` names and that exist.
///
/// # Errors
///
/// If the JSON file cannot be read or breaks a rule of its layout.
pub fn depth_maps(json: &Path) -> Result<Vec<DepthMap>, Error> {
    Transforms::read(json)?.depth_maps(json)
}

impl Transforms {
    /// The depth maps that exist.
    fn depth_maps(&self, json: &Path) -> Result<Vec<DepthMap>, Error> {
        let unit = self.integer_depth_scale.unwrap_or(MILLIMETERS);
        if !(unit.is_normal() && unit > 0.0) {
            return Err(Error::text(json, "integer_depth_scale", "a positive number", unit.to_string()));
        }
        let folder = json.parent().unwrap_or(Path::new(""));
        let mut maps = Vec::new();
        for (n, frame) in self.frames.iter().enumerate() {
            let Some(path) = &frame.depth_file_path else { continue };
            let path = inside_folder(json, folder, &format!("frame {n}: depth_file_path"), path)?;
            if path.is_file() {
                maps.push(DepthMap { path, shot: self.shot(json, folder, n, frame, None, 1)?, unit });
            }
        }
        Ok(maps)
    }

    /// The file `json`, which has frames.
    fn read(json: &Path) -> Result<Self, Error> {
        let bytes = files::read(json)?;
        let failed = |source| Error::Json { path: json.to_path_buf(), source };
        let mut transforms: Self = serde_json::from_slice(&bytes).map_err(failed)?;
        transforms.camera = serde_json::from_slice(&bytes).map_err(failed)?;
        if transforms.frames.is_empty() {
            return Err(Error::NoFrames { path: json.to_path_buf(), lost: 0 });
        }
        Ok(transforms)
    }

    fn shot(
        &self,
        json: &Path,
        folder: &Path,
        n: usize,
        frame: &FrameEntry,
        split: Option<Split>,
        downscale: u32,
    ) -> Result<Shot, Error> {
        let (name, picture, reduced) = picture_of(json, folder, n, &frame.file_path, downscale)?;
        let mask = frame.mask_path.as_ref().or(self.mask_path.as_ref());
        let mask = mask.map(|mask| inside_folder(json, folder, "mask_path", mask)).transpose()?;
        let intrinsics = frame.camera.or(&self.camera).intrinsics(json, &format!("frame {n}"))?;
        let mut rows = [[0.0, 0.0, 0.0, 1.0]; 4];
        let place = || format!("frame {n}: transform_matrix");
        if !(3..=4).contains(&frame.transform_matrix.len()) {
            let found = format!("{} of them", frame.transform_matrix.len());
            return Err(Error::text(json, place(), "3 or 4 rows", found));
        }
        rows.iter_mut().zip(&frame.transform_matrix).for_each(|(row, found)| *row = *found);
        let (world_from_camera, position) =
            rigid(&rows).map_err(|NotRigid { expected, found }| Error::text(json, place(), expected, found))?;
        let split = split.or_else(|| self.split_of(&frame.file_path));
        Ok(Shot { name, picture, reduced, mask, intrinsics, world_from_camera, position, split })
    }

    fn split_of(&self, file_path: &str) -> Option<Split> {
        let lists = [
            (&self.train_filenames, Split::Train),
            (&self.val_filenames, Split::Validation),
            (&self.test_filenames, Split::Test),
        ];
        let split = lists.iter().find(|(names, _)| names.as_ref().is_some_and(|names| names.contains(file_path)));
        split.map(|(_, split)| *split)
    }

    /// The box of Instant-NGP's scene, if the file has `aabb_scale`.
    fn bounds(&self, json: &Path) -> Result<Option<Aabb>, Error> {
        let Some(edge) = self.aabb_scale else { return Ok(None) };
        let (scale, offset) = (self.scale.unwrap_or(NGP_SCALE), self.offset.map_or(NGP_CENTER, DVec3::from));
        for (key, value) in [("aabb_scale", edge), ("scale", scale)] {
            if !(value.is_normal() && value > 0.0) {
                return Err(Error::text(json, key, "a positive number", value.to_string()));
            }
        }
        if !offset.is_finite() {
            return Err(Error::text(json, "offset", "finite numbers", offset.to_string()));
        }
        Ok(Some(Aabb::around((NGP_CENTER - offset) / scale, DVec3::splat(0.5 * edge / scale))))
    }
}

/// Name and path of the picture of frame `n`, and how many times smaller it is than the photograph.
fn picture_of(
    json: &Path,
    folder: &Path,
    n: usize,
    file_path: &str,
    downscale: u32,
) -> Result<(String, PathBuf, u32), Error> {
    let refused =
        || Error::text(json, format!("frame {n}: file_path"), "the path of a file", format_args!("{file_path:?}"));
    if file_path.ends_with(['/', '\\']) {
        return Err(refused());
    }
    let relative = files::inside(file_path).ok_or_else(refused)?;
    let name = files::without_ending(&relative);
    let name = name.file_name().and_then(|name| name.to_str()).ok_or_else(refused)?.to_owned();
    let (parent, reduced) = match relative.parent().filter(|parent| !parent.as_os_str().is_empty()) {
        Some(parent) => files::reduced(&folder.join(parent), downscale),
        None => (folder.to_path_buf(), 1),
    };
    let picture = parent.join(relative.file_name().ok_or_else(refused)?);
    let is_complete = files::is_picture(&picture) || picture.is_file();
    Ok((name, if is_complete { picture } else { files::with_ending(&picture) }, reduced))
}

/// The path `found` of `key` in `folder`.
fn inside_folder(json: &Path, folder: &Path, key: &str, found: &str) -> Result<PathBuf, Error> {
    let relative = files::inside(found);
    let expected = "the path of a file in the dataset's folder";
    relative.map(|path| folder.join(path)).ok_or_else(|| Error::text(json, key, expected, format!("{found:?}")))
}

impl CameraKeys {
    /// These keys, and those of `common` that are missing. The keys of a focal length, and those of a lens, stay together.
    fn or(&self, common: &Self) -> Self {
        let has_focal = self.fl_x.is_some() || self.camera_angle_x.is_some();
        let focal = if has_focal { self } else { common };
        let coefficients = [self.k1, self.k2, self.k3, self.k4, self.k5, self.k6, self.p1, self.p2];
        let lens = if coefficients.iter().any(Option::is_some) { self } else { common };
        Self {
            camera_model: self.camera_model.clone().or_else(|| common.camera_model.clone()),
            is_fisheye: self.is_fisheye.or(common.is_fisheye),
            cx: self.cx.or(common.cx),
            cy: self.cy.or(common.cy),
            w: self.w.or(common.w),
            h: self.h.or(common.h),
            camera_angle_x: focal.camera_angle_x,
            camera_angle_y: focal.camera_angle_y,
            fl_x: focal.fl_x,
            fl_y: focal.fl_y,
            ..lens.clone()
        }
    }

    fn intrinsics(&self, json: &Path, place: &str) -> Result<Intrinsics, Error> {
        let focal = match (self.fl_x, self.camera_angle_x) {
            (Some(x), _) => Focal::Pixels([x, self.fl_y.unwrap_or(x)]),
            (None, Some(x)) => Focal::Angles(x, self.camera_angle_y),
            (None, None) if self.is_equirectangular() => Focal::Panorama,
            (None, None) => {
                let expected = "this key or fl_x, at the top or in the frame";
                return Err(Error::text(json, format!("{place}: camera_angle_x"), expected, "neither"));
            }
        };
        let size = match (self.w, self.h) {
            (Some(w), Some(h)) => Some([extent(json, place, "w", w)?, extent(json, place, "h", h)?]),
            _ => None,
        };
        let principal = [self.cx, self.cy];
        let intrinsics = Intrinsics { size, focal, principal, lens: self.lens(json, place)? };
        intrinsics.check(json, place)?;
        Ok(intrinsics)
    }

    fn is_equirectangular(&self) -> bool {
        self.camera_model.as_ref().is_some_and(|model| model.eq_ignore_ascii_case("EQUIRECTANGULAR"))
    }

    /// The lens. Files of OpenCV's pinhole and fisheye models have any of the keys of the whole model.
    fn lens(&self, json: &Path, place: &str) -> Result<Lens, Error> {
        let [k1, k2, k3, k4, k5, k6] = [self.k1, self.k2, self.k3, self.k4, self.k5, self.k6].map(|k| k.unwrap_or(0.0));
        let tangential = [self.p1, self.p2].map(|p| p.unwrap_or(0.0));
        let model = self.camera_model.as_ref().map(|model| model.to_uppercase());
        let is_fisheye = self.is_fisheye == Some(true) || model.as_ref().is_some_and(|m| m.contains("FISHEYE"));
        let known = match model.as_deref() {
            None | Some("PERSPECTIVE") => true,
            Some("EQUIRECTANGULAR") => return Ok(Lens::PANORAMA),
            // No key has its thin prism coefficients.
            Some("THIN_PRISM_FISHEYE") => false,
            Some(name) => MODELS.split([' ', ',']).any(|known| known == name),
        };
        let distortion = if is_fisheye {
            Distortion::new([k1, k2, k3, k4], [0.0; 3], tangential, [0.0; 2])
        } else {
            Distortion::new([k1, k2, k3, 0.0], [k4, k5, k6], tangential, [0.0; 2])
        };
        let projection = if is_fisheye { Projection::Fisheye } else { Projection::Perspective };
        match distortion.filter(|_| known) {
            Some(distortion) => Ok(Lens { projection, distortion }),
            None => {
                let name = model.as_deref().unwrap_or("no name");
                let found = format!("{name:?} with k {:?}, p {tangential:?}", [k1, k2, k3, k4, k5, k6]);
                let expected = format!("{} with finite coefficients", MODELS.replace(", THIN_PRISM_FISHEYE or", " or"));
                Err(Error::text(json, format!("{place}: camera_model"), expected, found))
            }
        }
    }
}

fn extent(json: &Path, place: &str, key: &str, value: f64) -> Result<u32, Error> {
    shot::extent(value).ok_or_else(|| Error::text(json, format!("{place}: {key}"), shot::EXTENT, value.to_string()))
}

/// The splits of the files `transforms_*.json` in `folder`, ascending.
pub(super) fn splits(folder: &Path) -> Result<Vec<String>, Error> {
    let entries = fs::read_dir(folder).map_err(Error::read(folder))?;
    let names = entries.flatten().filter_map(|entry| entry.file_name().into_string().ok());
    let split = |name: String| Some(name.strip_prefix("transforms_")?.strip_suffix(".json")?.to_owned());
    let mut splits: Vec<String> = names.filter_map(split).collect();
    splits.sort();
    Ok(splits)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<Transforms, Error> {
        let folder = tempfile::tempdir().unwrap();
        let json = folder.path().join("transforms.json");
        fs::write(&json, text).unwrap();
        Transforms::read(&json)
    }

    #[test]
    fn keys_at_the_top_are_read_beside_unknown_ones() {
        let frame = r#"{"file_path": "a", "transform_matrix": [], "k1": 0.5, "more": [1]}"#;
        let transforms = read(&format!(r#"{{"w": 8, "other": [[], {{}}], "frames": [{frame}], "fl_x": 2}}"#)).unwrap();
        assert_eq!((transforms.camera.w, transforms.camera.fl_x), (Some(8.0), Some(2.0)));
        assert_eq!((transforms.frames.len(), transforms.frames[0].camera.k1), (1, Some(0.5)));
        assert!(matches!(read(r#"{"frames": [], "w": "8"}"#), Err(Error::Json { .. })));
    }

    #[test]
    fn frames_are_limited_before_they_take_memory() {
        let frame = r#"{"file_path":"a","transform_matrix":[]}"#;
        let text = format!(r#"{{"frames":[{}{frame}]}}"#, format!("{frame},").repeat(MAX_FRAMES));
        let error = read(&text).err().unwrap().to_string();
        assert!(error.contains("more than 262144 frames"), "{error}");
    }
}
