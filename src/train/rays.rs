//! Batches of rays, and the colors of a field along them.

use glam::UVec3;
use rayon::prelude::*;

use super::chunk::RAYS_PER_CHUNK;
use super::ray_errors::DrawnPixel;
use super::{RaySampler, Target};
use strivec_field::{Activations, Field, Samples, vectorized};
use strivec_format::color_map::ColorMap;
use strivec_format::geometry::{Ray, morton};
use strivec_format::psnr::psnr_of_mse;
use strivec_format::random::Random;

/// Bits per axis of the order of rays in space.
const ORDER_BITS: u32 = 10;

/// Rays with their photographed colors.
#[derive(Clone, Debug)]
pub struct RayBatch {
    /// \[ray\] in the model's space.
    pub rays: Vec<Ray>,
    /// \[ray\].
    pub targets: Vec<Target>,
}

impl RayBatch {
    /// `count` rays of `sampler`, from index `first` of `order`'s sequence on.
    pub fn draw(sampler: &RaySampler<'_>, field: &Field<f32>, order: &Random, first: u64, count: usize) -> Self {
        let drawn = |draw| DrawnPixel { draw, pixel: sampler.pixel(order, draw), weight: 1.0 };
        Self::of_pixels(sampler, field, &(first..first + count as u64).into_par_iter().map(drawn).collect::<Vec<_>>()).0
    }

    /// The rays of these pixels, and \[ray\] the block of pixels of each, of [`RaySampler::block`]. They are sorted in space,
    /// so that rays of a chunk share tensors and most of their reads are served by the cache.
    pub(super) fn of_pixels(sampler: &RaySampler<'_>, field: &Field<f32>, pixels: &[DrawnPixel]) -> (Self, Vec<u32>) {
        let ray_of = |drawn: &DrawnPixel| {
            let (ray, target) = sampler.ray(drawn.pixel, drawn.draw);
            let target = Target { weight: drawn.weight, ..target };
            (place_in_space(field, &ray), ray, target, sampler.block(drawn.pixel))
        };
        let drawn: Vec<_> = pixels.par_iter().map(ray_of).collect();
        let mut order: Vec<(u64, usize)> = drawn.iter().map(|d| d.0).zip(0..).collect();
        // Ties are broken by the draw, so the order depends on the rays alone.
        order.sort_unstable();
        let in_order = || order.iter().map(|&(_, n)| &drawn[n]);
        let rays = in_order().map(|d| d.1).collect();
        let targets = in_order().map(|d| d.2).collect();
        (Self { rays, targets }, in_order().map(|d| d.3).collect())
    }

    /// \[ray\] the color of `field`; the same on any number of threads.
    pub fn colors(&self, field: &Field<f32>) -> Vec<[f32; 3]> {
        colors(field, &self.rays, |ray| self.targets[ray].background)
    }

    /// The PSNR of `field` against the photographed colors, in dB. \[view\] `maps` from the scene's colors to those of
    /// photographs; none if empty.
    pub fn psnr(&self, field: &Field<f32>, maps: &[ColorMap]) -> f64 {
        let squared = |(color, target): (&[f32; 3], &Target)| {
            let color = color.map(f64::from);
            let color = maps.get(target.view as usize).map_or(color, |map| map.apply(color));
            (0..3).map(|c| (color[c] - f64::from(target.color[c])).powi(2)).sum::<f64>()
        };
        let error: f64 = self.colors(field).iter().zip(&self.targets).map(squared).sum();
        psnr_of_mse(error / (3 * self.rays.len().max(1)) as f64)
    }
}

/// The Morton code of the ray's first sample in `field`; the largest number for a ray without samples.
fn place_in_space(field: &Field<f32>, ray: &Ray) -> u64 {
    let size = field.bounds.size();
    let first = vectorized(
        #[inline(always)]
        || field.first_sample(ray),
    );
    let Some(position) = first else { return u64::MAX };
    let cell = |a: usize| ((f64::from(position[a]) / size[a] + 0.5) * f64::from(1 << ORDER_BITS)) as u32;
    morton::encode(UVec3::from_array([0, 1, 2].map(cell)), 1, ORDER_BITS) as u64
}

/// \[ray\] the color of `field` along `rays`, in front of its sky or else of `background`(ray).
pub(super) fn colors(field: &Field<f32>, rays: &[Ray], background: impl Fn(usize) -> [f32; 3] + Sync) -> Vec<[f32; 3]> {
    let mut colors = vec![[0.0; 3]; rays.len()];
    (rays.par_chunks(RAYS_PER_CHUNK).zip(colors.par_chunks_mut(RAYS_PER_CHUNK))).enumerate().for_each_init(
        <(Samples<f32>, Activations<f32>)>::default,
        |(samples, activations), (n, (rays, colors))| {
            vectorized(
                #[inline(always)]
                || {
                    field.march(rays, samples);
                    field.select_shaded(samples, None, &mut activations.shaded);
                    field.decode(rays, samples, activations);
                    for (ray, color) in colors.iter_mut().enumerate() {
                        let remaining = samples.remaining[ray];
                        let behind = field.behind(&rays[ray], background(n * RAYS_PER_CHUNK + ray));
                        *color = activations.pixel(ray, 1.0, behind.map(|c| remaining * c));
                    }
                },
            );
        },
    );
    colors
}
