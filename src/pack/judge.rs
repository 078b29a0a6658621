//! How much pictures lose.

use super::Views;
use crate::dataset::View;
use crate::geometry::Camera;
use crate::model::Scene;
use crate::render::{CpuRenderer, Renderer};

/// Pictures to hold a scene's against.
#[derive(Clone, Debug)]
pub struct Judge {
    /// In the model's space.
    cameras: Vec<Camera>,
    /// \[camera\]\[pixel\].
    pictures: Vec<Vec<[f32; 3]>>,
    against: Against,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Against {
    /// Some of which may come out the same, so that errors are averaged and not their logarithms.
    OwnPictures,
    Photographs,
}

impl Judge {
    /// Against `scene`'s own pictures from `views`.
    pub fn new(scene: &Scene, views: Views) -> Self {
        let pictures = pictures(scene, &views.cameras).collect();
        Self { cameras: views.cameras, pictures, against: Against::OwnPictures }
    }

    /// Against photographs of what `scene` shows.
    pub fn from_photographs(scene: &Scene, views: &[View]) -> Self {
        Self {
            cameras: views.iter().map(|view| view.camera.mapped(&scene.frame.model_from_dataset)).collect(),
            pictures: views.iter().map(|view| view.pixels.colors(scene.frame.background)).collect(),
            against: Against::Photographs,
        }
    }

    /// The mean squared error of `scene`'s pictures: over all pixels and channels against its own pictures; against
    /// photographs that whose PSNR is the mean of the views'.
    pub fn error(&self, scene: &Scene) -> f64 {
        let of_view = |(before, after): (&Vec<[f32; 3]>, Vec<[f32; 3]>)| {
            let differences = before.iter().zip(&after).flat_map(|(b, a)| (0..3).map(move |c| f64::from(b[c] - a[c])));
            (differences.map(|d| d * d).sum::<f64>(), 3 * before.len())
        };
        let errors = self.pictures.iter().zip(pictures(scene, &self.cameras)).map(of_view);
        match self.against {
            Against::OwnPictures => {
                let (sum, count) = errors.fold((0.0, 0), |(sum, count), (e, n)| (sum + e, count + n));
                sum / count.max(1) as f64
            }
            Against::Photographs => {
                let logarithms = errors.map(|(sum, count)| (sum / count.max(1) as f64).ln());
                (logarithms.sum::<f64>() / self.pictures.len().max(1) as f64).exp()
            }
        }
    }
}

/// The colors that `cameras` see, one picture at a time.
fn pictures(scene: &Scene, cameras: &[Camera]) -> impl Iterator<Item = Vec<[f32; 3]>> {
    let renderer = CpuRenderer::<f32>::new(scene);
    cameras.iter().map(move |camera| renderer.render(camera).pixels.iter().map(|pixel| pixel.color).collect())
}
