//! COLMAP's projects: `cameras` and `images`, binary or text, of a sparse reconstruction, and the folder of pictures.
//!
//! Poses are `camera_from_world` in OpenCV's axes. Pictures that were not registered have no entry.

mod binary;
mod raw;
mod text;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use glam::{DMat3, DQuat, DVec3};

use self::raw::{BINARY_MODELS, RawCamera, RawImage};
use super::shot::{Focal, Intrinsics, MODELS, OPENGL_FROM_OPENCV, Shot, lens_of};
use super::{Error, files};
use strivec_format::geometry::Lens;

/// Where a reconstruction may lie in a project, in the order of search.
const MODEL_FOLDERS: [&str; 5] = ["sparse/0", "sparse", "colmap/sparse/0", "colmap/sparse", "."];

/// The files of a reconstruction.
pub(super) struct Project {
    /// The folder of `cameras` and `images`.
    pub(super) model: PathBuf,
    is_binary: bool,
}

/// Models with one focal length for columns and rows.
const ONE_FOCAL: [&str; 6] =
    ["SIMPLE_PINHOLE", "SIMPLE_RADIAL", "RADIAL", "SIMPLE_RADIAL_FISHEYE", "RADIAL_FISHEYE", "SIMPLE_FISHEYE"];

impl Project {
    /// The reconstruction in `folder`, if there is one.
    pub(super) fn find(folder: &Path) -> Option<Self> {
        let has = |files: &[String; 2]| files.iter().all(|file| folder.join(file).is_file());
        let (model, is_binary, _) = Self::candidates().find(|(_, _, files)| has(files))?;
        Some(Self { model: folder.join(model), is_binary })
    }

    /// Where a reconstruction may lie in a project: its folder, true for binary files, and the paths of its files.
    pub(super) fn candidates() -> impl Iterator<Item = (&'static str, bool, [String; 2])> {
        let files = |model, ending| ["cameras", "images"].map(|name| format!("{model}/{name}.{ending}"));
        MODEL_FOLDERS
            .iter()
            .flat_map(move |&model| [(model, true, files(model, "bin")), (model, false, files(model, "txt"))])
    }

    /// The file of sparse points, if there is one.
    pub(super) fn points(&self) -> Option<PathBuf> {
        ["points3D.bin", "points3D.txt"].iter().map(|name| self.model.join(name)).find(|path| path.is_file())
    }

    /// The registered photographs of the project in `folder`, ascending by name. Pictures are those of `images_N` if
    /// there is such a folder for `downscale` N.
    pub(super) fn shots(&self, folder: &Path, downscale: u32) -> Result<Vec<Shot>, Error> {
        let ending = if self.is_binary { "bin" } else { "txt" };
        let (cameras_path, images_path) =
            (self.model.join(format!("cameras.{ending}")), self.model.join(format!("images.{ending}")));
        let cameras = if self.is_binary { binary::cameras(&cameras_path)? } else { text::cameras(&cameras_path)? };
        let mut intrinsics = BTreeMap::new();
        for (id, camera) in cameras {
            intrinsics.insert(id, camera.intrinsics(&cameras_path, id)?);
        }
        let images = if self.is_binary { binary::images(&images_path)? } else { text::images(&images_path)? };
        let (pictures, reduced) = files::reduced(&folder.join("images"), downscale);
        let mut shots = Vec::with_capacity(images.len());
        for (id, image) in images {
            let place = format!("image {id}");
            let Some(&intrinsics) = intrinsics.get(&image.camera) else {
                let expected = format!("a camera of {}", cameras_path.display());
                return Err(Error::text(&images_path, place, expected, image.camera.to_string()));
            };
            shots.push(image.shot(&images_path, place, intrinsics, (&pictures, reduced), folder)?);
        }
        shots.sort_by(|a, b| a.picture.cmp(&b.picture));
        Ok(shots)
    }
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
        (pictures, reduced): (&Path, u32),
        folder: &Path,
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
        let mask = ["masks", "mask"].iter().flat_map(|masks| {
            // COLMAP's masks are named as the picture with .png after it.
            let whole = folder.join(masks).join(format!("{}.png", file.display()));
            [whole, folder.join(masks).join(file.with_extension("png"))]
        });
        Ok(Shot {
            // Names name files elsewhere, so they have no folders.
            name: files::without_ending(&file).to_string_lossy().replace('/', "_"),
            picture: pictures.join(&file),
            reduced,
            mask: mask.into_iter().find(|mask| mask.is_file()),
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
            picture: PathBuf::new(),
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
