//! The CPU renderer: the fast field in f32, tile by tile, with tiles distributed over all threads.

use rayon::prelude::*;

use super::approximation::OwnThresholds;
use super::{Approximation, Picture, Pixel, Renderer, RendererError};
use crate::{Activations, Field, Pool, Real, Samples, Stage, Work, add_compensated, vectorized};
use strivec_format::geometry::{Camera, Ray};
use strivec_format::model::{DecoderMode, OverMemory, Scene, softplus};

/// Pixels along the edge of a tile. Its rays are marched together because they meet mostly the same tensors. Tiles of
/// 8, 12, 20, 24 and 32 pixels are not faster (docs/experiments/2026-11-26-frame-in-tiles.md).
const TILE: usize = 16;

/// The most tiles that a thread takes at once: others wait for the last one's.
/// Quarters of a picture, as a pool of two threads cuts it, left 5 % of a frame idle
/// (docs/experiments/2026-11-26-learning-rates.md).
const TILES_PER_TASK: usize = 4;

/// Shaded samples that are decoded together: enough for efficient products, few enough that their rows stay in the
/// cache.
const MAX_ROWS: usize = 768;

/// The bytes of samples at which rays that march together are marched in smaller groups: a tile of most scenes takes some
/// megabytes, but one of an untrusted scene, or of fog, could take the memory that there is.
const MAX_SAMPLE_BYTES: usize = 128 << 20;

/// Renders a scene on all threads of the current [`rayon`] pool. Generic over the precision, so that tests can run the
/// same code in f64.
///
/// ```
/// use strivec_format::container::decode;
/// use strivec_format::geometry::Camera;
/// use strivec_field::render::{CpuRenderer, Renderer};
///
/// let scene = decode(include_bytes!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../fixtures/v1/smallest.strivec")))?;
/// let (center, size) = (scene.bounds.center(), scene.bounds.size());
/// let camera = Camera::looking_at([8, 8], 8.0, center + 2.0 * size, center, glam::DVec3::Z);
/// let picture = CpuRenderer::new(&scene)?.render(&camera);
/// assert_eq!(picture.pixels.len(), 64);
/// assert!(picture.pixels.iter().all(|pixel| (0.0..=1.0).contains(&pixel.opacity)));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct CpuRenderer<T = f32> {
    field: Field<T>,
    own: OwnThresholds,
    /// Bytes of the samples of rays that march together; [`MAX_SAMPLE_BYTES`] but for tests.
    sample_bytes: usize,
}

/// A traced ray: its pixel, its cost and its normal.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TraceInfo {
    /// The ray's pixel.
    pub pixel: Pixel,
    /// Number of samples whose density was evaluated.
    pub samples: u32,
    /// The unit direction against the density's gradient at the expected depth, in model space; `None` if the ray's
    /// transmittance is above 0.5 or normals were not requested.
    pub normal: Option<glam::Vec3>,
}

/// Scratch of a tile, reused from one to the next.
#[derive(Default)]
struct TileScratch<T> {
    samples: Samples<T>,
    activations: Activations<T>,
}

/// The pixels of a tile.
struct Tile<'a> {
    corner: [u32; 2],
    rows: Vec<&'a mut [Pixel]>,
}

impl CpuRenderer<f32> {
    /// Prepares `scene`, which must have passed [`Scene::check`], within the memory that it allows.
    ///
    /// # Errors
    ///
    /// [`OverMemory`].
    pub fn new(scene: &Scene) -> Result<Self, OverMemory> {
        Field::new(scene).map(Self::from_field)
    }

    /// Prepares `scene` like [`Field::unlimited`].
    pub fn unlimited(scene: &Scene) -> Self {
        Self::from_field(Field::unlimited(scene))
    }
}

