//! The fast CPU renderer: the fast field in f32, rays in fixed chunks over all threads.

use rayon::prelude::*;

use super::{Pixel, Renderer};
use crate::field::{Activations, Field, Real, Samples, Work, vectorised};
use crate::geometry::Ray;
use crate::model::Scene;

/// Rays that are marched and decoded together: enough for the decoder's products, few enough for the cache.
const RAYS_PER_CHUNK: usize = 64;

/// Renders a scene on all threads of the current pool. Generic so that the very same code can be run in f64.
pub struct CpuRenderer<T = f32> {
    field: Field<T>,
}

impl CpuRenderer<f32> {
    /// Prepares `scene`, which must have passed [`Scene::check`].
    ///
    /// # Panics
    ///
    /// Where [`super::check_supported`] fails.
    pub fn new(scene: &Scene) -> Self {
        super::insist_on_support(scene);
        Self { field: Field::new(scene) }
    }
}

impl<T: Real> CpuRenderer<T> {
    /// Renders with `field`.
    pub fn of_field(field: Field<T>) -> Self {
        Self { field }
    }

    /// As [`Renderer::trace`], and what it took.
    pub fn trace_with_work(&self, rays: &[Ray]) -> (Vec<Pixel>, Work) {
        (self.trace(rays), Work::default())
    }

    #[inline(always)]
    fn trace_chunk(&self, rays: &[Ray], samples: &mut Samples<T>, activations: &mut Activations<T>) -> Vec<Pixel> {
        self.field.march(rays, samples);
        self.field.decode(rays, samples, activations);
        (0..rays.len())
            .map(|r| {
                let remaining = samples.remaining[r];
                let mut color = self.field.background.map(|c| remaining * c);
                for c in samples.colored_of_ray(r) {
                    let sample = samples.colored[c] as usize;
                    let weight = samples.transmittances[sample] * samples.alphas[sample];
                    for (sum, &value) in color.iter_mut().zip(&activations.colors[c]) {
                        *sum += weight * value;
                    }
                }
                let (mut weights, mut distances) = (T::zero(), T::zero());
                for sample in samples.of_ray(r) {
                    let weight = samples.transmittances[sample] * samples.alphas[sample];
                    weights += weight;
                    distances += weight * samples.distances[sample];
                }
                let depth = if weights > T::zero() { distances / weights } else { T::zero() };
                Pixel { color: color.map(T::f32), opacity: (T::one() - remaining).f32(), depth: depth.f32() }
            })
            .collect()
    }
}

impl<T: Real> Renderer for CpuRenderer<T> {
    fn trace(&self, rays: &[Ray]) -> Vec<Pixel> {
        rays.par_chunks(RAYS_PER_CHUNK)
            .map_init(Default::default, |(samples, activations), chunk| {
                vectorised(
                    #[inline(always)]
                    || self.trace_chunk(chunk, samples, activations),
                )
            })
            .flatten_iter()
            .collect()
    }
}
