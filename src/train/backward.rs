//! A batch of rays, forward and backward, over all threads.

use rayon::prelude::*;

use super::NetworkLayout;
use super::chunk::{BatchRoulette, Chunk, LossTerms, RAYS_PER_CHUNK, Scratch, Target};
use super::factors::{BlockGeometry, TensorGradient};
use strivec_field::{Field, FieldFactors, Pool, Real, Roulette, Work, vectorized};
use strivec_format::color_map::ColorMap;
use strivec_format::geometry::Ray;
use strivec_format::random::Random;

/// Loss and gradients of batches of rays. Keeps its buffers from batch to batch.
#[derive(Debug)]
pub struct Backward<T> {
    /// \[view\] the maps from the scene's colors to those of photographs; none if empty.
    pub color_maps: Vec<ColorMap>,
    /// Weight in the loss of the mean visibility that is not at the known distances of rays.
    pub distance_weight: f64,
    /// A sky has gradients only of rays without samples. A sky that learns from all rays takes the color of plain walls
    /// before density grows there, and then none does.
    pub sky_of_open_rays: bool,
    pub(super) layout: NetworkLayout,
    pub(super) chunks: Vec<Chunk<T>>,
    scratch: Pool<Scratch<T>>,
}

/// The gradients of all trained parameters, for tests and tools; training itself never holds them all.
#[derive(Clone, Debug, PartialEq)]
pub struct Gradients<T> {
    /// The loss, as [`Backward::loss`] returns it.
    pub loss: T,
    /// \[scale\]\[block\] laid out as the field's factors.
    pub factors: Vec<Vec<Vec<T>>>,
    /// Laid out by [`NetworkLayout`].
    pub networks: Vec<T>,
}

impl<T: Real> Backward<T> {
    /// For batches on `field`, or on a field with the same decoder.
    pub fn new(field: &Field<T>) -> Self {
        Self {
            color_maps: Vec::new(),
            distance_weight: 0.0,
            sky_of_open_rays: false,
            layout: NetworkLayout::new(field),
            chunks: Vec::new(),
            scratch: Pool::default(),
        }
    }

    /// Runs all chunks of a batch. Returns the loss: the mean over rays and channels of the squared error, and the mean over
    /// rays of the visibility that is not at a known distance, times its weight.
    pub fn loss(&mut self, field: &Field<T>, rays: &[Ray], targets: &[Target], roulette: BatchRoulette) -> f64 {
        self.chunks.resize_with(rays.len().div_ceil(RAYS_PER_CHUNK), Chunk::default);
        let terms = LossTerms {
            maps: &self.color_maps,
            color_scale: T::of(1.0 / (3 * rays.len()) as f64),
            distance_scale: T::of(self.distance_weight / rays.len() as f64),
            sky_of_open_rays: self.sky_of_open_rays,
        };
        let (layout, scratch) = (&self.layout, &self.scratch);
        (self.chunks.par_iter_mut())
            .zip(rays.par_chunks(RAYS_PER_CHUNK).zip(targets.par_chunks(RAYS_PER_CHUNK)))
            .enumerate()
            .for_each(|(n, (chunk, (rays, targets)))| {
                // Draws are by the ray's index in the batch, not by its place in a chunk.
                let of_chunk = |t| Roulette { first_ray: (n * RAYS_PER_CHUNK) as u64, ..t };
                let roulette =
                    BatchRoulette { color: roulette.color.map(of_chunk), density: roulette.density.map(of_chunk) };
                scratch.with(|scratch| {
                    vectorized(
                        #[inline(always)]
                        || chunk.run(field, layout, rays, targets, &terms, roulette, scratch),
                    );
                });
            });
        let misplaced = self.chunks.iter().map(|c| c.misplaced).sum::<f64>() / rays.len() as f64;
        self.mean_squared_error() + self.distance_weight * misplaced
    }

    /// The mean over rays and channels of the squared error in the last batch.
    pub fn mean_squared_error(&self) -> f64 {
        let rays: usize = self.chunks.iter().map(|c| c.colors.len()).sum();
        self.chunks.iter().map(|c| c.squared_error).sum::<f64>() / (3 * rays) as f64
    }

