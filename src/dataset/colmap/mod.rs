//! COLMAP's projects: `cameras` and `images`, binary or text, of a sparse reconstruction, and the folder of pictures.
//!
//! Poses are `camera_from_world` in OpenCV's axes. Pictures that were not registered have no entry.

mod binary;
mod raw;
mod text;

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use glam::{DMat3, DQuat, DVec3};

use self::raw::{BINARY_MODELS, RawCamera, RawImage};
use super::capture::Capture;
use super::inventory_entry::{Standing, relative_to};
use super::names::NamesOfFolders;
use super::records::BadRecords;
use super::shot::{Focal, Intrinsics, MODELS, OPENGL_FROM_OPENCV, Shot, SmallerPicture, lens_of};
use super::{Error, files};
use strivec_format::geometry::Lens;

/// Where a reconstruction may lie in a project, in the order of search; or, but in the last, in a folder in it.
const MODEL_FOLDERS: [&str; 3] = ["sparse", "colmap/sparse", "."];
/// Folders in one of these that are looked at, at most.
const MAX_MODELS: usize = 1000;
/// Files that belong to a model and that are not needed.
const OF_A_MODEL: [&str; 5] = ["rigs", "frames", "points3D", "cameras", "images"];

/// The files of a reconstruction.
pub(super) struct Project {
    /// The folder of `cameras` and `images`.
    pub(super) model: PathBuf,
    is_binary: bool,
    /// Number of its images.
    images: u64,
    /// Smaller reconstructions, with the number of their images.
    others: Vec<(PathBuf, u64)>,
}

/// Models with one focal length for columns and rows.
const ONE_FOCAL: [&str; 6] =
    ["SIMPLE_PINHOLE", "SIMPLE_RADIAL", "RADIAL", "SIMPLE_RADIAL_FISHEYE", "RADIAL_FISHEYE", "SIMPLE_FISHEYE"];

impl Project {
    /// The reconstruction in `folder` with the most images, the first of several; `None` if there is none.
    pub(super) fn find(folder: &Path) -> Option<Self> {
        let mut models: Vec<(PathBuf, bool, u64)> =
            model_folders(folder).into_iter().filter_map(|model| Self::of(&model)).collect();
        let most = models.iter().map(|(_, _, images)| *images).max()?;
        let largest = models.iter().position(|(_, _, images)| *images == most)?;
        let (model, is_binary, images) = models.remove(largest);
        let others = models.into_iter().map(|(model, _, images)| (model, images)).collect();
        Some(Self { model, is_binary, images, others })
    }

    /// The reconstruction whose files are in the folder `model`: whether they are binary, and the number of images.
    fn of(model: &Path) -> Option<(PathBuf, bool, u64)> {
        [true, false].into_iter().find_map(|is_binary| {
            let [cameras, images] = names(is_binary).map(|name| model.join(name));
            if !(cameras.is_file() && images.is_file()) {
                return None;
            }
            // A file that cannot be read is an error later.
            let count = if is_binary { binary::count(&images) } else { text::count(&images) };
            Some((model.to_path_buf(), is_binary, count.unwrap_or(0)))
        })
    }

    /// The files by which projects are recognized, for messages.
    pub(super) fn places() -> impl DoubleEndedIterator<Item = [String; 2]> {
        let folders = ["sparse/0", "sparse", "colmap/sparse/0", "colmap/sparse", "."];
        let of = |folder: &'static str| [true, false].map(|is| names(is).map(|name| format!("{folder}/{name}")));
        folders.into_iter().flat_map(of)
    }

    /// The file of sparse points, if there is one.
    pub(super) fn points(&self) -> Option<PathBuf> {
        ["points3D.bin", "points3D.txt"].iter().map(|name| self.model.join(name)).find(|path| path.is_file())
    }

