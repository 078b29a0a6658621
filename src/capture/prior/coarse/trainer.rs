//! The trainer of one grid: rays from the photographs, their samples, and an Adam step.

use std::collections::BTreeSet;

use glam::DVec3;
use rayon::prelude::*;

use super::CoarseOptions;
use super::adam::{GridAdam, SortedSamples};
use super::grid::{CoarseGrid, Live, Scalar};
use super::known::KnownVertices;
use super::ray_loss::{CompositingConstants, Medium, Sample, Segment, Shaded, density_of_alpha, trace};
use super::ray_sampler::PixelSampler;
use super::visibility::count_views;
use crate::prior::free_space::FreeSpace;
use strivec_format::geometry::{Aabb, Camera, Contraction, Ray, RayPath};
use strivec_format::random::Random;

/// Rays of one task. The number is fixed, so that sums do not depend on the number of threads.
const CHUNK: u32 = 128;
/// Steps between two updates of the live cells.
const LIVE_EVERY: u32 = 16;

/// Trains one grid (DVGO, section 4).
pub(super) struct CoarseTrainer {
    grid: CoarseGrid<f32>,
    rates: Vec<f32>,
    live: Live,
    adam: GridAdam<f32>,
    shading: CompositingConstants<f32>,
    /// Range of distances along rays, in the grid's units.
    near_far: [f64; 2],
    contraction: Option<Contraction>,
    step_size: f64,
    rays: u32,
    chunks: Vec<TaskBuffers>,
    batches: Vec<SortedSamples<f32>>,
}

/// Buffers of one task, reused at every step.
#[derive(Default)]
struct TaskBuffers {
    samples: Vec<Sample<f32>>,
    shaded: Vec<Shaded<f32>>,
    squared: f64,
}

impl CoarseTrainer {
    /// A trainer of `grid`, whose voxels are `finest_voxels` times as large as those of the finest grid. `near_far` is in
    /// the units of the photographs' cameras. Nothing is learned in `free` space.
    pub(super) fn new(
        grid: CoarseGrid<f32>,
        photographs: &PixelSampler,
        options: &CoarseOptions,
        near_far: [f64; 2],
        finest_voxels: f64,
        free: Option<&FreeSpace>,
    ) -> Self {
        let contraction = options.unbounded.map(|unbounded| unbounded.contraction);
        let mut counts = count_views(&grid, photographs.cameras(), near_far, contraction);
        if let Some(free) = free {
            counts.par_iter_mut().enumerate().filter(|(_, count)| **count > 0).for_each(|(n, count)| {
                let vertex = grid.vertex(n);
                if free.contains(contraction.map_or(vertex, |contraction| contraction.expand(vertex))) {
                    *count = 0;
                }
            });
        }
        let rates = vertex_rates(&counts, options, photographs.cameras().len());
        let shift = density_of_alpha(options.initial_alpha, 1.0);
        let interval = options.step_size * finest_voxels;
        let shading = CompositingConstants {
            shift: shift as f32,
            interval: interval as f32,
            min_density: (density_of_alpha(options.skip_alpha, interval) - shift) as f32,
            min_transmittance: options.min_transmittance as f32,
            background: options.background,
            entropy: options.background_entropy as f32,
            point_color: options.point_color as f32,
            per_ray: 1.0 / options.rays as f32,
        };
        let chunks = options.rays.div_ceil(CHUNK) as usize;
        Self {
            live: Live::of(&grid, &rates, shading.min_density),
            adam: GridAdam::new(grid.values.len(), options.learning_rate, options.adam_epsilon),
            near_far,
            contraction,
            step_size: options.step_size,
            rays: options.rays,
            chunks: (0..chunks).map(|_| TaskBuffers::default()).collect(),
            batches: (0..chunks).map(|_| SortedSamples::default()).collect(),
            rates,
            shading,
            grid,
        }
    }

