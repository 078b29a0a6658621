//! `transforms.json`: Blender's layout of NeRF-synthetic (`transforms_train.json`, `_val`, `_test`), and that of
//! Instant-NGP and nerfstudio (one file, split by `train_filenames` and its kin or not at all).
//!
//! Poses are row-major `world_from_camera` matrices in OpenGL's axes. Every key of the intrinsics may stand at the top or in
//! a frame, which overrides it: `fl_x`, `fl_y` (pixels) or `camera_angle_x`, `camera_angle_y` (radians across the picture);
//! `cx`, `cy`, or the picture's middle; `w`, `h`; `camera_model` or `is_fisheye`; `k1` to `k6`, `p1`, `p2` as in OpenCV, but that
//! `k4` of a perspective camera without divisor is the coefficient of r⁸, as in nerfstudio.
//! `mask_path` names a mask, at the top for all frames. `ply_file_path` names points, `depth_file_path` a depth map;
//! `aabb_scale`, `scale` and `offset` are the box of Instant-NGP's scene. Keys that bend rays in a way that is not supported are
//! refused; all others are told of but `applied_transform`, as poses contain it.
//!
//! Files of Python have NaN and infinities, which JSON has not: a few poses with them are left out. Paths of another machine
//! are taken by their ends, if these are in the folder.

use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::fmt;
use std::fs;
use std::path::{Path, PathBuf};

use glam::DVec3;
use serde::de::{Error as _, SeqAccess, Visitor};
use serde::{Deserialize, Deserializer};
use serde_json::value::RawValue;

use super::capture::Capture;
use super::depth::DepthMap;
use super::inventory_entry::{Standing, relative_to};
use super::json_number::{Number, with_quoted_numbers};
use super::names::{NamesOfFolders, normal};
use super::other_keys::{OtherKeys, RefusedKey};
use super::records::BadRecords;
use super::shot::{self, Focal, Intrinsics, MODELS, Shot, SmallerPicture, Split};
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
    #[serde(skip)]
    keys: CommonKeys,
    #[serde(deserialize_with = "frames")]
    frames: Vec<FrameEntry>,
    mask_path: Option<String>,
    ply_file_path: Option<String>,
    integer_depth_scale: Option<Number>,
    aabb_scale: Option<Number>,
    scale: Option<Number>,
    offset: Option<[Number; 3]>,
    train_filenames: Option<Vec<String>>,
    val_filenames: Option<Vec<String>>,
    test_filenames: Option<Vec<String>>,
}

#[derive(Deserialize)]
struct FrameEntry {
    #[serde(skip)]
    keys: CommonKeys,
    file_path: String,
    /// Rows of `world_from_camera`; the last may be missing.
    transform_matrix: Vec<[Number; 4]>,
    mask_path: Option<String>,
    #[serde(alias = "depth_path")]
    depth_file_path: Option<String>,
}

/// The keys that may stand at the top and in a frame. They are read by themselves: serde would keep all keys that it does not
/// know in memory.
#[derive(Default)]
struct CommonKeys {
    camera: CameraKeys,
    others: OtherKeys,
}

impl CommonKeys {
    /// The keys of the object `text`.
    fn read(text: &[u8]) -> serde_json::Result<Self> {
        Ok(Self { camera: serde_json::from_slice(text)?, others: serde_json::from_slice(text)? })
    }
}