impl<T: Real> CpuRenderer<T> {
    /// Prepares `scene`, which must have passed [`Scene::check`], with `approximation`. Consumes the scene, so that
    /// only one copy of its factors is in memory.
    ///
    /// # Errors
    ///
    /// If an option is out of range for this scene, or the scene takes more memory than it may.
    pub fn with_approximation(mut scene: Scene, approximation: &Approximation) -> Result<Self, RendererError> {
        approximation.check(&scene)?;
        // Raised thresholds need the scene's own, by which they give the weight of skipped samples to shaded ones.
        let own = approximation.reduce(&mut scene);
        // Each scale's factors leave the scene as they are converted: 147 instead of 266 MB for a scene of 74 MB.
        Ok(Self { own, ..Self::from_field(Field::from_scene(&mut scene)?) })
    }

    /// A renderer of `field`.
    pub fn from_field(field: Field<T>) -> Self {
        let own = OwnThresholds::of(&field.rules);
        Self { field, own, sample_bytes: MAX_SAMPLE_BYTES }
    }

    /// Begins rays at the distance `near`, in model units, from now on.
    pub fn set_near(&mut self, near: f64) {
        self.field.near_far[0] = near;
    }

    /// Bytes of the factors, appearance matrices and decoder layers.
    pub fn memory_bytes(&self) -> u64 {
        self.field.parameter_bytes()
    }

    /// The pixels of `rays`, as [`Renderer::trace`] returns them, with sample counts and, if `has_normals`, normals.
    pub fn trace_info(&self, rays: &[Ray], has_normals: bool) -> Vec<TraceInfo> {
        T::trace_info(self, rays, has_normals)
    }

    #[inline(always)]
    pub(crate) fn trace_info_inlined(&self, rays: &[Ray], has_normals: bool) -> Vec<TraceInfo> {
        map_chunks(
            rays,
            #[inline(always)]
            |chunk, (scratch, points): &mut (TileScratch<T>, Samples<T>)| {
                let (mut infos, mut left) = (Vec::with_capacity(chunk.len()), Vec::with_capacity(chunk.len()));
                self.trace_chunk(chunk, scratch, |pixel, ray, samples| {
                    infos.push(TraceInfo { pixel, samples: samples.ray_range(ray).len() as u32, normal: None });
                    left.push(samples.remaining[ray]);
                });
                for ((info, left), ray) in infos.iter_mut().zip(left).zip(chunk) {
                    if has_normals && left <= T::of(0.5) && info.pixel.depth > 0.0 {
                        info.normal = self.normal_at(ray.at(f64::from(info.pixel.depth)), points);
                    }
                }
                infos
            },
        )
    }

    #[inline(always)]
    pub(crate) fn trace_inlined(&self, rays: &[Ray]) -> Vec<Pixel> {
        map_chunks(
            rays,
            #[inline(always)]
            |chunk, scratch| {
                let mut pixels = Vec::with_capacity(chunk.len());
                self.trace_chunk(chunk, scratch, |pixel, _, _| pixels.push(pixel));
                pixels
            },
        )
    }

    /// The unit direction against the density's gradient at `point`, by central differences over four march steps;
    /// `None` if the density is constant there. Twin: `shaders/normals.wgsl`.
    #[inline(always)]
    fn normal_at(&self, point: glam::DVec3, samples: &mut Samples<T>) -> Option<glam::Vec3> {
        let rules = &self.field.rules;
        // Contracted space is about as much smaller than the scene.
        let stretch = rules.contraction.map_or(1.0, |_| point.abs().max_element().max(1.0));
        let h = 2.0 * rules.step * stretch;
        let mut density = |point: glam::DVec3| {
            let feature = self.field.density_feature(self.field.relative(rules.contracted(point)), samples);
            feature.map_or(0.0, |f| softplus(f.f64() + rules.density_shift))
        };
        let fall = [glam::DVec3::X, glam::DVec3::Y, glam::DVec3::Z]
            .map(|axis| density(point - h * axis) - density(point + h * axis));
        Some(glam::DVec3::from(fall).try_normalize()?.as_vec3())
    }

