//! Distortion: the mean squared error of pictures against reference pictures.

use super::Views;
use crate::dataset::View;
use crate::geometry::Camera;
use crate::model::Scene;
use crate::render::{CpuRenderer, Renderer};

/// Reference pictures that the pictures of scenes are compared with.
#[derive(Clone, Debug)]
pub struct Distortion {
    /// In the model's space.
    cameras: Vec<Camera>,
    /// \[camera\]\[pixel\].
    pictures: Vec<Vec<[f32; 3]>>,
    /// \[camera\] the pixels that count; `None` if all do.
    counting: Vec<Option<Vec<u32>>>,
    reference: Reference,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Reference {
    /// Some pictures may be equal to theirs: errors are averaged, not their logarithms.
    OwnPictures,
    Photographs,
}

impl Distortion {
    /// Against `scene`'s own pictures from `views`.
    pub fn from_own_pictures(scene: &Scene, views: Views) -> Self {
        let pictures = pictures(scene, &views.cameras).collect();
        let counting = vec![None; views.cameras.len()];
        Self { cameras: views.cameras, pictures, counting, reference: Reference::OwnPictures }
    }

    /// Against photographs of what `scene` shows.
    pub fn from_photographs(scene: &Scene, views: &[View]) -> Self {
        Self {
            cameras: views.iter().map(|view| view.camera.mapped(&scene.frame.model_from_dataset)).collect(),
            pictures: views.iter().map(|view| view.pixels.colors(scene.frame.background)).collect(),
            counting: views.iter().map(View::counting).collect(),
            reference: Reference::Photographs,
        }
    }

    /// The mean squared error of `scene`'s pictures. Against own pictures it is the mean over all pixels and channels;
    /// against photographs it is the error whose PSNR is the mean of the views' PSNR.
    pub fn mse(&self, scene: &Scene) -> f64 {
        let squared = |before: [f32; 3], after: [f32; 3]| (0..3).map(move |c| f64::from(before[c] - after[c]).powi(2));
        let of_view = |((before, counting), after): ((&Vec<[f32; 3]>, &Option<Vec<u32>>), Vec<[f32; 3]>)| match counting
        {
            None => (before.iter().zip(&after).flat_map(|(b, a)| squared(*b, *a)).sum::<f64>(), 3 * before.len()),
            Some(pixels) => {
                let errors = pixels.iter().flat_map(|&n| squared(before[n as usize], after[n as usize]));
                (errors.sum::<f64>(), 3 * pixels.len())
            }
        };
        let references = self.pictures.iter().zip(&self.counting);
        let errors = references.zip(pictures(scene, &self.cameras)).map(of_view);
        match self.reference {
            Reference::OwnPictures => {
                let (sum, count) = errors.fold((0.0, 0), |(sum, count), (e, n)| (sum + e, count + n));
                sum / count.max(1) as f64
            }
            Reference::Photographs => {
                let logarithms = errors.map(|(sum, count)| (sum / count.max(1) as f64).ln());
                (logarithms.sum::<f64>() / self.pictures.len().max(1) as f64).exp()
            }
        }
    }
}

/// \[camera\]\[pixel\] the colors of `scene`, one picture at a time.
fn pictures(scene: &Scene, cameras: &[Camera]) -> impl Iterator<Item = Vec<[f32; 3]>> {
    let renderer = CpuRenderer::<f32>::new(scene);
    cameras.iter().map(move |camera| renderer.render(camera).pixels.iter().map(|pixel| pixel.color).collect())
}
