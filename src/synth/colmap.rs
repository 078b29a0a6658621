//! COLMAP's sparse model: `cameras`, `images` and `points3D`, binary or text, with the points that cameras see.

use std::fs;
use std::io::{self, Write};
use std::path::Path;

use glam::{DQuat, DVec2};
use rayon::prelude::*;

use super::camera_model::CameraModel;
use super::layout::PlannedPicture;
use super::options::write;
use super::points::SurfacePoint;
use super::scene::SyntheticScene;
use crate::Error;
use strivec_dataset::OPENGL_FROM_OPENCV;
use strivec_dataset::model_number;
use strivec_format::geometry::{Camera, Ray};

/// The number of the one camera.
const CAMERA: u32 = 1;
/// The least number of pictures that see a point.
const MIN_TRACK: usize = 2;
/// The distance of a point from the surface that its ray meets, at most, if the camera sees it.
const TOLERANCE: f64 = 1e-6;

/// A reconstruction without errors.
pub(super) struct Reconstruction<'a> {
    model: CameraModel,
    photographs: &'a [PlannedPicture],
    points: Vec<&'a SurfacePoint>,
    /// \[picture\] where it sees which of `points`.
    keypoints: Vec<Vec<(DVec2, usize)>>,
    /// \[point\] the pictures that see it, and the keypoint in each.
    tracks: Vec<Vec<(usize, usize)>>,
}

impl<'a> Reconstruction<'a> {
    /// The reconstruction of those `points` of `scene` that at least two of `photographs` see.
    pub(super) fn new(
        scene: &SyntheticScene,
        photographs: &'a [PlannedPicture],
        points: &'a [SurfacePoint],
        model: CameraModel,
    ) -> Self {
        let seen: Vec<Vec<Option<DVec2>>> = (photographs.par_iter())
            .map(|photograph| points.iter().map(|point| place(scene, &photograph.camera, point)).collect())
            .collect();
        let counts = |n: &usize| seen.iter().filter(|places| places[*n].is_some()).count() >= MIN_TRACK;
        let kept: Vec<usize> = (0..points.len()).filter(counts).collect();
        let mut tracks = vec![Vec::new(); kept.len()];
        let mut keypoints = vec![Vec::new(); photographs.len()];
        for (picture, places) in seen.iter().enumerate() {
            for (point, &n) in kept.iter().enumerate() {
                if let Some(at) = places[n] {
                    tracks[point].push((picture, keypoints[picture].len()));
                    keypoints[picture].push((at, point));
                }
            }
        }
        Self { model, photographs, points: kept.into_iter().map(|n| &points[n]).collect(), keypoints, tracks }
    }

    /// Writes the files of `sparse/0` in the folder `out`.
    pub(super) fn write(&self, out: &Path, is_text: bool) -> Result<(), Error> {
        let folder = out.join("sparse/0");
        fs::create_dir_all(&folder).map_err(Error::write(&folder))?;
        if is_text {
            write(&folder.join("cameras.txt"), |file| self.cameras_text(file))?;
            write(&folder.join("images.txt"), |file| self.images_text(file))?;
            write(&folder.join("points3D.txt"), |file| self.points_text(file))
        } else {
            write(&folder.join("cameras.bin"), |file| self.cameras_binary(file))?;
            write(&folder.join("images.bin"), |file| self.images_binary(file))?;
            write(&folder.join("points3D.bin"), |file| self.points_binary(file))
        }
    }

    fn camera(&self) -> &Camera {
        &self.photographs[0].camera
    }

    /// COLMAP's parameters: focal lengths, principal point, coefficients; of a panorama its size.
    fn parameters(&self) -> Vec<f64> {
        let camera = self.camera();
        if self.model == CameraModel::Equirectangular {
            return vec![f64::from(camera.width), f64::from(camera.height)];
        }
        let focal = if self.model.has_one_focal() { &camera.focal[..1] } else { &camera.focal[..] };
        let coefficients = self.model.coefficients().iter().map(|(_, value)| *value);
        focal.iter().chain(&camera.principal).copied().chain(coefficients).collect()
    }

    /// \[picture\] number, pose and name.
    fn images(&self) -> impl Iterator<Item = (u32, [f64; 7], &'a str)> {
        (1..).zip(self.photographs).map(|(id, photograph)| {
            let name = photograph.file.trim_start_matches("images/");
            (id, pose(&photograph.camera), name)
        })
    }

    fn cameras_text(&self, file: &mut impl Write) -> io::Result<()> {
        let Camera { width, height, .. } = self.camera();
        writeln!(file, "# CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]")?;
        writeln!(file, "{CAMERA} {} {width} {height} {}", self.model.colmap_name(), words(&self.parameters()))
    }

