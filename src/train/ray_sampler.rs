//! The rays that training draws from.

use rayon::prelude::*;

use super::pixel_blocks::Blocks;
use super::pixel_set::PixelSet;
use super::{Target, TrainConfig, TrainError};
use strivec_capture::dataset::Photograph;
use strivec_field::{Field, Real, vectorized};
use strivec_format::geometry::{Camera, Ray};
use strivec_format::model::Frame;
use strivec_format::random::Random;

/// Draws rays of photographs, in the model's space. A ray is active if it is trained on.
#[derive(Debug)]
pub struct RaySampler<'a> {
    views: &'a [Photograph],
    cameras: Vec<Camera>,
    /// \[view\] the index of its first pixel; at the end, the number of pixels.
    firsts: Vec<u64>,
    blocks: Blocks,
    /// The pixels whose rays are active.
    active: PixelSet,
    /// Model units in one unit of the dataset.
    unit: f32,
    /// The color behind transparent pixels.
    background: [f32; 3],
    /// The stream of random backgrounds, and \[view\] true if it has them; `None` if `background` is behind all pixels.
    random: Option<(Random, Vec<bool>)>,
}

impl<'a> RaySampler<'a> {
    /// The rays of all pixels of `views`, whose cameras `frame` maps into the model's space; none is active yet.
    /// Transparent pixels are in front of `frame`'s background, or of random ones if `config.photographs.random_background`.
    ///
    /// # Errors
    ///
    /// [`TrainError::TooManyPixels`].
    pub fn new(views: &'a [Photograph], frame: &Frame, config: &TrainConfig) -> Result<Self, TrainError> {
        let mut firsts = vec![0];
        for view in views {
            firsts.push(firsts[firsts.len() - 1] + view.pixels.len() as u64);
        }
        check_pixel_count(firsts[views.len()])?;
        let cameras = views.iter().map(|v| v.camera.mapped(&frame.model_from_dataset)).collect();
        let blocks = Blocks::new(views.iter().map(|v| [v.camera.width, v.camera.height]));
        let random = config.photographs.random_background.then(|| {
            let transparent = views.par_iter().map(|v| !v.pixels.is_opaque()).collect();
            (Random::new(config.seed, "backgrounds"), transparent)
        });
        let unit = frame.model_from_dataset.scale as f32;
        let (active, background) = (PixelSet::default(), frame.background);
        Ok(Self { views, cameras, firsts, blocks, active, unit, background, random })
    }

    /// Makes the rays active that have at least one sample in `field` or, if it has a sky, see it, and no others.
    pub fn filter_rays<T: Real>(&mut self, field: &Field<T>) {
        // Rows as tasks: photographs are too few and pixels too many.
        let rows: Vec<(usize, u32)> = (self.cameras.iter().enumerate())
            .flat_map(|(v, camera)| (0..camera.height).map(move |row| (v, row)))
            .collect();
        let add_row = |&(v, row): &(usize, u32), add: &(dyn Fn(u64) + Sync)| {
            let camera = &self.cameras[v];
            let first = self.firsts[v] + u64::from(row * camera.width);
            let counts = |column: u32| self.views[v].counts((row * camera.width + column) as usize);
            // A sky learns from rays that meet nothing.
            let is_active = |column: &u32| {
                let Some(ray) = camera.ray(*column, row).filter(|_| counts(*column)) else { return false };
                vectorized(
                    #[inline(always)]
                    || field.sky.is_some() || field.first_sample(&ray).is_some(),
                )
            };
            (0..camera.width).filter(is_active).for_each(|column| add(first + u64::from(column)));
        };
        let pixels = self.firsts[self.views.len()];
        self.active = PixelSet::new(pixels, |add| rows.par_iter().for_each(|row| add_row(row, add)));
    }

    /// Puts the frame's background behind all transparent pixels: a sky has one color in a direction.
    pub(super) fn without_random_backgrounds(mut self) -> Self {
        self.random = None;
        self
    }

    /// Number of photographs.
    pub fn view_count(&self) -> usize {
        self.views.len()
    }

    /// The camera of photograph number `view`, in the model's space.
    pub(super) fn camera(&self, view: usize) -> &Camera {
        &self.cameras[view]
    }

    /// Draws all further rays from `cameras`, which differ from the present ones in their poses and
    /// focal lengths only, and have a ray for each pixel that has one.
    pub(super) fn set_cameras(&mut self, cameras: Vec<Camera>) {
        self.cameras = cameras;
    }

