//! Random pixels of photographs, and the check of their cameras.

use crate::dataset::{Dataset, View};
use crate::geometry::{Camera, Ray};
use crate::prior::Error;
use crate::random::Random;

/// Draws random pixels of a dataset, with their rays and colors.
pub(super) struct RaySampler<'a> {
    dataset: &'a Dataset,
    /// \[view + 1\]: index of each view's first pixel among all pixels, then the number of all.
    begins: Vec<u64>,
    /// sRGB color behind transparent pixels.
    background: [f32; 3],
}

impl<'a> RaySampler<'a> {
    pub(super) fn new(dataset: &'a Dataset, background: [f32; 3]) -> Result<Self, Error> {
        check_views(dataset)?;
        let mut begins = vec![0];
        for view in &dataset.views {
            begins.push(begins[begins.len() - 1] + view.pixels.len() as u64);
        }
        Ok(Self { dataset, begins, background })
    }

    /// The ray and the color of random pixel `draw`.
    pub(super) fn pixel(&self, random: &Random, draw: u64) -> (Ray, [f32; 3]) {
        let number = random.below(draw, self.begins[self.begins.len() - 1]);
        let index = self.begins.partition_point(|&b| b <= number) - 1;
        let view = &self.dataset.views[index];
        let pixel = (number - self.begins[index]) as u32;
        let ray = view.camera.ray(pixel % view.camera.width, pixel / view.camera.width);
        (ray, view.pixels.color(pixel as usize, self.background))
    }

    pub(super) fn views(&self) -> &[View] {
        &self.dataset.views
    }

    pub(super) fn cameras(&self) -> Vec<Camera> {
        self.dataset.views.iter().map(|v| v.camera).collect()
    }
}

/// Checks that the dataset has views, each with a finite camera and one pixel for each of the camera's.
pub(crate) fn check_views(dataset: &Dataset) -> Result<(), Error> {
    for view in &dataset.views {
        let camera = &view.camera;
        let wrong = |expected: &str, found: String| {
            Err(Error::View { view: view.name.clone(), expected: expected.into(), found })
        };
        let pixels = u64::from(camera.width) * u64::from(camera.height);
        if pixels == 0 || pixels != view.pixels.len() as u64 {
            let found = format!("{} for {} x {}", view.pixels.len(), camera.width, camera.height);
            return wrong("one pixel for each of the camera's, at least one", found);
        }
        if !camera.position.is_finite() || !camera.ray(0, 0).direction.is_finite() {
            return wrong("a finite camera", format!("{camera:?}"));
        }
    }
    if dataset.views.is_empty() {
        return Err(Error::NoViews { dataset: dataset.name.clone() });
    }
    Ok(())
}
