//! Training on one grid: rays from the photographs, their samples, the update.

use glam::DVec3;
use rayon::prelude::*;

use super::CoarseOptions;
use super::grid::{Grid, Live, Real};
use super::ray_loss::{Medium, Sample, Segment, Shaded, Shading, density_of_alpha, trace};
use super::update::{Adam, SortedSamples};
use super::visibility::count_views;
use crate::dataset::Dataset;
use crate::geometry::{Aabb, Camera, Ray};
use crate::prior::Error;
use crate::random::Random;

/// Rays that one task traces: fixed, so that sums do not depend on the number of threads.
const CHUNK: u32 = 128;
/// Steps between two looks at which cells are live.
const LIVE_EVERY: u32 = 16;

/// All pixels of a dataset, numbered through.
pub(super) struct RaySampler<'a> {
    dataset: &'a Dataset,
    /// The number of each view's first pixel, and of all pixels.
    begins: Vec<u64>,
    /// Behind transparent pixels.
    background: [f32; 3],
}

impl<'a> RaySampler<'a> {
    pub(super) fn new(dataset: &'a Dataset, background: [f32; 3]) -> Result<Self, Error> {
        check_views(dataset)?;
        let mut begins = vec![0];
        for view in &dataset.views {
            begins.push(begins[begins.len() - 1] + view.pixels.len() as u64);
        }
        Ok(Self { dataset, begins, background })
    }

    /// The ray and the color of the random pixel number `draw`.
    fn pixel(&self, random: &Random, draw: u64) -> (Ray, [f32; 3]) {
        let number = random.below(draw, self.begins[self.begins.len() - 1]);
        let index = self.begins.partition_point(|&b| b <= number) - 1;
        let view = &self.dataset.views[index];
        let pixel = (number - self.begins[index]) as u32;
        let ray = view.camera.ray(pixel % view.camera.width, pixel / view.camera.width);
        (ray, view.pixels.color(pixel as usize, self.background))
    }

    fn cameras(&self) -> Vec<Camera> {
        self.dataset.views.iter().map(|v| v.camera).collect()
    }
}

/// Checks that there are views, each with a finite camera and as many pixels as that has.
pub(crate) fn check_views(dataset: &Dataset) -> Result<(), Error> {
    for view in &dataset.views {
        let camera = &view.camera;
        let wrong = |expected: &str, found: String| {
            Err(Error::View { view: view.name.clone(), expected: expected.into(), found })
        };
        let pixels = u64::from(camera.width) * u64::from(camera.height);
        if pixels == 0 || pixels != view.pixels.len() as u64 {
            let found = format!("{} for {} x {}", view.pixels.len(), camera.width, camera.height);
            return wrong("one pixel for each of the camera's, at least one", found);
        }
        if !camera.position.is_finite() || !camera.ray(0, 0).direction.is_finite() {
            return wrong("a finite camera", format!("{camera:?}"));
        }
    }
    if dataset.views.is_empty() {
        return Err(Error::NoViews { dataset: dataset.name.clone() });
    }
    Ok(())
}

/// One grid in training.
pub(super) struct Level {
    grid: Grid<f32>,
    rates: Vec<f32>,
    live: Live,
    adam: Adam<f32>,
    shading: Shading<f32>,
    /// In voxels.
    near_far: (f64, f64),
    step_size: f64,
    rays: u32,
    chunks: Vec<Chunk>,
    batches: Vec<SortedSamples<f32>>,
}

/// Memory that a task uses again at every step.
#[derive(Default)]
struct Chunk {
    samples: Vec<Sample<f32>>,
    shaded: Vec<Shaded<f32>>,
    squared: f64,
}

impl Level {
    /// Begins to train `grid`, whose voxels are `finest_voxels` times as large as the finest grid's.
    pub(super) fn new(
        grid: Grid<f32>,
        photographs: &RaySampler,
        options: &CoarseOptions,
        near: f64,
        far: f64,
        finest_voxels: f64,
    ) -> Self {
        let counts = count_views(&grid, &photographs.cameras(), near, far);
        let rates = vertex_rates(&counts, options, photographs.dataset.views.len());
        let shift = density_of_alpha(options.initial_alpha, 1.0);
        let interval = options.step_size * finest_voxels;
        let shading = Shading {
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
            adam: Adam::new(grid.values.len(), options.learning_rate, options.adam_epsilon),
            near_far: (near / grid.voxel, far / grid.voxel),
            step_size: options.step_size,
            rays: options.rays,
            chunks: (0..chunks).map(|_| Chunk::default()).collect(),
            batches: (0..chunks).map(|_| SortedSamples::default()).collect(),
            rates,
            shading,
            grid,
        }
    }