    /// `count` random active pixels of photograph number `view`, as columns, rows and targets; none if none is active.
    pub(super) fn sample(&self, view: usize, random: &Random, count: u64) -> Vec<(u32, u32, Target)> {
        let [first, end] = [view, view + 1].map(|view| self.active.count_before(self.firsts[view]));
        let target = |draw: u64| {
            let pixel = self.active.member(first + random.below(draw, end - first));
            let within = (pixel - self.firsts[view]) as u32;
            let width = self.cameras[view].width;
            (within % width, within / width, self.target(view, within, self.background))
        };
        if first == end { Vec::new() } else { (0..count).map(target).collect() }
    }

    fn target(&self, view: usize, within: u32, background: [f32; 3]) -> Target {
        let Photograph { pixels, distances, .. } = &self.views[view];
        let color = pixels.color(within as usize, background);
        let distance = self.unit * distances.get(within as usize).copied().unwrap_or(0.0);
        Target { color, background, view: view as u32, distance, weight: 1.0 }
    }

    /// Number of active rays.
    pub fn active_ray_count(&self) -> usize {
        self.active.len()
    }

    /// One bit per pixel, least significant first: 1 if its ray is active.
    pub fn active_ray_mask(&self) -> Vec<u8> {
        self.active.to_bytes(self.firsts[self.views.len()])
    }

    /// Restores the active rays from a mask of [`RaySampler::active_ray_mask`]. Returns `false` if its length does not
    /// match.
    pub fn restore_active_rays(&mut self, bits: &[u8]) -> bool {
        let pixels = self.firsts[self.views.len()];
        if bits.len() as u64 != pixels.div_ceil(8) {
            return false;
        }
        self.active = PixelSet::from_bytes(bits, pixels);
        true
    }

    /// A checksum of all pixels and cameras. A resumed run must have the same.
    pub fn checksum(&self) -> u32 {
        let mut hasher = crc32fast::Hasher::new();
        for (view, camera) in self.views.iter().zip(&self.cameras) {
            hasher.update(view.pixels.bytes());
            hasher.update(format!("{camera:?}").as_bytes());
        }
        hasher.finalize()
    }

    /// The active pixel of index `draw` in an endless sequence, counted over all photographs. While the same rays are
    /// active, each comes once before any comes again.
    pub fn pixel(&self, order: &Random, draw: u64) -> u64 {
        let active = self.active.len() as u64;
        // A permutation that is computed, not stored: any draw is known from its index, so that runs resume and
        // threads share nothing.
        self.active.member(order.substream(draw / active).permuted(draw % active, active))
    }

    /// The photograph, column and row of `pixel`.
    fn place(&self, pixel: u64) -> (usize, u32, u32) {
        let view = self.firsts.partition_point(|&first| first <= pixel) - 1;
        let (within, width) = ((pixel - self.firsts[view]) as u32, self.cameras[view].width);
        (view, within % width, within / width)
    }

    /// The block of pixels that `pixel` is in.
    pub(super) fn block(&self, pixel: u64) -> u32 {
        let (view, column, row) = self.place(pixel);
        self.blocks.of(view, column, row)
    }

    /// Number of blocks of pixels.
    pub(super) fn block_count(&self) -> usize {
        self.blocks.count()
    }

    /// The ray of the active `pixel`, and its target, which is the draw of index `draw`.
    pub fn ray(&self, pixel: u64, draw: u64) -> (Ray, Target) {
        let (view, column, row) = self.place(pixel);
        let ray = self.cameras[view].ray(column, row).expect("active pixels have a ray");
        // By draw, so that a resumed run has the same backgrounds.
        let background = match &self.random {
            Some((random, transparent)) if transparent[view] => [0, 1, 2].map(|c| random.uniform(3 * draw + c) as f32),
            _ => self.background,
        };
        (ray, self.target(view, (pixel - self.firsts[view]) as u32, background))
    }
}

/// Pixels are numbered by `u32`.
fn check_pixel_count(pixels: u64) -> Result<(), TrainError> {
    if pixels < 1 << 32 { Ok(()) } else { Err(TrainError::TooManyPixels { pixels }) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pixels_that_no_u32_can_number_are_an_error() {
        assert!(check_pixel_count((1 << 32) - 1).is_ok());
        let error = check_pixel_count(1 << 32).unwrap_err().to_string();
        assert!(error.contains("4294967296 pixels") && error.contains("smaller photographs"), "{error}");
    }
}
