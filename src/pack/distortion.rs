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
        Self { cameras: views.cameras, pictures, reference: Reference::OwnPictures }
    }

    /// Against photographs of what `scene` shows.
    pub fn from_photographs(scene: &Scene, views: &[View]) -> Self {
        Self {
            cameras: views.iter().map(|view| view.camera.mapped(&scene.frame.model_from_dataset)).collect(),
            pictures: views.iter().map(|view| view.pixels.colors(scene.frame.background)).collect(),
            reference: Reference::Photographs,
        }
    }

    /// The mean squared error of `scene`'s pictures. Against own pictures it is the mean over all pixels and channels;
    /// against photographs it is the error whose PSNR is the mean of the views' PSNR.
    pub fn mse(&self, scene: &Scene) -> f64 {
        let of_view = |(before, after): (&Vec<[f32; 3]>, Vec<[f32; 3]>)| {
            let differences = before.iter().zip(&after).flat_map(|(b, a)| (0..3).map(move |c| f64::from(b[c] - a[c])));
            (differences.map(|d| d * d).sum::<f64>(), 3 * before.len())
        };
        let errors = self.pictures.iter().zip(pictures(scene, &self.cameras)).map(of_view);
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