    /// \[ray\]\[n\] the pixels of `rays` as the decoder colors them for the directions `toward(ray, n)`, n from 0 to below
    /// `count`: the samples and their weights are those of the rays themselves.
    pub fn trace_toward(
        &self,
        rays: &[Ray],
        count: usize,
        toward: &(dyn Fn(&Ray, usize) -> glam::DVec3 + Sync),
    ) -> Vec<Pixel> {
        T::trace_toward(self, rays, count, toward)
    }

    #[inline(always)]
    pub(crate) fn trace_toward_inlined(
        &self,
        rays: &[Ray],
        count: usize,
        toward: &(dyn Fn(&Ray, usize) -> glam::DVec3 + Sync),
    ) -> Vec<Pixel> {
        map_chunks(
            rays,
            #[inline(always)]
            |chunk, scratch: &mut TileScratch<T>| {
                let mut pixels = Vec::with_capacity(count * chunk.len());
                let mut seen = Vec::with_capacity(chunk.len());
                self.march_in_parts(chunk, scratch, |rays, scratch| {
                    let start = pixels.len();
                    pixels.resize(start + count * rays.len(), Pixel::default());
                    for n in 0..count {
                        seen.clear();
                        seen.extend(rays.iter().map(|ray| Ray { direction: toward(ray, n), ..*ray }));
                        let mut places = pixels[start..].iter_mut().skip(n).step_by(count);
                        self.shade_part(&seen, scratch, |pixel, _, _| {
                            *places.next().expect("one pixel per ray") = pixel;
                        });
                    }
                });
                pixels
            },
        )
    }

    /// Calls `take` with the pixel of each of `rays`, in their order, the ray's index in the samples, and those. Returns time
    /// and counts by stage.
    #[inline(always)]
    fn trace_chunk(
        &self,
        rays: &[Ray],
        scratch: &mut TileScratch<T>,
        mut take: impl FnMut(Pixel, usize, &Samples<T>),
    ) -> Work {
        let mut work = Work::default();
        self.march_in_parts(
            rays,
            scratch,
            #[inline(always)]
            |rays, scratch| {
                self.shade_part(rays, scratch, &mut take);
                work.add(&scratch.samples.clock.work);
            },
        );
        work
    }

    /// Calls `shade` with parts of `rays`, in their order, once `scratch` has the samples of the part: as many rays as fit
    /// into the memory for samples.
    #[inline(always)]
    fn march_in_parts(
        &self,
        rays: &[Ray],
        scratch: &mut TileScratch<T>,
        mut shade: impl FnMut(&[Ray], &mut TileScratch<T>),
    ) {
        let (mut left, mut together) = (rays, rays.len());
        while !left.is_empty() {
            together = together.min(left.len());
            while !self.field.march_within(&left[..together], &mut scratch.samples, self.sample_bytes) {
                together = together.div_ceil(2);
            }
            let part;
            (part, left) = left.split_at(together);
            shade(part, scratch);
        }
    }

    /// Calls `take` with the pixel of each of `rays`, whose samples `scratch` has, in their order, the ray's index, and the
    /// samples.
    #[inline(always)]
    fn shade_part(&self, rays: &[Ray], scratch: &mut TileScratch<T>, mut take: impl FnMut(Pixel, usize, &Samples<T>)) {
        let TileScratch { samples, activations } = scratch;
        // In parts, so that the rows of a part are still in the cache from layer to layer.
        let max_shaded = match self.field.decoder.mode {
            DecoderMode::PerSample => MAX_ROWS,
            // One row per ray.
            DecoderMode::PerRay | DecoderMode::Residual => usize::MAX,
        };
        let mut first = 0;
        while first < rays.len() {
            let count = self.field.select_some_shaded(samples, first, max_shaded, None, &mut activations.shaded);
            self.field.decode(&rays[first..first + count], samples, activations);
            for (r, ray) in rays[first..first + count].iter().enumerate() {
                take(self.pixel(r, first + r, ray, samples, activations), first + r, samples);
            }
            samples.clock.lap(Stage::Composite);
            first += count;
        }
    }

