//! Cameras and photographs of a dataset's folder.

use std::path::Path;

use glam::DVec2;

use super::interpolation::between_four;
use strivec_capture::dataset;
use strivec_capture::dataset::LoadOptions;
use strivec_format::color::byte;
use strivec_format::container::TrainingCamera;
use strivec_format::geometry::{Camera, Ray};
use strivec_format::model::Scene;

/// A photograph: columns and rows, and \[row\]\[column\] red, green, blue, opacity.
type Rgba = ([u32; 2], Vec<u8>);

/// Reads the training cameras of the dataset in `folder`, and fills `cameras` with them, in the space of `scene`, if it
/// is empty.
///
/// # Errors
///
/// If `folder` is not a dataset.
pub(super) fn add_cameras(folder: &Path, scene: &Scene, cameras: &mut Vec<TrainingCamera>) -> Result<(), String> {
    let named = dataset::load_cameras(folder, "train", None, &LoadOptions::default()).map_err(|e| e.to_string())?;
    if cameras.is_empty() {
        let map = scene.frame.model_from_dataset;
        cameras.extend(named.iter().map(|named| TrainingCamera::from(&named.camera.mapped(&map))));
    }
    Ok(())
}

/// Reads photograph `n` of the dataset in `folder`, composited on `background`, sRGB from 0 to 1. The players draw with a
/// pinhole, so that the photograph of another lens is resampled for one.
///
/// # Errors
///
/// If it cannot be read.
pub(super) fn photograph(folder: &Path, n: usize, background: [f32; 3]) -> Result<Option<Rgba>, String> {
    let options = LoadOptions { views: Some(n..n + 1), ..LoadOptions::default() };
    let dataset = dataset::load(folder, "train", &options).map_err(|e| e.to_string())?;
    Ok(dataset.views.into_iter().next().map(|view| {
        let mut colors = view.pixels.colors(background);
        if !view.camera.lens.is_pinhole() {
            colors = undistorted(&colors, &view.camera, background);
        }
        let opaque = |[r, g, b]: [f32; 3]| [r, g, b, 1.0].map(|v| byte(v.into()));
        ([view.camera.width, view.camera.height], colors.into_iter().flat_map(opaque).collect())
    }))
}

/// The picture `colors` of `camera` as [`Camera::undistorted`] sees it; `background` outside it.
fn undistorted(colors: &[[f32; 3]], camera: &Camera, background: [f32; 3]) -> Vec<[f32; 3]> {
    let size = [camera.width, camera.height];
    let color_at = |at: DVec2| between_four(size, at.as_vec2(), |number| colors[number].into()).to_array();
    let seen = |ray: Ray| camera.project(ray.at(1.0)).filter(|&at| camera.is_inside(at));
    let pinhole = camera.undistorted();
    pinhole.rays(0..camera.height).map(|ray| ray.and_then(seen).map_or(background, color_at)).collect()
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;
    use strivec_format::geometry::{Distortion, Lens, Projection};

    #[test]
    fn undistorted_photographs_are_those_of_a_pinhole() {
        let pinhole = Camera::looking_at([60, 40], 50.0, DVec3::new(0.0, -3.0, 0.5), DVec3::ZERO, DVec3::Z);
        let distortion = Distortion::new([0.3, -0.03, 0.0, 0.0], [0.0; 3], [0.0; 2], [0.0; 2]).unwrap();
        let camera = Camera { lens: Lens { projection: Projection::Perspective, distortion }, ..pinhole };
        // A smooth function of the direction, so that interpolation costs little.
        let picture = |camera: &Camera| -> Vec<[f32; 3]> {
            let color =
                |ray: Option<Ray>| ray.unwrap().direction.to_array().map(|v| (0.5 + 0.5 * (3.0 * v).sin()) as f32);
            camera.rays(0..camera.height).map(color).collect()
        };
        let difference = |a: &[[f32; 3]], b: &[[f32; 3]]| -> f32 {
            let inner = |n: &usize| (8..52).contains(&(n % 60)) && (8..32).contains(&(n / 60));
            let pixel = |n: usize| (0..3).map(move |c| (a[n][c] - b[n][c]).abs());
            (0..a.len()).filter(inner).flat_map(pixel).fold(0.0, f32::max)
        };
        let (taken, wanted) = (picture(&camera), picture(&pinhole));
        assert!(difference(&taken, &wanted) > 0.01, "the distortion shows");
        assert!(difference(&undistorted(&taken, &camera, [0.0; 3]), &wanted) < 1e-3, "it is gone");
    }
}
