//! The fast CPU renderer: the fast field in f32, a tile of the picture at a time, tiles over all threads.

use rayon::prelude::*;

use super::{Approximation, ApproximationError, Picture, Pixel, Renderer};
use crate::field::{Activations, Field, Real, Samples, Stage, Work, add_compensated, vectorized};
use crate::geometry::{Camera, Ray};
use crate::model::{DecoderMode, Scene, softplus};

/// Pixels along the edge of a tile, whose rays are marched together: they meet mostly the same tensors.
const TILE: usize = 16;

/// ShadedSamples samples that are decoded together: enough for the products, few enough for their rows to stay in the cache.
const ROWS_AT_ONCE: usize = 768;

/// Renders a scene on all threads of the current pool. Generic so that the very same code can be run in f64.
#[derive(Debug)]
pub struct CpuRenderer<T = f32> {
    field: Field<T>,
}

/// What a ray sees, and how it was found.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TraceInfo {
    /// What it sees.
    pub pixel: Pixel,
    /// Samples whose density was evaluated.
    pub samples: u32,
    /// Against the density's gradient, at the expected depth; `None` where half of the light passes, and where none is wanted.
    pub normal: Option<glam::Vec3>,
}

/// What a thread needs besides the field. Reused from one tile to the next.
#[derive(Default)]
struct Scratch<T> {
    samples: Samples<T>,
    activations: Activations<T>,
}

/// The pixels of a tile.
struct Tile<'a> {
    corner: [u32; 2],
    rows: Vec<&'a mut [Pixel]>,
}

impl CpuRenderer<f32> {
    /// Prepares `scene`, which must have passed [`Scene::check`].
    pub fn new(scene: &Scene) -> Self {
        Self { field: Field::new(scene) }
    }
}

impl<T: Real> CpuRenderer<T> {
    /// Prepares `scene`, which must have passed [`Scene::check`], with `approximation`. Takes the scene, so that its
    /// factors are in memory once.
    ///
    /// # Errors
    ///
    /// Where an option is out of range for this scene.
    pub fn with_approximation(mut scene: Scene, approximation: &Approximation) -> Result<Self, ApproximationError> {
        approximation.check(&scene)?;
        approximation.reduce(&mut scene);
        let mut field = Field::consuming(scene);
        if let Some(cells) = approximation.density_cache {
            field.cache_density(cells);
        }
        Ok(Self { field })
    }

    /// Renders with `field`.
    pub fn from_field(field: Field<T>) -> Self {
        Self { field }
    }

    /// The memory that cached density features take, in bytes; `None` where they are not cached.
    pub fn density_cache_bytes(&self) -> Option<u64> {
        self.field.density_cache_bytes()
    }

    /// Bytes of the factors, matrices and networks, and of cached density features.
    pub fn memory_bytes(&self) -> u64 {
        self.field.parameter_bytes() + self.density_cache_bytes().unwrap_or(0)
    }

    /// As [`Renderer::trace`], and what it took.
    pub fn trace_with_work(&self, rays: &[Ray]) -> (Vec<Pixel>, Work) {
        let chunks: Vec<_> = (rays.par_chunks(TILE * TILE))
            .map_init(Scratch::default, |scratch, chunk| {
                let mut pixels = Vec::with_capacity(chunk.len());
                let work = vectorized(
                    #[inline(always)]
                    || self.trace_chunk(chunk, scratch, |pixel| pixels.push(pixel)),
                );
                (pixels, work)
            })
            .collect();
        let (mut pixels, mut work) = (Vec::with_capacity(rays.len()), Work::default());
        for (of_chunk, chunk_work) in chunks {
            pixels.extend(of_chunk);
            work.add(&chunk_work);
        }
        (pixels, work)
    }

    /// As [`Renderer::trace`], and how it was found, with normals where they are wanted. Twin of the normals:
    /// `shaders/normals.wgsl`.
    pub fn trace_info(&self, rays: &[Ray], has_normals: bool) -> Vec<TraceInfo> {
        let chunks: Vec<Vec<TraceInfo>> = (rays.par_chunks(TILE * TILE))
            .map_init(<(Scratch<T>, Samples<T>)>::default, |(scratch, points), chunk| {
                let mut infos = Vec::with_capacity(chunk.len());
                vectorized(
                    #[inline(always)]
                    || {
                        self.trace_chunk(chunk, scratch, |pixel| infos.push(TraceInfo { pixel, ..TraceInfo::default() }));
                        for (n, (info, ray)) in infos.iter_mut().zip(chunk).enumerate() {
                            info.samples = scratch.samples.ray_range(n).len() as u32;
                            if has_normals && info.pixel.opacity >= 0.5 && info.pixel.depth > 0.0 {
                                info.normal = self.normal_at(ray.at(f64::from(info.pixel.depth)), points);
                            }
                        }
                    },
                );
                infos
            })
            .collect();
        chunks.concat()
    }