/// The keys of intrinsics.
#[derive(Clone, Default, Deserialize)]
struct CameraKeys {
    camera_model: Option<String>,
    is_fisheye: Option<bool>,
    camera_angle_x: Option<Number>,
    camera_angle_y: Option<Number>,
    fl_x: Option<Number>,
    fl_y: Option<Number>,
    cx: Option<Number>,
    cy: Option<Number>,
    w: Option<Number>,
    h: Option<Number>,
    k1: Option<Number>,
    k2: Option<Number>,
    k3: Option<Number>,
    k4: Option<Number>,
    k5: Option<Number>,
    k6: Option<Number>,
    p1: Option<Number>,
    p2: Option<Number>,
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
            while let Some(text) = entries.next_element::<&RawValue>()? {
                if frames.len() == MAX_FRAMES {
                    return Err(A::Error::custom(format_args!("more than {MAX_FRAMES} frames")));
                }
                let in_frame = |error| A::Error::custom(format_args!("frame {}: {error}", frames.len()));
                let mut frame: FrameEntry = serde_json::from_str(text.get()).map_err(in_frame)?;
                frame.keys = CommonKeys::read(text.get().as_bytes()).map_err(in_frame)?;
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
    transforms.check_keys(json)?;
    let folder = json.parent().unwrap_or(Path::new(""));
    let mut reader = TransformsReader { json, folder, downscale, names: NamesOfFolders::default(), moved: Vec::new() };
    let listing = relative_to(folder, json);
    let mut capture = Capture::new(json, Vec::new());
    let splits = match split {
        Some(_) => vec![split; transforms.frames.len()],
        None => transforms.splits(json, &listing, &mut capture)?,
    };
    let unit = transforms.depth_unit(json)?;
    let (mut bad, mut absent) = (BadRecords::default(), AbsentFiles::default());
    for ((n, frame), split) in transforms.frames.iter().enumerate().zip(splits) {
        let Some(shot) = reader.shot(&transforms, n, frame, split, &mut bad)? else { continue };
        if let Some(path) = &frame.depth_file_path {
            let path = reader.file(&format!("frame {n}: depth_file_path"), path)?;
            if path.is_file() {
                capture.depth_maps.push(DepthMap { path, shot: Shot { smaller: None, ..shot.clone() }, unit });
            } else {
                absent.add("depth_file_path", &path);
            }
        }
        capture.shots.push(shot);
    }
    let bad = bad.tolerated(transforms.frames.len())?;
    capture.lost += bad.len();
    capture.tell_bad(listing.clone(), &bad, transforms.frames.len(), "poses");
    let ply = transforms.ply_file_path.as_ref().map(|path| reader.file("ply_file_path", path)).transpose()?;
    ply.iter().filter(|path| !path.is_file()).for_each(|path| absent.add("ply_file_path", path));
    // Its depth maps are read as a file of points.
    let depth = (!capture.depth_maps.is_empty()).then(|| json.to_path_buf());
    capture.points = ply.filter(|path| path.is_file()).or(depth);
    capture.bounds = transforms.bounds(json)?;
    absent.tell(folder, &mut capture);
    reader.tell_moved(&listing, &mut capture)?;
    transforms.tell_keys(&listing, &mut capture);
    Ok(capture)
}

/// The depth maps that the `transforms.json` file `json` names and that exist.
///
/// # Errors
///
/// If the JSON file cannot be read or breaks a rule of its layout.
pub fn depth_maps(json: &Path) -> Result<Vec<DepthMap>, Error> {
    let mut capture = read(json, None, 1)?;
    capture.find_pictures(json.parent().unwrap_or(Path::new("")));
    Ok(capture.depth_maps)
}

/// Files that keys name but that are not there.
#[derive(Default)]
struct AbsentFiles {
    /// \[key\] the first, and their number.
    by_key: BTreeMap<&'static str, (PathBuf, usize)>,
}

impl AbsentFiles {
    fn add(&mut self, key: &'static str, path: &Path) {
        self.by_key.entry(key).or_insert_with(|| (path.to_path_buf(), 0)).1 += 1;
    }

    fn tell(self, folder: &Path, capture: &mut Capture) {
        for (key, (path, count)) in self.by_key {
            let more = if count > 1 { format!(", the first of {count} that are not there") } else { String::new() };
            capture.tell(Standing::Absent, relative_to(folder, &path), count, format!("named by {key}{more}"));
        }
    }
}

/// Makes photographs of frames.
struct TransformsReader<'a> {
    json: &'a Path,
    folder: &'a Path,
    downscale: u32,
    names: NamesOfFolders,
    /// Paths of another machine, with the ends by which they are taken.
    moved: Vec<(String, PathBuf)>,
}

