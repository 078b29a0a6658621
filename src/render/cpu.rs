//! The fast CPU renderer: the fast field in f32, rays in fixed chunks over all threads.

use rayon::prelude::*;

use super::{Pixel, Renderer};
use crate::field::{Activations, Field, Real, Samples, Stage, Work, vectorised};
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
    pub fn new(scene: &Scene) -> Self {
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
        let chunks: Vec<_> = rays
            .par_chunks(RAYS_PER_CHUNK)
            .map_init(Default::default, |(samples, activations), chunk| {
                vectorised(
                    #[inline(always)]
                    || self.trace_chunk(chunk, samples, activations),
                )
            })
            .collect();
        let (mut pixels, mut work) = (Vec::with_capacity(rays.len()), Work::default());
        for (of_chunk, chunk_work) in chunks {
            pixels.extend(of_chunk);
            work.add(&chunk_work);
        }
        (pixels, work)
    }

    #[inline(always)]
    fn trace_chunk(
        &self,
        rays: &[Ray],
        samples: &mut Samples<T>,
        activations: &mut Activations<T>,
    ) -> (Vec<Pixel>, Work) {
        self.field.march(rays, samples);
        self.field.choose_colored(samples, None, &mut activations.colored);
        self.field.decode(rays, samples, activations);
        let pixels = (0..rays.len())
            .map(|r| {
                let remaining = samples.remaining[r];
                let color = activations.pixel(r, self.field.background.map(|c| remaining * c));
                let (mut weights, mut distances) = (T::zero(), T::zero());
                for &place in &samples.order[samples.of_ray(r)] {
                    let weight = samples.weight(place as usize);
                    weights += weight;
                    distances += weight * samples.distances[place as usize];
                }
                let depth = if weights > T::zero() { distances / weights } else { T::zero() };
                Pixel { color: color.map(T::f32), opacity: (T::one() - remaining).f32(), depth: depth.f32() }
            })
            .collect();
        samples.clock.lap(Stage::Composite);
        (pixels, std::mem::take(&mut samples.clock.work))
    }
}

impl<T: Real> Renderer for CpuRenderer<T> {
    fn trace(&self, rays: &[Ray]) -> Vec<Pixel> {
        self.trace_with_work(rays).0
    }
}
