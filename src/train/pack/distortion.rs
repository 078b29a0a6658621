//! Distortion: the mean squared error of pictures against reference pictures.

use super::ModelCameras;
use strivec_capture::dataset::Photograph;
use strivec_field::render::{CpuRenderer, Renderer};
use strivec_format::geometry::Camera;
use strivec_format::model::Scene;

/// Reference pictures that the pictures of scenes are compared with.
#[derive(Clone, Debug)]
pub struct ReferencePictures {
    /// Cameras of the pictures, in model space.
    cameras: Vec<Camera>,
    /// \[camera\].
    pictures: Vec<ReferencePicture>,
    reference: Reference,
}

#[derive(Clone, Debug)]
struct ReferencePicture {
    colors: Vec<[f32; 3]>,
    /// The pixels that count; `None` if all do.
    counting: Option<Vec<u32>>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Reference {
    /// Some pictures may be equal to theirs: errors are averaged, not their logarithms.
    OwnPictures,
    Photographs,
}

impl ReferencePictures {
    /// Against no pictures: always 0.
    pub fn of_nothing() -> Self {
        Self { cameras: Vec::new(), pictures: Vec::new(), reference: Reference::OwnPictures }
    }

    /// Against `scene`'s own pictures from `views`.
    pub fn from_own_pictures(scene: &Scene, views: ModelCameras) -> Self {
        let own = |colors| ReferencePicture { colors, counting: None };
        let pictures = pictures(scene, &views.cameras).map(own).collect();
        Self { cameras: views.cameras, pictures, reference: Reference::OwnPictures }
    }

    /// Against photographs of what `scene` shows.
    pub fn from_photographs(scene: &Scene, views: &[Photograph]) -> Self {
        let photograph = |view: &Photograph| ReferencePicture {
            colors: view.pixels.colors(scene.frame.background),
            counting: view.counting(),
        };
        Self {
            cameras: views.iter().map(|view| view.camera.mapped(&scene.frame.model_from_dataset)).collect(),
            pictures: views.iter().map(photograph).collect(),
            reference: Reference::Photographs,
        }
    }

    /// The mean squared error of `scene`'s pictures. Against own pictures it is the mean over all pixels and channels;
    /// against photographs it is the error whose PSNR is the mean of the views' PSNR.
    pub fn mse(&self, scene: &Scene) -> f64 {
        let errors =
            self.pictures.iter().zip(pictures(scene, &self.cameras)).map(|(before, after)| before.error(&after));
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

impl ReferencePicture {
    /// The sum of the squared differences to `after`, and their number.
    fn error(&self, after: &[[f32; 3]]) -> (f64, usize) {
        let squared = |b: [f32; 3], a: [f32; 3]| (0..3).map(move |c| f64::from(b[c] - a[c])).map(|d| d * d);
        match &self.counting {
            None => (self.colors.iter().zip(after).flat_map(|(b, a)| squared(*b, *a)).sum(), 3 * after.len()),
            Some(pixels) => {
                let errors = pixels.iter().flat_map(|&n| squared(self.colors[n as usize], after[n as usize]));
                (errors.sum(), 3 * pixels.len())
            }
        }
    }
}

/// \[camera\]\[pixel\] the colors of `scene`, one picture at a time.
fn pictures(scene: &Scene, cameras: &[Camera]) -> impl Iterator<Item = Vec<[f32; 3]>> {
    let renderer = CpuRenderer::<f32>::unlimited(scene);
    cameras.iter().map(move |camera| renderer.render(camera).pixels.iter().map(|pixel| pixel.color).collect())
}