    fn medium(&self) -> Medium<'_, f32> {
        Medium { grid: &self.grid, live: &self.live, shading: &self.shading, step: self.step_size as f32 }
    }

    /// The samples of `ray`, which is in the cameras' space; `None` if it misses the live cells.
    fn segment(&self, ray: &Ray) -> Option<Segment> {
        if let Some(contraction) = self.contraction {
            let path = RayPath::new(ray, &contraction.bounds(), Some(contraction), self.near_far);
            return Segment::along(path, self.step_size * self.grid.voxel);
        }
        let near_far = self.near_far.map(|t| t / self.grid.voxel).into();
        let ray = Ray { origin: self.grid.local(ray.origin), ..*ray };
        let extent = Aabb { min: DVec3::ZERO, max: self.grid.vertices.as_dvec3() - 1.0 };
        Segment::new(&ray, &extent, &self.live.bounds, near_far, self.step_size)
    }

    fn meets(&self, known: &KnownVertices, ray: &Ray) -> bool {
        known.meets(&self.grid, &RayPath::new(ray, &self.grid.bounds(), self.contraction, self.near_far))
    }

    /// The grid.
    pub(super) fn grid(&self) -> &CoarseGrid<f32> {
        &self.grid
    }

    /// The trained grid.
    pub(super) fn into_grid(self) -> CoarseGrid<f32> {
        self.grid
    }

    /// One step on random rays, drawn from (`seed`, `key`). Returns their mean squared error. `step` counts the steps
    /// on this grid.
    pub(super) fn step(&mut self, photographs: &PixelSampler, seed: u64, key: u64, step: u32) -> f64 {
        if step.is_multiple_of(LIVE_EVERY) {
            self.live = Live::of(&self.grid, &self.rates, self.shading.min_density);
        }
        // Moved out of `self`, so that tasks can change them while they read the other fields.
        let (mut chunks, mut batches) = (std::mem::take(&mut self.chunks), std::mem::take(&mut self.batches));
        let arch = pulp::Arch::new();
        let random = Random::new(seed, "coarse rays").substream(key);
        chunks.par_iter_mut().zip(&mut batches).enumerate().for_each(|(n, (chunk, batch))| {
            let n = n as u32;
            let rays = n * CHUNK..self.rays.min((n + 1) * CHUNK);
            let pixels = rays.filter_map(|ray| photographs.pixel(&random, u64::from(ray)));
            // The kernels are compiled for each instruction set; this selects the widest one of the processor.
            arch.dispatch(|| self.trace_chunk(pixels, chunk, batch));
        });
        self.adam.step(&mut self.grid, &batches, &self.rates);
        let squared = chunks.iter().map(|c| c.squared).sum::<f64>();
        (self.chunks, self.batches) = (chunks, batches);
        squared / f64::from(self.rays)
    }

    #[inline(always)]
    fn trace_chunk(
        &self,
        pixels: impl Iterator<Item = (Ray, [f32; 3])>,
        chunk: &mut TaskBuffers,
        batch: &mut SortedSamples<f32>,
    ) {
        let medium = self.medium();
        chunk.samples.clear();
        chunk.squared = 0.0;
        for (ray, target) in pixels {
            chunk.squared += match self.segment(&ray) {
                None => background_error(medium.shading.background, target),
                Some(segment) => {
                    let loss = trace(&medium, &segment, target, &mut chunk.samples, &mut chunk.shaded);
                    f64::from(loss.squared)
                }
            };
        }
        batch.sort(&chunk.samples, self.grid.plane(), self.grid.vertices.z as usize);
    }

    /// \[vertex\]: true if the voxel around the vertex holds a sample whose visibility weight exceeds that of `options` in
    /// any pixel. With `known` voxels, it is the sample at which a ray that meets none of them is half absorbed, in as many
    /// views as a surface must be in: fog is everywhere. Only some pixels are traced, by `options`.
    pub(super) fn visible(
        &mut self,
        photographs: &PixelSampler,
        options: &CoarseOptions,
        known: Option<&KnownVertices>,
    ) -> Vec<bool> {
        self.live = Live::of(&self.grid, &self.rates, self.shading.min_density);
        let cameras = photographs.cameras();
        let none = || vec![0_u32; self.grid.values.len()];
        let arch = pulp::Arch::new();
        // Sums do not depend on the order.
        let sum = |mut a: Vec<u32>, b: Vec<u32>| {
            a.iter_mut().zip(b).for_each(|(a, b)| *a += b);
            a
        };
        let views = cameras
            .par_iter()
            .with_min_len(cameras.len().div_ceil(16))
            .fold(none, |mut views, camera| {
                let seen = arch.dispatch(|| self.seen_by(camera, options, known));
                seen.into_iter().for_each(|n| views[n] += 1);
                views
            })
            .reduce(none, sum);
        let least = if known.is_some() { options.min_views.min(cameras.len() as u32) } else { 1 };
        views.into_iter().map(|count| count >= least.max(1)).collect()
    }

    /// The vertices that `camera` sees.
    #[inline(always)]
    fn seen_by(&self, camera: &Camera, options: &CoarseOptions, known: Option<&KnownVertices>) -> BTreeSet<usize> {
        let (weight, stride) = (options.min_visibility_weight as f32, options.visibility_stride as usize);
        let medium = self.medium();
        let (row, plane) = (self.grid.vertices.x as usize, self.grid.plane());
        let mut chunk = TaskBuffers::default();
        let mut seen = BTreeSet::new();
        for y in (0..camera.height).step_by(stride) {
            for x in (0..camera.width).step_by(stride) {
                let ray = camera.ray(x, y).filter(|ray| !known.is_some_and(|known| self.meets(known, ray)));
                let Some(segment) = ray.and_then(|ray| self.segment(&ray)) else { continue };
                chunk.samples.clear();
                trace(&medium, &segment, [0.0; 3], &mut chunk.samples, &mut chunk.shaded);
                let shaded = || chunk.samples.iter().zip(&chunk.shaded);
                let middle = shaded().find(|(_, s)| s.after < 0.5).filter(|_| known.is_some());
                let all = shaded().filter(|(_, s)| known.is_none() && s.weight > weight);
                seen.extend(all.chain(middle).map(|(sample, _)| {
                    let [dx, dy, dz] = sample.fraction.map(|f| usize::from(f > 0.5));
                    sample.first as usize + dz * plane + dy * row + dx
                }));
            }
        }
        seen
    }
}

fn background_error(background: [f32; 3], target: [f32; 3]) -> f64 {
    (0..3).map(|c| f64::from(background[c] - target[c]).powi(2)).sum::<f64>() / 3.0
}

/// \[vertex\]: factor of the learning rate. It is 0 if too few views see the vertex, else 1 or its number of views over
/// the largest one.
fn vertex_rates<T: Scalar>(counts: &[u32], options: &CoarseOptions, views: usize) -> Vec<T> {
    let most = f64::from(counts.iter().copied().max().unwrap_or(0).max(1));
    let least = options.min_views.min(views as u32).max(1);
    let rate = |count: u32| match count {
        c if c < least => T::zero(),
        _ if !options.view_count_rate => T::one(),
        c => T::of(f64::from(c) / most),
    };
    counts.iter().map(|&c| rate(c)).collect()
}
