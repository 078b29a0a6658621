//! The views of a sweep, and the pictures that renderings are compared with.

use std::path::Path;

use super::candidate::Engine;
use crate::Error;
use crate::console::Console;
use crate::render::colors;
use crate::table::plural;
use crate::view_selection::evenly_spaced;
use strivec_capture::dataset;
use strivec_capture::dataset::{Dataset, LoadOptions};
use strivec_field::render::Approximation;
use strivec_format::container::Metadata;
use strivec_format::geometry::Camera;
use strivec_format::model::Scene;
use strivec_train::pack::probe_views;

/// A camera with its expected picture.
pub(super) struct SweepCamera {
    pub(super) camera: Camera,
    /// The photograph; without a dataset the exact picture.
    pub(super) truth: Vec<[f32; 3]>,
    /// The scene rendered without approximations.
    pub(super) exact: Vec<[f32; 3]>,
}

/// A photograph's colors, and the pixels that count if not all do.
type MaskedPhotograph = (Vec<[f32; 3]>, Option<Vec<bool>>);

/// All views, and their description.
pub(super) struct SweepCameras {
    pub(super) views: Vec<SweepCamera>,
    pub(super) what: String,
}

impl SweepCameras {
    /// `count` photographs of the dataset's `split`, evenly spaced.
    pub(super) fn of_dataset(
        folder: &Path,
        split: &str,
        options: &LoadOptions,
        count: usize,
        scene: &Scene,
        console: &Console,
    ) -> Result<Self, Error> {
        let options = evenly_spaced(folder, split, count, options)?;
        let Dataset { name, views, .. } = dataset::load(folder, split, &options)?;
        let photographs = views.iter().map(|view| {
            let camera = view.camera.mapped(&scene.frame.model_from_dataset);
            (camera, Some((view.pixels.colors(scene.frame.background), view.mask.clone())))
        });
        let what = format!("{name}, {} of {split}", plural(views.len(), "view"));
        Self::of(photographs.collect(), what, scene, console)
    }

    /// The scene's exact pictures from `count` cameras: some of the file's, else where its viewpoints are, else around
    /// the scene.
    pub(super) fn own(
        scene: &Scene,
        metadata: &Metadata,
        count: usize,
        size: u32,
        console: &Console,
    ) -> Result<Self, Error> {
        let cameras = probe_views(scene, metadata.views.as_ref(), &metadata.cameras, count, size).cameras;
        let what = format!("{} of the scene", plural(cameras.len(), "exact picture"));
        Self::of(cameras.into_iter().map(|camera| (camera, None)).collect(), what, scene, console)
    }

    fn of(
        pictures: Vec<(Camera, Option<MaskedPhotograph>)>,
        what: String,
        scene: &Scene,
        console: &Console,
    ) -> Result<Self, Error> {
        if pictures.is_empty() {
            return Err(Error::Malformed("the split has no views to compare with".into()));
        }
        let mut renderer = Engine::CPU.prepare(scene.clone(), &Approximation::default(), console)?;
        let mut views = Vec::new();
        for (camera, photograph) in pictures {
            let exact = colors(&renderer.render(&camera)?);
            let mut truth = exact.clone();
            // Pixels that do not count are no error.
            if let Some((photograph, mask)) = photograph {
                let counts = |n: usize| mask.as_ref().is_none_or(|mask| mask[n]);
                truth.iter_mut().zip(photograph).enumerate().filter(|(n, _)| counts(*n)).for_each(|(_, (t, p))| *t = p);
            }
            views.push(SweepCamera { camera, truth, exact });
        }
        Ok(Self { views, what })
    }

    /// \[columns, rows\] of the first view.
    pub(super) fn size(&self) -> [u32; 2] {
        [self.views[0].camera.width, self.views[0].camera.height]
    }
}

impl SweepCamera {
    /// The view, `by` times smaller.
    pub(super) fn shrunk(&self, by: u32) -> Self {
        let size = [self.camera.width, self.camera.height];
        let camera = self.camera.downscaled(by);
        Self { truth: averaged(&self.truth, size, by), exact: averaged(&self.exact, size, by), camera }
    }
}

/// The mean of each block of `by` × `by` pixels; columns and rows of incomplete blocks are dropped.
fn averaged(colors: &[[f32; 3]], [width, height]: [u32; 2], by: u32) -> Vec<[f32; 3]> {
    let (columns, rows, by) = ((width / by) as usize, (height / by) as usize, by as usize);
    let mut small = vec![[0.0; 3]; columns * rows];
    for y in 0..rows * by {
        for x in 0..columns * by {
            let to = &mut small[y / by * columns + x / by];
            let from = &colors[y * width as usize + x];
            (0..3).for_each(|c| to[c] += from[c] / (by * by) as f32);
        }
    }
    small
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blocks_are_averaged_and_incomplete_ones_are_dropped() {
        let colors: Vec<[f32; 3]> = (0..15).map(|n| [n as f32; 3]).collect();
        let found: Vec<f32> = averaged(&colors, [5, 3], 2).iter().map(|c| c[0]).collect();
        assert_eq!(found, [3.0, 5.0]);
    }
}