    /// The registered photographs of the project in `folder`, ascending by name. Pictures are those of `images_N` if
    /// there is such a folder for `downscale` N.
    pub(super) fn read(&self, folder: &Path, downscale: u32) -> Result<Capture, Error> {
        let [cameras_path, images_path] = names(self.is_binary).map(|name| self.model.join(name));
        let cameras = if self.is_binary { binary::cameras(&cameras_path)? } else { text::cameras(&cameras_path)? };
        let mut intrinsics = BTreeMap::new();
        for (id, camera) in cameras {
            intrinsics.insert(id, camera.intrinsics(&cameras_path, id)?);
        }
        let (images, without_points) =
            if self.is_binary { (binary::images(&images_path)?, 0) } else { text::images(&images_path)? };
        let mut capture = Capture::new(&self.model, Vec::with_capacity(images.len()));
        let mut pictures =
            PictureFolders { folder, images: folder.join("images"), smaller: None, names: NamesOfFolders::default() };
        pictures.smaller = files::smaller(&pictures.images, downscale).map(|smaller| (smaller, downscale));
        let (mut bad, total) = (BadRecords::default(), images.len());
        for (id, image) in images {
            let place = format!("image {id}");
            let Some(&intrinsics) = intrinsics.get(&image.camera) else {
                let expected = format!("a camera of {}", cameras_path.display());
                return Err(Error::text(&images_path, place, expected, image.camera.to_string()));
            };
            let shot = image.shot(&images_path, place, intrinsics, &mut pictures);
            if image.rotation.iter().chain(&image.translation).all(|value| value.is_finite()) {
                capture.shots.push(shot?);
            } else {
                bad.keep(shot);
            }
        }
        let bad = bad.tolerated(total)?;
        capture.lost = bad.len();
        let listing = relative_to(folder, &images_path);
        capture.tell_bad(listing.clone(), &bad, total, "poses");
        if without_points > 0 {
            let what = format!("{without_points} of {total} images lack their line of points, which is taken as empty");
            capture.tell(Standing::Doubtful, listing, without_points, what);
        }
        capture.shots.sort_by(|a, b| a.picture.cmp(&b.picture));
        capture.leave_out_repeated(folder);
        capture.points = self.points();
        self.tell_models(folder, &mut capture);
        Ok(capture)
    }

    /// Tells of the files of this model and of smaller ones.
    fn tell_models(&self, folder: &Path, capture: &mut Capture) {
        for (other, images) in &self.others {
            let (place, own) = (relative_to(folder, other), relative_to(folder, &self.model));
            let what = format!("a model of {images} images; {own}, which has {}, is used", self.images);
            if *other == folder || self.model.starts_with(other) {
                // Its folder holds the model that is used, too.
                let files = names(other.join("cameras.bin").is_file()).map(|name| other.join(name));
                files.iter().for_each(|file| capture.tell(Standing::Unused, relative_to(folder, file), 1, &what));
            } else {
                capture.tell(Standing::Unused, place, *images as usize, what);
            }
        }
        let own = OF_A_MODEL.iter().flat_map(|name| ["bin", "txt"].map(|ending| format!("{name}.{ending}")));
        capture.inputs.extend(own.chain(["project.ini".to_owned()]).map(|name| self.model.join(name)));
        capture.inputs.extend(["database.db", "pose.json", "pictures.txt"].map(|name| folder.join(name)));
    }
}

/// The names of the files of a model.
fn names(is_binary: bool) -> [String; 2] {
    let ending = if is_binary { "bin" } else { "txt" };
    ["cameras", "images"].map(|name| format!("{name}.{ending}"))
}

/// The folders in which a model of the project in `folder` may be, in the order of search.
fn model_folders(folder: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for place in MODEL_FOLDERS {
        let place = if place == "." { folder.to_path_buf() } else { folder.join(place) };
        if place != folder {
            let inside = std::fs::read_dir(&place).into_iter().flatten().flatten().map(|entry| entry.path());
            let mut inside: Vec<_> = inside.filter(|path| path.is_dir()).collect();
            // In the order of their numbers.
            inside.sort_by_key(|path| {
                let name = path.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned());
                (name.parse::<u64>().unwrap_or(u64::MAX), name)
            });
            found.extend(inside.into_iter().take(MAX_MODELS));
        }
        found.push(place);
    }
    found
}

/// The folders of a project's pictures and masks.
struct PictureFolders<'a> {
    folder: &'a Path,
    images: PathBuf,
    /// The folder of pictures that were made so many times smaller.
    smaller: Option<SmallerPicture>,
    names: NamesOfFolders,
}

/// The names of the photographs that the binary model in the folder `model` has poses of.
///
/// # Errors
///
/// If its `images.bin` cannot be read.
pub fn model_pictures(model: &Path) -> Result<BTreeSet<String>, Error> {
    Ok(binary::images(&model.join("images.bin"))?.into_iter().map(|(_, image)| image.name).collect())
}

/// The number of the camera model `name` in binary files.
pub fn model_number(name: &str) -> Option<u32> {
    (0..).zip(BINARY_MODELS).find(|(_, (known, _))| *known == name).map(|(number, _)| number)
}

impl RawCamera {
    fn intrinsics(&self, path: &Path, id: u32) -> Result<Intrinsics, Error> {
        let place = format!("camera {id}");
        let size = self.size.map(|extent| u32::try_from(extent).unwrap_or(u32::MAX));
        let Some((focal, principal, lens)) = camera_of(&self.model, &self.parameters) else {
            let found = format!("{} with {} parameters", self.model, self.parameters.len());
            return Err(Error::text(path, place, format!("{MODELS}, with finite parameters"), found));
        };
        let intrinsics = Intrinsics { size: Some(size), focal, principal, lens };
        intrinsics.check(path, &place)?;
        Ok(intrinsics)
    }
}