impl TransformsReader<'_> {
    /// The photograph of frame `n`; `None` if its pose is not finite.
    fn shot(
        &mut self,
        transforms: &Transforms,
        n: usize,
        frame: &FrameEntry,
        split: Option<Split>,
        bad: &mut BadRecords,
    ) -> Result<Option<Shot>, Error> {
        let json = self.json;
        let place = || format!("frame {n}: transform_matrix");
        let mask = frame.mask_path.as_ref().or(transforms.mask_path.as_ref());
        let mask = mask.map(|mask| self.file("mask_path", mask)).transpose()?;
        let intrinsics = frame.keys.camera.or(&transforms.keys.camera).intrinsics(json, &format!("frame {n}"))?;
        let (name, picture, smaller) = self.picture(n, &frame.file_path)?;
        if !(3..=4).contains(&frame.transform_matrix.len()) {
            let found = format!("{} of them", frame.transform_matrix.len());
            return Err(Error::text(json, place(), "3 or 4 rows", found));
        }
        let mut rows = [[0.0, 0.0, 0.0, 1.0]; 4];
        rows.iter_mut().zip(&frame.transform_matrix).for_each(|(row, found)| *row = found.map(f64::from));
        let pose = rigid(&rows).map_err(|NotRigid { expected, found }| Error::text(json, place(), expected, found));
        if rows.as_flattened().iter().any(|value| !value.is_finite()) {
            bad.keep(pose);
            return Ok(None);
        }
        let (world_from_camera, position) = pose?;
        let path = String::new();
        Ok(Some(Shot {
            name,
            path,
            picture,
            smaller,
            reduced: 1,
            mask,
            intrinsics,
            world_from_camera,
            position,
            split,
        }))
    }

    /// Name and path of the picture of frame `n`, and the file that may hold it made smaller.
    fn picture(&mut self, n: usize, file_path: &str) -> Result<(String, PathBuf, Option<SmallerPicture>), Error> {
        let key = format!("frame {n}: file_path");
        let json = self.json;
        let refused = || Error::text(json, &key, "the path of a file", format_args!("{file_path:?}"));
        if file_path.trim_end().is_empty() || file_path.ends_with(['/', '\\']) {
            return Err(refused());
        }
        let relative = self.relative(&key, file_path)?;
        let name = files::without_ending(&relative);
        let name = name.file_name().and_then(|name| name.to_str()).ok_or_else(refused)?.to_owned();
        let parent = relative.parent().filter(|parent| !parent.as_os_str().is_empty());
        let smaller = parent.and_then(|parent| files::smaller(&self.folder.join(parent), self.downscale));
        let smaller = smaller.zip(relative.file_name()).map(|(smaller, name)| (smaller.join(name), self.downscale));
        let picture = self.folder.join(&relative);
        let is_complete = files::is_picture(&picture) || picture.is_file();
        Ok((name, if is_complete { picture } else { files::with_ending(&picture) }, smaller))
    }

    /// The file `found` of `key`.
    fn file(&mut self, key: &str, found: &str) -> Result<PathBuf, Error> {
        let relative = self.relative(key, found)?;
        Ok(self.names.find(self.folder, &relative).unwrap_or_else(|| self.folder.join(relative)))
    }

    /// The path `found` of `key` in the folder: as it is, or, if it begins with a folder that is not there, its end.
    fn relative(&mut self, key: &str, found: &str) -> Result<PathBuf, Error> {
        let expected = "the path of a file in the dataset's folder";
        let text = found.replace('\\', "/");
        if text.split('/').any(|part| part == "..") {
            let found = format!("{found:?}, which leaves it; put the file beside the folders of its pictures");
            return Err(Error::text(self.json, key, expected, found));
        }
        let inside = files::inside(&text);
        let parts: Vec<&str> = text.split('/').filter(|part| !part.is_empty() && *part != ".").collect();
        let begins_here = |parts: &[&str]| parts.len() < 2 || self.folder.join(parts[0]).exists();
        if let Some(inside) = &inside
            && (begins_here(&parts) || self.names.find(self.folder, inside).is_some())
        {
            return Ok(inside.clone());
        }
        for first in usize::from(inside.is_some())..parts.len() {
            let end: PathBuf = parts[first..].iter().collect();
            if self.names.find(self.folder, &end).is_some() {
                self.moved.push((found.to_owned(), end.clone()));
                return Ok(end);
            }
        }
        inside.filter(|_| !parts.is_empty()).ok_or_else(|| {
            let found = match parts.is_empty() {
                true => format!("{found:?}"),
                false => format!("{found:?}, a path of another folder, none of whose ends is in this one"),
            };
            Error::text(self.json, key, expected, found)
        })
    }

    /// Tells which paths are taken by their ends. Two different ones must not have the same end.
    fn tell_moved(&self, listing: &str, capture: &mut Capture) -> Result<(), Error> {
        let mut by_end: HashMap<&Path, &str> = HashMap::new();
        for (path, end) in &self.moved {
            if let Some(other) = by_end.insert(end, path).filter(|other| other != path) {
                let found = format!("{other:?} and {path:?}, whose ends are both {}", end.display());
                return Err(Error::text(self.json, "file_path", "paths in the dataset's folder", found));
            }
        }
        if let Some((path, end)) = self.moved.first() {
            let what = format!(
                "{} paths of another folder are taken by their ends, as {path} by {}",
                self.moved.len(),
                end.display()
            );
            capture.tell(Standing::Doubtful, listing, self.moved.len(), what);
        }
        Ok(())
    }
}