    /// \[ray\] the scene's colors in the last batch, before any map.
    pub(super) fn colors(&self) -> impl Iterator<Item = [f32; 3]> {
        self.chunks.iter().flat_map(|chunk| chunk.colors.iter().copied())
    }

    /// \[ray\] the mean over channels of the squared error in the last batch.
    pub(super) fn squared_errors(&self) -> impl Iterator<Item = f32> {
        self.chunks.iter().flat_map(|chunk| chunk.squared_errors.iter().copied())
    }

    /// Counts and times of the last batch, over all chunks.
    pub fn work(&self) -> Work {
        let mut work = Work::default();
        self.chunks.iter().for_each(|c| work.add(&c.work));
        work
    }

    /// The gradients of the shared weights, summed over chunks in their order.
    pub(super) fn network_gradients(&self) -> Vec<T> {
        const BLOCK: usize = 4096;
        let mut sums = vec![T::zero(); self.layout.len()];
        // Threads share the weights, not the chunks: each sum runs over the chunks in their order, on any number of
        // threads.
        sums.par_chunks_mut(BLOCK).enumerate().for_each(|(block, sums)| {
            for chunk in &self.chunks {
                let gradients = &chunk.network_gradients[block * BLOCK..][..sums.len()];
                sums.iter_mut().zip(gradients).for_each(|(sum, &g)| *sum += g);
            }
        });
        sums
    }

    /// The loss of a batch and all its gradients, by the same code that training runs.
    pub fn gradients(
        &mut self,
        field: &Field<T>,
        rays: &[Ray],
        targets: &[Target],
        roulette: BatchRoulette,
    ) -> Gradients<T> {
        let loss = T::of(self.loss(field, rays, targets, roulette));
        let networks = self.network_gradients();
        let tensors = Pool::<TensorGradient<T>>::default();
        let mut factors = Vec::new();
        for (scale, geometries) in field.scales.iter().zip(BlockGeometry::of(field, field.decoder.own_rows())) {
            let of_block = |(block, geometry): (&FieldFactors<T>, BlockGeometry<'_, T>)| {
                let geometry = geometry.at(&scale.centers);
                let mut gradients = vec![T::zero(); block.values().len()];
                let by_tensor = block.held().split_mut(&mut gradients);
                by_tensor.into_par_iter().enumerate().for_each(|(n, gradients)| {
                    tensors.with(|tensor| {
                        tensor.accumulate(geometry, n, &block.values()[block.held().values(n)], &self.chunks);
                        gradients.copy_from_slice(&tensor.values);
                    });
                });
                gradients
            };
            factors.push(scale.blocks().zip(geometries).map(of_block).collect());
        }
        Gradients { loss, factors, networks }
    }
}

impl Backward<f32> {
    /// The gradients of the colors of `field` along `rays`, each channel with a random sign from `signs`. Squared, each
    /// is an unbiased estimate of the mean over rays and channels of (∂color/∂parameter)², and so is the squared
    /// derivative along any direction (Hutchinson's estimator).
    pub fn picture_gradients(&mut self, field: &Field<f32>, rays: &[Ray], signs: &Random) -> Gradients<f32> {
        let sign = |n: usize| if signs.bits(n as u64) & 1 == 0 { 1.0 } else { -1.0 };
        // The loss's gradient is the error times 2/(3·rays). With this error it is 1/√(3·rays).
        let size = 0.5 * (3.0 * rays.len() as f32).sqrt();
        let colors = super::rays::colors(field, rays, |_| field.background);
        let target = |(ray, color): (usize, &[f32; 3])| Target {
            color: [0, 1, 2].map(|c| color[c] - size * sign(3 * ray + c)),
            background: field.background,
            view: 0,
            distance: 0.0,
            weight: 1.0,
        };
        let targets: Vec<Target> = colors.iter().enumerate().map(target).collect();
        self.gradients(field, rays, &targets, BatchRoulette::default())
    }
}
