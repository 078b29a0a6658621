//! Rays of photographs with what they should see, and what a field shows there.

use rayon::prelude::*;

use super::chunk::RAYS_PER_CHUNK;
use super::trainer::place_in_space;
use super::{RaySampler, Target};
use crate::field::{Activations, Field, Samples, vectorized};
use crate::geometry::Ray;
use crate::random::Random;

/// Rays with what they should see.
#[derive(Clone, Debug)]
pub struct RayBatch {
    /// In the model's space.
    pub rays: Vec<Ray>,
    /// \[ray\].
    pub targets: Vec<Target>,
}

impl RayBatch {
    /// `count` rays of `photographs` from number `first` of `order`'s sequence on, ordered in space so that neighbors meet
    /// the same tensors.
    pub fn draw(photographs: &RaySampler<'_>, field: &Field<f32>, order: &Random, first: u64, count: usize) -> Self {
        let mut drawn: Vec<_> = (first..first + count as u64)
            .into_par_iter()
            .map(|d| {
                let (ray, target) = photographs.draw(order, d);
                (place_in_space(field, &ray), ray, target)
            })
            .collect();
        drawn.sort_by_key(|d| d.0);
        let (rays, targets) = drawn.into_iter().map(|(_, ray, target)| (ray, target)).unzip();
        Self { rays, targets }
    }

    /// \[ray\] the color that `field` shows; the same on any number of threads.
    pub fn colors(&self, field: &Field<f32>) -> Vec<[f32; 3]> {
        colors(field, &self.rays, |ray| self.targets[ray].background)
    }

    /// How well `field` fits: the mean squared error over rays and channels, in dB.
    pub fn psnr(&self, field: &Field<f32>) -> f64 {
        let squared = |(color, target): (&[f32; 3], &Target)| {
            (0..3).map(|c| f64::from(color[c] - target.color[c]).powi(2)).sum::<f64>()
        };
        let error: f64 = self.colors(field).iter().zip(&self.targets).map(squared).sum();
        0.0 - 10.0 * (error / (3 * self.rays.len().max(1)) as f64).log10()
    }
}

/// \[ray\] the color that `field` shows of `rays`, before `background`\[ray\].
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
                        let behind = background(n * RAYS_PER_CHUNK + ray).map(|c| remaining * c);
                        *color = activations.pixel(ray, behind);
                    }
                },
            );
        },
    );
    colors
}