impl Transforms {
    /// The file `json`, which has frames.
    fn read(json: &Path) -> Result<Self, Error> {
        let bytes = files::read(json)?;
        let text = bytes.strip_prefix(files::BYTE_ORDER_MARK).unwrap_or(&bytes);
        let parse = |text: &[u8]| -> serde_json::Result<Self> {
            let transforms: Self = serde_json::from_slice(text)?;
            Ok(Self { keys: CommonKeys::read(text)?, ..transforms })
        };
        let transforms = match parse(text) {
            // Python writes NaN and infinities, which JSON has not.
            Err(error) => match with_quoted_numbers(text) {
                Some(quoted) => parse(&quoted),
                None => Err(error),
            },
            read => read,
        };
        let transforms = transforms.map_err(|source| Error::Json { path: json.to_path_buf(), source })?;
        if transforms.frames.is_empty() {
            return Err(Error::NoFrames { path: json.to_path_buf(), lost: 0 });
        }
        Ok(transforms)
    }

    /// Length of a depth of 1.
    fn depth_unit(&self, json: &Path) -> Result<f64, Error> {
        let unit = self.integer_depth_scale.map_or(MILLIMETERS, f64::from);
        if !(unit.is_normal() && unit > 0.0) {
            return Err(Error::text(json, "integer_depth_scale", "a positive number", unit.to_string()));
        }
        Ok(unit)
    }

    /// Refuses keys at the top and in frames whose meaning is not supported.
    fn check_keys(&self, json: &Path) -> Result<(), Error> {
        let top = self.keys.others.refused.iter().map(|refused| (String::new(), refused));
        let in_frames = self.frames.iter().enumerate();
        let in_frames =
            in_frames.filter_map(|(n, frame)| Some((format!("frame {n}: "), frame.keys.others.refused.as_ref()?)));
        match top.chain(in_frames).next() {
            Some((place, RefusedKey { key, remedy, value })) => {
                Err(Error::text(json, format!("{place}{key}"), format!("absent or 0: {remedy}"), value))
            }
            None => Ok(()),
        }
    }

    /// Tells which keys are not read.
    fn tell_keys(&self, listing: &str, capture: &mut Capture) {
        let in_frames = self.frames.iter().flat_map(|frame| &frame.keys.others.names);
        let names: BTreeSet<&str> = self.keys.others.names.iter().chain(in_frames).map(String::as_str).collect();
        if !names.is_empty() {
            const SHOWN: usize = 8;
            let shown: Vec<&str> = names.iter().take(SHOWN).copied().collect();
            let more = if names.len() > SHOWN { ", …" } else { "" };
            let what = format!("keys that are not read: {}{more}", shown.join(", "));
            capture.tell(Standing::Unused, listing, names.len(), what);
        }
    }