    /// The pixel of the ray `line` of index `ray`, whose index in `activations` is `decoded`. Twin:
    /// `shaders/resolve.wgsl`.
    #[inline(always)]
    fn pixel(
        &self,
        decoded: usize,
        ray: usize,
        line: &Ray,
        samples: &Samples<T>,
        activations: &Activations<T>,
    ) -> Pixel {
        let (left, scale) = self.left_and_scale(ray, samples);
        let behind = self.field.behind(line, self.field.background);
        let color = activations.pixel(decoded, scale, behind.map(|c| left * c));
        // The sky is a part of the picture.
        let opacity = if self.field.sky.is_some() { T::one() } else { T::one() - left };
        let (mut weights, mut distances) = (T::zero(), T::zero());
        // Kahan compensations.
        let (mut weights_lost, mut distances_lost) = (T::zero(), T::zero());
        for &slot in &samples.order[samples.ray_range(ray)] {
            let weight = samples.weight(slot as usize);
            // Plain sums lose fog entirely; the compensation takes no measurable time (docs/numerics.md).
            add_compensated(&mut weights, &mut weights_lost, weight);
            add_compensated(&mut distances, &mut distances_lost, weight * samples.distances[slot as usize]);
        }
        let depth = if weights > T::zero() { distances / weights } else { T::zero() };
        Pixel { color: color.map(T::f32), opacity: opacity.f32(), depth: depth.f32() }
    }

    /// The transmittance left of `ray`, and the factor of the weights of its shaded samples (see [`Approximation`]).
    #[inline(always)]
    fn left_and_scale(&self, ray: usize, samples: &Samples<T>) -> (T, T) {
        let (rules, own) = (&self.field.rules, &self.own);
        let remaining = samples.remaining[ray];
        // Without raised thresholds no bit of a picture changes.
        if OwnThresholds::of(rules) == *own {
            return (remaining, T::one());
        }
        let [min_weight, own_weight] = [rules.min_weight, own.min_weight].map(T::of);
        let (mut shaded, mut skipped) = (T::zero(), T::zero());
        for &slot in &samples.order[samples.ray_range(ray)] {
            let weight = samples.weight(slot as usize);
            if weight > min_weight {
                shaded += weight;
            } else if weight > own_weight {
                skipped += weight;
            }
        }
        // No sample can take the weight.
        if shaded == T::zero() {
            return (remaining, T::one());
        }
        let has_ended = remaining < T::of(rules.min_transmittance);
        // As much is left as the scene's own threshold could have left: otherwise the background would show through
        // (docs/experiments/2026-11-29-raised-thresholds.md).
        let left = if has_ended { remaining.min(T::of(own.min_transmittance)) } else { remaining };
        (left, T::one() + (remaining - left + skipped) / shaded)
    }

    /// Renders like [`Renderer::render`], and returns time and counts by stage as well.
    pub fn render_with_work(&self, camera: &Camera) -> (Picture, Work) {
        T::render(self, camera)
    }

    #[inline(always)]
    pub(crate) fn render_inlined(&self, camera: &Camera) -> (Picture, Work) {
        let (width, height) = (camera.width, camera.height);
        let mut pixels = vec![Pixel::default(); width as usize * height as usize];
        let pool = Pool::<TileScratch<T>>::default();
        let works: Vec<Work> = (tiles(&mut pixels, width as usize).into_par_iter())
            .with_max_len(TILES_PER_TASK)
            .map(|tile| {
                pool.with(|scratch| {
                    vectorized(
                        #[inline(always)]
                        || self.render_tile(camera, tile, scratch),
                    )
                })
            })
            .collect();
        let mut work = Work::default();
        works.iter().for_each(|of_tile| work.add(of_tile));
        (Picture { width, height, pixels }, work)
    }