    fn medium(&self) -> Medium<'_, f32> {
        Medium { grid: &self.grid, live: &self.live, shading: &self.shading, step: self.step_size as f32 }
    }

    /// Where `ray`, in dataset units, is sampled.
    fn segment(&self, ray: &Ray) -> Option<Segment> {
        let ray = Ray { origin: self.grid.local(ray.origin), ..*ray };
        let extent = Aabb { min: DVec3::ZERO, max: self.grid.vertices.as_dvec3() - 1.0 };
        Segment::new(&ray, &extent, &self.live.bounds, self.near_far, self.step_size)
    }

    /// The grid as trained.
    pub(super) fn into_grid(self) -> Grid<f32> {
        self.grid
    }

    /// One step on random rays, keyed by (`seed`, `key`); returns their mean squared error. `step` counts on this grid.
    pub(super) fn step(&mut self, photographs: &RaySampler, seed: u64, key: u64, step: u32) -> f64 {
        if step.is_multiple_of(LIVE_EVERY) {
            self.live = Live::of(&self.grid, &self.rates, self.shading.min_density);
        }
        // Taken out, so that tasks can change them while they read the rest.
        let (mut chunks, mut batches) = (std::mem::take(&mut self.chunks), std::mem::take(&mut self.batches));
        let arch = pulp::Arch::new();
        let random = Random::new(seed, "coarse rays").substream(key);
        chunks.par_iter_mut().zip(&mut batches).enumerate().for_each(|(n, (chunk, batch))| {
            let n = n as u32;
            let rays = n * CHUNK..self.rays.min((n + 1) * CHUNK);
            let pixels = rays.map(|ray| photographs.pixel(&random, u64::from(ray)));
            // The kernels are inlined into a copy for the machine's widest instructions.
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
        chunk: &mut Chunk,
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

    /// For each vertex, whether the voxel around it holds a sample that adds more than `weight` to any pixel. Every
    /// `stride`th pixel of every `stride`th row is looked at.
    pub(super) fn seen(&mut self, photographs: &RaySampler, weight: f32, stride: u32) -> Vec<bool> {
        self.live = Live::of(&self.grid, &self.rates, self.shading.min_density);
        let views = &photographs.dataset.views;
        let none = || vec![false; self.grid.values.len()];
        let arch = pulp::Arch::new();
        // A union does not depend on the order.
        let union = |mut a: Vec<bool>, b: Vec<bool>| {
            a.iter_mut().zip(b).for_each(|(a, b)| *a |= b);
            a
        };
        views
            .par_iter()
            .with_min_len(views.len().div_ceil(16))
            .fold(none, |mut seen, view| {
                arch.dispatch(|| self.look(&view.camera, weight, stride, &mut seen));
                seen
            })
            .reduce(none, union)
    }

    #[inline(always)]
    fn look(&self, camera: &Camera, weight: f32, stride: u32, seen: &mut [bool]) {
        let medium = self.medium();
        let (row, plane) = (self.grid.vertices.x as usize, self.grid.plane());
        let mut chunk = Chunk::default();
        for y in (0..camera.height).step_by(stride as usize) {
            for x in (0..camera.width).step_by(stride as usize) {
                let Some(segment) = self.segment(&camera.ray(x, y)) else { continue };
                chunk.samples.clear();
                trace(&medium, &segment, [0.0; 3], &mut chunk.samples, &mut chunk.shaded);
                let shaded = chunk.samples.iter().zip(&chunk.shaded);
                for (sample, _) in shaded.filter(|(_, s)| s.weight > weight) {
                    let [dx, dy, dz] = sample.fraction.map(|f| usize::from(f > 0.5));
                    seen[sample.first as usize + dz * plane + dy * row + dx] = true;
                }
            }
        }
    }
}

fn background_error(background: [f32; 3], target: [f32; 3]) -> f64 {
    (0..3).map(|c| f64::from(background[c] - target[c]).powi(2)).sum::<f64>() / 3.0
}

/// What scales the learning rate of each vertex: 0 where too few views see it, else 1 or its share of the largest
/// number of views.
fn vertex_rates<T: Real>(counts: &[u32], options: &CoarseOptions, views: usize) -> Vec<T> {
    let most = f64::from(counts.iter().copied().max().unwrap_or(0).max(1));
    let least = options.min_views.min(views as u32).max(1);
    let rate = |count: u32| match count {
        c if c < least => T::zero(),
        _ if !options.view_count_rate => T::one(),
        c => T::of(f64::from(c) / most),
    };
    counts.iter().map(|&c| rate(c)).collect()
}
