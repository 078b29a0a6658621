//! A picture of the scene in training beside its photograph, in a PNG file.

use std::path::PathBuf;
use std::time::{Duration, Instant};

use super::{Error, write_atomically};
use strivec_capture::dataset::Photograph;
use strivec_format::geometry::Camera;
use strivec_measure::{Sheet, color_png, side_by_side};
use strivec_train::Trainer;

/// The most columns of a picture.
const MAX_WIDTH: u32 = 400;
/// The least time between two pictures, and how many times as long as making a picture it is at least.
const LEAST_PAUSE: Duration = Duration::from_secs(2);
const PAUSES: u32 = 20;

/// The view that is shown again and again.
pub(super) struct Watch {
    path: PathBuf,
    camera: Camera,
    photograph: Sheet,
    due: Instant,
}

impl Watch {
    /// Shows `view` as a PNG file at `path`, which may be overwritten, on `background`.
    pub(super) fn new(path: PathBuf, view: &Photograph, background: [f32; 3]) -> Result<Self, Error> {
        let factor = view.camera.width.div_ceil(MAX_WIDTH).clamp(1, view.camera.height);
        let camera = view.camera.downscaled(factor);
        let photograph = downscaled(view, factor, background)?;
        Ok(Self { path, camera, photograph, due: Instant::now() })
    }

    /// True if it is time for the next picture.
    pub(super) fn is_due(&self) -> bool {
        Instant::now() >= self.due
    }

    /// Shows the scene of `trainer`.
    ///
    /// # Errors
    ///
    /// If the file cannot be written.
    pub(super) fn show(&mut self, trainer: &Trainer<'_>) -> Result<(), Error> {
        let begun = Instant::now();
        let picture = Sheet::new(self.photograph.size, trainer.picture(&self.camera))?;
        let sheet = side_by_side(&[picture, self.photograph.clone()]);
        let png = color_png(sheet.size, &sheet.colors)?;
        write_atomically(&self.path, &png, true)?;
        self.due = Instant::now() + (begun.elapsed() * PAUSES).max(LEAST_PAUSE);
        Ok(())
    }
}

/// The photograph of `view` on `background`, `factor` times smaller: the means of blocks of its pixels.
fn downscaled(view: &Photograph, factor: u32, background: [f32; 3]) -> Result<Sheet, Error> {
    let size = [view.camera.width / factor, view.camera.height / factor];
    let mut colors = Vec::new();
    for y in 0..size[1] {
        for x in 0..size[0] {
            let mut sum = [0.0; 3];
            for (j, i) in (0..factor).flat_map(|j| (0..factor).map(move |i| (j, i))) {
                let pixel = (y * factor + j) as usize * view.camera.width as usize + (x * factor + i) as usize;
                let color = view.pixels.color(pixel, background);
                sum.iter_mut().zip(color).for_each(|(sum, c)| *sum += c);
            }
            colors.push(sum.map(|sum: f32| sum / (factor * factor) as f32));
        }
    }
    Ok(Sheet::new(size, colors)?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;
    use strivec_capture::dataset::Pixels;

    #[test]
    fn a_photograph_is_shrunk_by_the_means_of_blocks() {
        let camera = Camera::looking_at([5, 2], 1.0, DVec3::X, DVec3::ZERO, DVec3::Z);
        let colors = (0..10).map(|n| [n as f32, 0.0, 1.0]);
        let view = Photograph::new("v", camera, Pixels::opaque(colors));
        let small = downscaled(&view, 2, [0.0; 3]).unwrap();
        assert_eq!((small.size, small.colors), ([2, 1], vec![[3.0, 0.0, 1.0], [5.0, 0.0, 1.0]]));
    }
}