    /// \[frame\] the split by the file's lists. Without a list of training photographs, those in no other list are for training.
    fn splits(&self, json: &Path, listing: &str, capture: &mut Capture) -> Result<Vec<Option<Split>>, Error> {
        let lists = [
            ("train_filenames", &self.train_filenames, Split::Train),
            ("val_filenames", &self.val_filenames, Split::Validation),
            ("test_filenames", &self.test_filenames, Split::Test),
        ];
        let mut frames: HashMap<String, Vec<usize>> = HashMap::new();
        for (n, frame) in self.frames.iter().enumerate() {
            frames.entry(listed_name(&frame.file_path)).or_default().push(n);
        }
        // Names of lists may be the ends of paths of another machine.
        let by_end = |name: &str| -> Vec<usize> {
            let end = format!("/{name}");
            frames.iter().filter(|(path, _)| path.ends_with(&end)).flat_map(|(_, numbers)| numbers).copied().collect()
        };
        let mut splits = vec![None; self.frames.len()];
        let mut has_list = false;
        // The first list that names a frame counts.
        for (key, names, split) in lists.into_iter().rev() {
            let Some(names) = names else { continue };
            has_list = true;
            let mut absent = Vec::new();
            for name in names {
                let wanted = listed_name(name);
                let found = frames.get(&wanted).cloned().unwrap_or_else(|| by_end(&wanted));
                if found.is_empty() {
                    absent.push(name);
                }
                found.into_iter().for_each(|n| splits[n] = Some(split));
            }
            if let Some(first) = absent.first() {
                let example = &self.frames[0].file_path;
                if absent.len() == names.len() {
                    let expected = format!("a list of file_path of frames, as {example:?}");
                    return Err(Error::text(json, key, expected, format!("no frame of {first:?}")));
                }
                let what = format!("{key} names {} of no frame, the first is {first}", absent.len());
                capture.tell(Standing::Absent, listing, absent.len(), what);
            }
        }
        let unlisted = splits.iter().filter(|split| split.is_none()).count();
        if has_list && unlisted > 0 {
            if self.train_filenames.is_none() {
                splits.iter_mut().for_each(|split| *split = split.or(Some(Split::Train)));
                let what = format!("no train_filenames: {unlisted} frames in no other list are trained on");
                capture.tell(Standing::Doubtful, listing, unlisted, what);
            } else {
                let what = format!("{unlisted} frames are in none of its lists, so neither trained on nor test views");
                capture.tell(Standing::Unused, listing, unlisted, what);
            }
        }
        Ok(splits)
    }