    /// The direction in which density falls at `position`, by differences over four steps; `None` where it does not change.
    #[inline(always)]
    fn normal_at(&self, position: glam::DVec3, samples: &mut Samples<T>) -> Option<glam::Vec3> {
        let h = 2.0 * self.field.rules.step;
        let mut density = |position: glam::DVec3| {
            let slot = (position - self.field.origin).to_array().map(T::of);
            let feature = self.field.density_feature(slot, samples);
            feature.map_or(0.0, |f| softplus(f.f64() + self.field.rules.density_shift))
        };
        let fall = [glam::DVec3::X, glam::DVec3::Y, glam::DVec3::Z]
            .map(|axis| density(position - h * axis) - density(position + h * axis));
        Some(glam::DVec3::from(fall).try_normalize()?.as_vec3())
    }

    /// Calls `take` with what each of `rays` sees, in their order; returns what it took.
    #[inline(always)]
    fn trace_chunk(&self, rays: &[Ray], scratch: &mut Scratch<T>, mut take: impl FnMut(Pixel)) -> Work {
        let Scratch { samples, activations } = scratch;
        self.field.march(rays, samples);
        let at_once = match self.field.decoder.mode {
            DecoderMode::PerSample => ROWS_AT_ONCE,
            // A row is a ray.
            DecoderMode::PerRay | DecoderMode::Residual => usize::MAX,
        };
        let mut first = 0;
        while first < rays.len() {
            let count = self.field.select_some_shaded(samples, first, at_once, None, &mut activations.shaded);
            self.field.decode(&rays[first..first + count], samples, activations);
            (0..count).for_each(|r| take(self.pixel(r, first + r, samples, activations)));
            samples.clock.lap(Stage::Composite);
            first += count;
        }
        std::mem::take(&mut samples.clock.work)
    }

    /// What `ray` sees, which is number `decoded` of those that `activations` are of.
    #[inline(always)]
    fn pixel(&self, decoded: usize, ray: usize, samples: &Samples<T>, activations: &Activations<T>) -> Pixel {
        let remaining = samples.remaining[ray];
        let color = activations.pixel(decoded, self.field.background.map(|c| remaining * c));
        let (mut weights, mut distances) = (T::zero(), T::zero());
        // What rounding has added too much to them.
        let (mut weights_lost, mut distances_lost) = (T::zero(), T::zero());
        for &slot in &samples.order[samples.ray_range(ray)] {
            let weight = samples.weight(slot as usize);
            add_compensated(&mut weights, &mut weights_lost, weight);
            add_compensated(&mut distances, &mut distances_lost, weight * samples.distances[slot as usize]);
        }
        let depth = if weights > T::zero() { distances / weights } else { T::zero() };
        Pixel { color: color.map(T::f32), opacity: (T::one() - remaining).f32(), depth: depth.f32() }
    }

    /// The picture's pixels in the tile, as `camera` sees them.
    #[inline(always)]
    fn render_tile(&self, camera: &Camera, tile: Tile, scratch: &mut Scratch<T>) {
        let [left, top] = tile.corner;
        let width = tile.rows.first().map_or(0, |row| row.len());
        let rays: Vec<Ray> = (0..tile.rows.len() as u32)
            .flat_map(|y| (0..width as u32).map(move |x| camera.ray(left + x, top + y)))
            .collect();
        let mut pixels = tile.rows.into_iter().flatten();
        self.trace_chunk(&rays, scratch, |pixel| *pixels.next().expect("a pixel a ray") = pixel);
    }
}

impl<T: Real> Renderer for CpuRenderer<T> {
    fn trace(&self, rays: &[Ray]) -> Vec<Pixel> {
        self.trace_with_work(rays).0
    }

    fn render(&self, camera: &Camera) -> Picture {
        let (width, height) = (camera.width, camera.height);
        let mut pixels = vec![Pixel::default(); width as usize * height as usize];
        tiles(&mut pixels, width as usize).into_par_iter().for_each_init(Scratch::default, |scratch, tile| {
            vectorized(
                #[inline(always)]
                || self.render_tile(camera, tile, scratch),
            );
        });
        Picture { width, height, pixels }
    }
}

/// Cuts a picture of `width` columns into tiles, so that each is written where it belongs.
fn tiles(pixels: &mut [Pixel], width: usize) -> Vec<Tile<'_>> {
    let mut tiles = Vec::new();
    for (row, band) in pixels.chunks_mut(TILE * width.max(1)).enumerate() {
        let first = tiles.len();
        for line in band.chunks_mut(width) {
            for (column, part) in line.chunks_mut(TILE).enumerate() {
                if first + column == tiles.len() {
                    tiles.push(Tile { corner: [column, row].map(|n| (n * TILE) as u32), rows: Vec::new() });
                }
                tiles[first + column].rows.push(part);
            }
        }
    }
    tiles
}