    fn images_text(&self, file: &mut impl Write) -> io::Result<()> {
        writeln!(file, "# IMAGE_ID, QW, QX, QY, QZ, TX, TY, TZ, CAMERA_ID, NAME")?;
        writeln!(file, "# POINTS2D[] as (X, Y, POINT3D_ID)")?;
        for ((id, pose, name), keypoints) in self.images().zip(&self.keypoints) {
            writeln!(file, "{id} {} {CAMERA} {name}", words(&pose))?;
            let keypoints = keypoints.iter().map(|(at, point)| format!("{} {} {}", at.x, at.y, point + 1));
            writeln!(file, "{}", keypoints.collect::<Vec<_>>().join(" "))?;
        }
        Ok(())
    }

    fn points_text(&self, file: &mut impl Write) -> io::Result<()> {
        writeln!(file, "# POINT3D_ID, X, Y, Z, R, G, B, ERROR, TRACK[] as (IMAGE_ID, POINT2D_IDX)")?;
        for ((id, point), track) in (1..).zip(&self.points).zip(&self.tracks) {
            let [r, g, b] = point.color;
            let track = track.iter().map(|(picture, keypoint)| format!("{} {keypoint}", picture + 1));
            let (position, track) = (words(&point.position.to_array()), track.collect::<Vec<_>>().join(" "));
            writeln!(file, "{id} {position} {r} {g} {b} 0 {track}")?;
        }
        Ok(())
    }

    fn cameras_binary(&self, file: &mut impl Write) -> io::Result<()> {
        let number = model_number(&self.model.colmap_name()).expect("a model of COLMAP");
        file.write_all(&1_u64.to_le_bytes())?;
        file.write_all(&CAMERA.to_le_bytes())?;
        file.write_all(&number.to_le_bytes())?;
        file.write_all(&u64::from(self.camera().width).to_le_bytes())?;
        file.write_all(&u64::from(self.camera().height).to_le_bytes())?;
        write_numbers(file, &self.parameters())
    }

    fn images_binary(&self, file: &mut impl Write) -> io::Result<()> {
        file.write_all(&(self.photographs.len() as u64).to_le_bytes())?;
        for ((id, pose, name), keypoints) in self.images().zip(&self.keypoints) {
            file.write_all(&u32::to_le_bytes(id))?;
            write_numbers(file, &pose)?;
            file.write_all(&CAMERA.to_le_bytes())?;
            file.write_all(name.as_bytes())?;
            file.write_all(&[0])?;
            file.write_all(&(keypoints.len() as u64).to_le_bytes())?;
            for (at, point) in keypoints {
                write_numbers(file, &at.to_array())?;
                file.write_all(&(*point as u64 + 1).to_le_bytes())?;
            }
        }
        Ok(())
    }

    fn points_binary(&self, file: &mut impl Write) -> io::Result<()> {
        file.write_all(&(self.points.len() as u64).to_le_bytes())?;
        for ((id, point), track) in (1..).zip(&self.points).zip(&self.tracks) {
            file.write_all(&u64::to_le_bytes(id))?;
            write_numbers(file, &point.position.to_array())?;
            file.write_all(&point.color)?;
            write_numbers(file, &[0.0])?;
            file.write_all(&(track.len() as u64).to_le_bytes())?;
            for &(picture, keypoint) in track {
                file.write_all(&(picture as u32 + 1).to_le_bytes())?;
                file.write_all(&(keypoint as u32).to_le_bytes())?;
            }
        }
        Ok(())
    }
}

/// The picture point at which `camera` sees `point`. `None` if it is outside of the picture or hidden.
fn place(scene: &SyntheticScene, camera: &Camera, point: &SurfacePoint) -> Option<DVec2> {
    let at = camera.project(point.position).filter(|at| camera.is_inside(*at))?;
    let line = point.position - camera.position;
    let ray = Ray { origin: camera.position, direction: line.normalize() };
    let hit = scene.hit(&ray, 0.0)?;
    ((hit.t - line.length()).abs() < TOLERANCE).then_some(at)
}

/// w, x, y, z of the rotation and the translation of `camera_from_world` in OpenCV's axes.
fn pose(camera: &Camera) -> [f64; 7] {
    let camera_from_world = (camera.world_from_camera * OPENGL_FROM_OPENCV).transpose();
    let (q, t) = (DQuat::from_mat3(&camera_from_world), -(camera_from_world * camera.position));
    [q.w, q.x, q.y, q.z, t.x, t.y, t.z]
}

fn words(numbers: &[f64]) -> String {
    numbers.iter().map(f64::to_string).collect::<Vec<_>>().join(" ")
}

fn write_numbers(file: &mut impl Write, numbers: &[f64]) -> io::Result<()> {
    numbers.iter().try_for_each(|number| file.write_all(&number.to_le_bytes()))
}