/// The camera of COLMAP's model `model` with all its `parameters`; `None` if there is no such model.
fn camera_of(model: &str, parameters: &[f64]) -> Option<(Focal, [Option<f64>; 2], Lens)> {
    if model == "EQUIRECTANGULAR" {
        // Its parameters are the size of the picture once more.
        return Some((Focal::Panorama, [None; 2], Lens::PANORAMA));
    }
    let focals = if ONE_FOCAL.contains(&model) { 1 } else { 2 };
    let (numbers, bent) = parameters.split_at_checked(focals + 2)?;
    let principal = [Some(numbers[focals]), Some(numbers[focals + 1])];
    Some((Focal::Pixels([numbers[0], numbers[focals - 1]]), principal, lens_of(model, bent)?))
}

impl RawImage {
    fn shot(
        &self,
        path: &Path,
        place: String,
        intrinsics: Intrinsics,
        pictures: &mut PictureFolders<'_>,
    ) -> Result<Shot, Error> {
        let [w, x, y, z] = self.rotation;
        let rotation = DQuat::from_xyzw(x, y, z, w);
        let translation = DVec3::from(self.translation);
        if !((rotation.length() - 1.0).abs() < 1e-3 && translation.is_finite()) {
            let expected = "a unit quaternion and finite numbers";
            return Err(Error::text(path, place, expected, format!("{:?} {:?}", self.rotation, self.translation)));
        }
        let camera_from_world = DMat3::from_quat(rotation.normalize());
        let world_from_camera = camera_from_world.transpose();
        let file = files::inside(&self.name).ok_or_else(|| {
            Error::text(path, place, "the name of a picture in the folder of pictures", format!("{:?}", self.name))
        })?;
        let PictureFolders { folder, images, smaller, names } = pictures;
        let mask = ["masks", "mask"].iter().find_map(|masks| names.companion(&folder.join(masks), &file));
        Ok(Shot {
            // Names name files elsewhere, so they have no folders.
            name: files::without_ending(&file).to_string_lossy().replace('/', "_"),
            path: String::new(),
            picture: images.join(&file),
            smaller: smaller.as_ref().map(|(smaller, factor)| (smaller.join(&file), *factor)),
            reduced: 1,
            mask,
            intrinsics,
            world_from_camera: world_from_camera * OPENGL_FROM_OPENCV,
            position: -(world_from_camera * translation),
            split: None,
        })
    }
}

#[cfg(test)]
mod tests {
    use glam::{DVec2, DVec3};

    use super::*;
    use strivec_format::geometry::Camera;

    #[derive(serde::Deserialize)]
    struct Case {
        by: String,
        model: String,
        parameters: Vec<f64>,
        /// Direction and pixel.
        rows: Vec<[f64; 5]>,
    }

    /// COLMAP's and OpenCV's own numbers, by tools/measure/lenses.py.
    #[test]
    fn cameras_are_those_of_colmap_and_opencv() {
        let cases: Vec<Case> =
            serde_json::from_str(include_str!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../fixtures/lenses.json")))
                .unwrap();
        for Case { by, model, mut parameters, rows } in cases {
            let camera = camera(&model, &parameters);
            let focal = DVec2::from(camera.focal);
            for &[x, y, z, u, v] in &rows {
                let (direction, pixel) = (DVec3::new(x, y, z), DVec2::new(u, v));
                let found = camera.project(direction).unwrap();
                let far = ((found - pixel) / focal).abs().max_element();
                assert!(far < 1e-9, "{by} {model}: {direction} falls on {found}, not {pixel}");
                let ray = camera.ray_through(u, v).unwrap();
                let far = (ray.direction - direction.normalize()).length();
                assert!(far < 1e-9, "{by} {model}: through {pixel} {}, not {direction}", ray.direction);
            }
            if model != "EQUIRECTANGULAR" {
                *parameters.last_mut().unwrap() += 1e-5;
                let planted = self::camera(&model, &parameters);
                let far = |&[x, y, z, u, v]: &[f64; 5]| {
                    let found = planted.project(DVec3::new(x, y, z)).unwrap();
                    ((found - DVec2::new(u, v)) / focal).abs().max_element()
                };
                assert!(
                    rows.iter().map(far).fold(0.0, f64::max) > 1e-9,
                    "{model}: a planted difference goes unnoticed"
                );
            }
        }
    }

    fn camera(model: &str, parameters: &[f64]) -> Camera {
        let (focal, principal, lens) = camera_of(model, parameters).unwrap();
        let shot = Shot {
            name: String::new(),
            path: String::new(),
            picture: PathBuf::new(),
            smaller: None,
            reduced: 1,
            mask: None,
            intrinsics: Intrinsics { size: Some([640, 480]), focal, principal, lens },
            world_from_camera: OPENGL_FROM_OPENCV,
            position: DVec3::ZERO,
            split: None,
        };
        shot.camera([640, 480])
    }
}