    /// Renders the pixels of `tile` as seen by `camera`. Returns time and counts by stage.
    #[inline(always)]
    fn render_tile(&self, camera: &Camera, tile: Tile, scratch: &mut TileScratch<T>) -> Work {
        let [left, top] = tile.corner;
        let (mut rays, mut pixels) = (Vec::with_capacity(TILE * TILE), Vec::with_capacity(TILE * TILE));
        for (y, row) in (top..).zip(tile.rows) {
            for (x, pixel) in (left..).zip(row) {
                // A lens may have no ray for a pixel: its distortion folds over.
                match camera.ray(x, y) {
                    Some(ray) => {
                        rays.push(ray);
                        pixels.push(pixel);
                    }
                    None => *pixel = Pixel { color: self.background(), ..Pixel::default() },
                }
            }
        }
        let mut pixels = pixels.into_iter();
        self.trace_chunk(&rays, scratch, |pixel, _, _| *pixels.next().expect("one pixel per ray") = pixel)
    }
}

impl<T: Real> Renderer for CpuRenderer<T> {
    fn trace(&self, rays: &[Ray]) -> Vec<Pixel> {
        T::trace(self, rays)
    }

    fn background(&self) -> [f32; 3] {
        self.field.background.map(T::f32)
    }

    fn render(&self, camera: &Camera) -> Picture {
        self.render_with_work(camera).0
    }
}

/// The results of `trace` for chunks of `rays`, with scratch that is reused, on all threads.
#[inline(always)]
fn map_chunks<S: Default + Send, R: Clone + Send>(
    rays: &[Ray],
    trace: impl Fn(&[Ray], &mut S) -> Vec<R> + Sync,
) -> Vec<R> {
    let pool = Pool::<S>::default();
    let chunks: Vec<Vec<R>> = (rays.par_chunks(TILE * TILE))
        .with_max_len(TILES_PER_TASK)
        .map(|chunk| {
            pool.with(|scratch| {
                vectorized(
                    #[inline(always)]
                    || trace(chunk, scratch),
                )
            })
        })
        .collect();
    chunks.concat()
}

/// Splits a picture of `width` columns into tiles that are written in place.
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

#[cfg(test)]
mod tests {
    use super::*;
    use strivec_format::container::decode;

    #[test]
    fn rays_that_march_in_small_groups_have_the_same_pixels() {
        let file = include_bytes!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../fixtures/v1/f32.strivec"));
        let scene = decode(file).unwrap();
        let (center, size) = (scene.bounds.center(), scene.bounds.size());
        let camera = Camera::looking_at([32, 32], 32.0, center + 0.8 * size, center, glam::DVec3::Z);
        let together = CpuRenderer::new(&scene).unwrap();
        let (_, work) = together.render_with_work(&camera);
        assert!(work.samples > 1000, "{work:?}");
        let rays: Vec<Ray> = (0..1024).filter_map(|n| camera.ray(n % 32, n / 32)).collect();
        let infos = together.trace_info(&rays, true);
        let same = |a: &[f32], b: &[f32]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-5);
        for sample_bytes in [0, 10_000, 100_000] {
            let apart = CpuRenderer { sample_bytes, ..together.clone() };
            let (_, of_groups) = apart.render_with_work(&camera);
            assert_eq!((of_groups.rays, of_groups.samples), (work.rays, work.samples));
            // Products of matrices with other numbers of rows may round differently.
            for (found, info) in apart.trace_info(&rays, true).iter().zip(&infos) {
                assert_eq!(found.samples, info.samples, "{sample_bytes} bytes");
                let [found, expected] =
                    [found, info].map(|i| [i.pixel.color[0], i.pixel.color[1], i.pixel.color[2], i.pixel.opacity]);
                assert!(same(&found, &expected), "{sample_bytes} bytes: {found:?}, not {expected:?}");
            }
        }
    }

    #[test]
    fn a_scene_of_long_rays_is_refused_and_says_so() {
        let file = include_bytes!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../fixtures/v1/f32.strivec"));
        let mut scene = decode(file).unwrap();
        assert!(CpuRenderer::new(&scene).is_ok());
        scene.rules.step = scene.bounds.size().length() / 1e6;
        scene.memory.0 = 512 << 20;
        let error = CpuRenderer::new(&scene).unwrap_err().to_string();
        assert!(error.starts_with("the samples of a ray of the scene would take at least"), "{error}");
    }
}
