//! The rays that training draws from.

use rayon::prelude::*;

use super::{Target, TrainConfig};
use crate::dataset::View;
use crate::field::{Field, Real, vectorized};
use crate::geometry::{Camera, Ray};
use crate::model::Frame;
use crate::random::Random;

/// RaySampler in the model's space, and which of their pixels are trained on.
#[derive(Debug)]
pub struct RaySampler<'a> {
    views: &'a [View],
    cameras: Vec<Camera>,
    /// \[view\] the number of its first pixel, and the number of pixels.
    firsts: Vec<u64>,
    /// Numbers of the pixels whose rays meet the model, ascending.
    kept: Vec<u32>,
    /// Behind transparent pixels.
    background: [f32; 3],
    /// Random backgrounds instead, and for \[view\] whether it has them.
    random: Option<(Random, Vec<bool>)>,
}

impl<'a> RaySampler<'a> {
    /// All pixels of `views`, whose cameras `frame` maps into the model's space; none kept yet. `config` says what is
    /// behind transparent ones: `frame`'s background or random ones.
    ///
    /// # Panics
    ///
    /// On 2³² pixels or more.
    pub fn new(views: &'a [View], frame: &Frame, config: &TrainConfig) -> Self {
        let mut firsts = vec![0];
        for view in views {
            firsts.push(firsts[firsts.len() - 1] + view.pixels.len() as u64);
        }
        assert!(firsts[views.len()] < 1 << 32, "{} pixels are more than a run can number", firsts[views.len()]);
        let cameras = views.iter().map(|v| v.camera.mapped(&frame.model_from_dataset)).collect();
        let random = config.random_background.then(|| {
            let transparent = views.par_iter().map(|v| !v.pixels.is_opaque()).collect();
            (Random::new(config.seed, "backgrounds"), transparent)
        });
        Self { views, cameras, firsts, kept: Vec::new(), background: frame.background, random }
    }

    /// Keeps the pixels whose rays have at least one sample in the model (DESIGN, section 2: Training).
    pub fn keep_rays_that_meet<T: Real>(&mut self, field: &Field<T>) {
        let rows: Vec<(usize, u32)> = (self.cameras.iter().enumerate())
            .flat_map(|(v, camera)| (0..camera.height).map(move |row| (v, row)))
            .collect();
        let kept_of_row = |&(v, row): &(usize, u32)| {
            let camera = &self.cameras[v];
            let first = self.firsts[v] as u32 + row * camera.width;
            let meets = |column: &u32| {
                vectorized(
                    #[inline(always)]
                    || field.first_sample(&camera.ray(*column, row)).is_some(),
                )
            };
            (0..camera.width).filter(meets).map(|column| first + column).collect::<Vec<u32>>()
        };
        self.kept = rows.par_iter().map(kept_of_row).flatten_iter().collect();
    }

    /// Number of kept pixels.
    pub fn kept_count(&self) -> usize {
        self.kept.len()
    }

    /// One bit a pixel, least significant first: whether it is kept.
    pub fn active_ray_mask(&self) -> Vec<u8> {
        let mut bits = vec![0; self.firsts[self.views.len()].div_ceil(8) as usize];
        for &pixel in &self.kept {
            bits[pixel as usize / 8] |= 1 << (pixel % 8);
        }
        bits
    }

    /// Keeps what [`RaySampler::active_ray_mask`] told; false where it told of another number of pixels.
    pub fn restore_active_rays(&mut self, bits: &[u8]) -> bool {
        let pixels = self.firsts[self.views.len()];
        if bits.len() as u64 != pixels.div_ceil(8) {
            return false;
        }
        self.kept = (0..pixels as u32).filter(|&p| bits[p as usize / 8] >> (p % 8) & 1 == 1).collect();
        true
    }

    /// A checksum of all pixels and cameras, to tell a resumed run's photographs from others.
    pub fn checksum(&self) -> u32 {
        let mut hasher = crc32fast::Hasher::new();
        for (view, camera) in self.views.iter().zip(&self.cameras) {
            hasher.update(view.pixels.bytes());
            hasher.update(format!("{camera:?}").as_bytes());
        }
        hasher.finalize()
    }

    /// The kept ray number `draw` of an endless sequence in which every kept ray comes once before any comes again, as long
    /// as the same are kept; what is behind it, and the color that was photographed there.
    pub fn draw(&self, order: &Random, draw: u64) -> (Ray, Target) {
        let kept = self.kept.len() as u64;
        let at = order.substream(draw / kept).permuted(draw % kept, kept);
        let pixel = u64::from(self.kept[at as usize]);
        let v = self.firsts.partition_point(|&first| first <= pixel) - 1;
        let within = (pixel - self.firsts[v]) as u32;
        let camera = &self.cameras[v];
        let ray = camera.ray(within % camera.width, within / camera.width);
        let background = match &self.random {
            Some((random, transparent)) if transparent[v] => [0, 1, 2].map(|c| random.uniform(3 * draw + c) as f32),
            _ => self.background,
        };
        (ray, Target { color: self.views[v].pixels.color(within as usize, background), background })
    }
}