    /// The box of Instant-NGP's scene, if the file has `aabb_scale`.
    fn bounds(&self, json: &Path) -> Result<Option<Aabb>, Error> {
        let Some(edge) = self.aabb_scale.map(f64::from) else { return Ok(None) };
        let scale = self.scale.map_or(NGP_SCALE, f64::from);
        let offset = self.offset.map_or(NGP_CENTER, |offset| DVec3::from(offset.map(f64::from)));
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

/// The name of a picture in a list or in a frame, in the form in which both are compared.
fn listed_name(name: &str) -> String {
    let name = normal(name);
    files::without_ending(Path::new(name.trim_start_matches("./"))).to_string_lossy().into_owned()
}

impl CameraKeys {
    /// These keys, and those of `common` that are missing. The keys of a focal length, and those of a lens, stay together.
    fn or(&self, common: &Self) -> Self {
        let focal_keys = [self.fl_x, self.fl_y, self.camera_angle_x, self.camera_angle_y];
        let has_focal = focal_keys.iter().any(Option::is_some);
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
        let [fl_x, fl_y, angle_x, angle_y, cx, cy, w, h] =
            [self.fl_x, self.fl_y, self.camera_angle_x, self.camera_angle_y, self.cx, self.cy, self.w, self.h]
                .map(|number| number.map(f64::from));
        // Instant-NGP, too, takes one focal length for both directions.
        let focal = match (fl_x.or(fl_y), angle_x, angle_y) {
            (Some(x), ..) => Focal::Pixels([x, fl_y.unwrap_or(x)]),
            (None, Some(x), y) => Focal::Angles(x, y),
            (None, None, Some(y)) => Focal::VerticalAngle(y),
            (None, None, None) if self.is_equirectangular() => Focal::Panorama,
            (None, None, None) => {
                let expected = "this key, camera_angle_y, fl_x or fl_y, at the top or in the frame";
                return Err(Error::text(json, format!("{place}: camera_angle_x"), expected, "neither"));
            }
        };
        let size = match (w, h) {
            (Some(w), Some(h)) => Some([extent(json, place, "w", w)?, extent(json, place, "h", h)?]),
            _ => None,
        };
        let principal = [cx, cy];
        let intrinsics = Intrinsics { size, focal, principal, lens: self.lens(json, place)? };
        intrinsics.check(json, place)?;
        Ok(intrinsics)
    }

    fn is_equirectangular(&self) -> bool {
        self.camera_model.as_ref().is_some_and(|model| model.eq_ignore_ascii_case("EQUIRECTANGULAR"))
    }

    /// The lens. Files of OpenCV's pinhole and fisheye models have any of the keys of the whole model.
    fn lens(&self, json: &Path, place: &str) -> Result<Lens, Error> {
        let number = |number: Option<Number>| number.map_or(0.0, f64::from);
        let [k1, k2, k3, k4, k5, k6] = [self.k1, self.k2, self.k3, self.k4, self.k5, self.k6].map(number);
        let tangential = [self.p1, self.p2].map(number);
        let model = self.camera_model.as_ref().map(|model| model.to_uppercase());
        let is_fisheye = self.is_fisheye == Some(true) || model.as_ref().is_some_and(|m| m.contains("FISHEYE"));
        let known = match model.as_deref() {
            None | Some("PERSPECTIVE") => true,
            Some("EQUIRECTANGULAR") => return Ok(Lens::PANORAMA),
            // No key has its thin prism coefficients.
            Some("THIN_PRISM_FISHEYE") => false,
            Some(name) => MODELS.split([' ', ',']).any(|known| known == name),
        };
        let has_divisor = !is_fisheye && model.as_deref() == Some("FULL_OPENCV");
        for (key, value) in [("k5", k5), ("k6", k6)] {
            if value != 0.0 && known && !has_divisor {
                let expected = "absent or 0 unless camera_model is FULL_OPENCV";
                return Err(Error::text(json, format!("{place}: {key}"), expected, value.to_string()));
            }
        }
        let distortion = if has_divisor {
            Distortion::new([k1, k2, k3, 0.0], [k4, k5, k6], tangential, [0.0; 2])
        } else {
            // OpenCV's k4 is one of three numbers of a divisor. In files of nerfstudio it stands alone and means r⁸.
            Distortion::new([k1, k2, k3, k4], [0.0; 3], tangential, [0.0; 2])
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

/// The splits of the files `transforms_*.json` in `folder`, ascending. Beside `transforms.json` and without
/// `transforms_train.json` they are copies of that file.
pub(super) fn splits(folder: &Path) -> Result<Vec<String>, Error> {
    let entries = fs::read_dir(folder).map_err(Error::read(folder))?;
    let names = entries.flatten().filter_map(|entry| entry.file_name().into_string().ok());
    let split = |name: String| Some(name.strip_prefix("transforms_")?.strip_suffix(".json")?.to_owned());
    let mut splits: Vec<String> = names.filter_map(split).collect();
    splits.sort();
    let is_beside = folder.join("transforms.json").is_file() && !splits.iter().any(|split| split == "train");
    Ok(if is_beside { Vec::new() } else { splits })
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
        let top = &transforms.keys.camera;
        assert_eq!([top.w, top.fl_x].map(|number| number.map(f64::from)), [Some(8.0), Some(2.0)]);
        assert_eq!((transforms.frames.len(), transforms.frames[0].keys.camera.k1.map(f64::from)), (1, Some(0.5)));
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
