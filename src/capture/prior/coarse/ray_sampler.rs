//! Random pixels of photographs, and the check of their cameras.

use crate::dataset::{Dataset, Photograph};
use crate::prior::Error;
use strivec_format::Invalid;
use strivec_format::geometry::{Camera, Ray, Similarity};
use strivec_format::random::Random;

/// Draws random pixels of a dataset, with their rays and colors.
pub(super) struct PixelSampler<'a> {
    dataset: &'a Dataset,
    /// \[view + 1\]: index of each view's first pixel among all pixels that count, then the number of all.
    begins: Vec<u64>,
    /// \[view\]: the pixels that count, ascending; `None` if all do.
    counting: Vec<Option<Vec<u32>>>,
    /// sRGB color behind transparent pixels.
    background: [f32; 3],
    /// \[view\] its camera, in the space of the reconstruction.
    cameras: Vec<Camera>,
}

impl<'a> PixelSampler<'a> {
    /// The pixels of `dataset`, whose cameras `map` takes to the space of the reconstruction.
    pub(super) fn new(dataset: &'a Dataset, background: [f32; 3], map: &Similarity) -> Result<Self, Error> {
        check_views(dataset)?;
        let cameras = dataset.views.iter().map(|view| view.camera.mapped(map)).collect();
        let counting: Vec<_> = dataset.views.iter().map(Photograph::counting).collect();
        let mut begins = vec![0];
        for (view, counting) in dataset.views.iter().zip(&counting) {
            let count = counting.as_ref().map_or(view.pixels.len(), Vec::len);
            begins.push(begins[begins.len() - 1] + count as u64);
        }
        if begins[dataset.views.len()] == 0 {
            return Err(Error::NoViews { dataset: dataset.name.clone() });
        }
        Ok(Self { dataset, begins, counting, background, cameras })
    }

    /// The ray and the color of random pixel `draw`; `None` if the camera has no ray there.
    pub(super) fn pixel(&self, random: &Random, draw: u64) -> Option<(Ray, [f32; 3])> {
        let number = random.below(draw, self.begins[self.begins.len() - 1]);
        let index = self.begins.partition_point(|&b| b <= number) - 1;
        let view = &self.dataset.views[index];
        let pixel = (number - self.begins[index]) as u32;
        let pixel = self.counting[index].as_ref().map_or(pixel, |counting| counting[pixel as usize]);
        let camera = &self.cameras[index];
        let ray = camera.ray(pixel % camera.width, pixel / camera.width)?;
        Some((ray, view.pixels.color(pixel as usize, self.background)))
    }

    pub(super) fn cameras(&self) -> &[Camera] {
        &self.cameras
    }
}

/// Checks that the dataset has views, each with a finite camera and one pixel for each of the camera's.
pub fn check_views(dataset: &Dataset) -> Result<(), Error> {
    for view in &dataset.views {
        let camera = &view.camera;
        let wrong = |place: &str, expected: &str, found: String| {
            Err(Error::View { view: view.name.clone(), invalid: Invalid::new(place, expected, found) })
        };
        let pixels = u64::from(camera.width) * u64::from(camera.height);
        if pixels == 0 || pixels != view.pixels.len() as u64 {
            let found = format!("{} for {} x {}", view.pixels.len(), camera.width, camera.height);
            return wrong("the number of pixels", "one for each of the camera's, at least one", found);
        }
        if view.mask.as_ref().is_some_and(|mask| mask.len() as u64 != pixels) {
            return wrong("the mask", "one value for each pixel", format!("a mask for {pixels} pixels"));
        }
        let intrinsics = camera.focal.iter().chain(&camera.principal);
        let is_finite = camera.position.is_finite() && intrinsics.into_iter().all(|v| v.is_finite());
        if !is_finite || camera.ray(0, 0).is_some_and(|ray| !ray.direction.is_finite()) {
            return wrong("the camera", "finite", format!("{camera:?}"));
        }
    }
    if dataset.views.is_empty() {
        return Err(Error::NoViews { dataset: dataset.name.clone() });
    }
    Ok(())
}
