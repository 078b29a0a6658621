//! The fast field: the function of [`strivec_format::model::ReferenceField`] (spec 4.1 to 4.8 and 4.11), with data arranged for
//! speed.
//!
//! Rendering and training on the CPU share it. It is generic over the precision: f32 for production, f64 to test the
//! same code. Positions are relative to the center of the scene's bounds, so that f32 keeps its precision far from the
//! origin.

mod cells;
mod compact;
mod compiled;
mod decoder;
mod decoder_weights;
mod density;
mod factors;
mod gather;
mod index;
mod march;
mod matrix;
mod neighbors;
mod points;
mod pool;
mod positions;
mod ray_marcher;
mod real;
pub mod render;
mod samples;
mod scale;
mod sky;
mod stages;
mod vector;

pub use cells::OccupancyCells;
pub use compact::{Roulette, ShadedSamples};
pub use compiled::Compiled;
pub use decoder::Activations;
pub use decoder_weights::{Dense, FieldDecoder};
pub use factors::Holding;
pub use factors::{Contribution, FieldFactors, HeldComponents};
pub use index::CellIndex;
pub use matrix::{Matrix, MatrixMut, multiply};
pub use pool::Pool;
pub use ray_marcher::RayMarcher;
pub use real::{Real, add_compensated};
pub use samples::Samples;
pub use scale::{FieldScale, TensorVertices};
pub use scale::{Interpolation, offset};
pub use sky::FieldSky;
pub use stages::{Stage, StageClock, Work};
pub use vector::MAX_LANES;
pub use vector::Vector;

use glam::DVec3;

use strivec_format::geometry::{Aabb, MAX_SPACING, Ray};
use strivec_format::model::{Block, Coverage, MemoryLimit, OverMemory, Rules, Scale, Scene};

/// Runs `work` compiled for the best instruction set of this machine. Functions that `work` calls are compiled for it
/// only if they are inlined into `work`.
#[inline(always)]
pub fn vectorized<R>(work: impl FnOnce() -> R) -> R {
    pulp::Arch::new().dispatch(work)
}

/// The density and the appearance factors of `scale`.
fn held_factors<T: Real>(scale: &Scale) -> [Vec<FieldFactors<T>>; 2] {
    let held = |blocks: &[Block], holding| {
        blocks.iter().map(|block| FieldFactors::new(holding, block, scale.cloud.resolution)).collect()
    };
    // Density components are a sum, so any of them may be missing; appearance components have their places in a row.
    [held(&scale.factors.density, Holding::Nonzero), held(&scale.factors.appearance, Holding::UpToLast)]
}

/// The parts of a field that take memory, in errors.
const NUMBERS: &str = "the factors";
const INDEX: &str = "the index of the tensors";
const RAY: &str = "the samples of a ray";

/// The most bytes that a field of `scene` and a ray take besides the index of the tensors.
///
/// # Errors
///
/// [`OverMemory`] if they are more than `limit`.
fn memory_besides_index<T: Real>(scene: &Scene, limit: MemoryLimit) -> Result<u64, OverMemory> {
    /// Centers, numbers of components and their starts.
    const TENSOR_BYTES: usize = 64;
    let scalar = size_of::<T>() as u64;
    // Nine bytes for each brick of 64 cells.
    let occupancy = scene.occupancy.as_ref().map_or(0, |o| o.vertices.as_u64vec3().element_product() / 4);
    let of_scale = |s: &Scale| (scalar + 1) * s.factors.parameter_count() + (TENSOR_BYTES * s.cloud.len()) as u64;
    let scales = scene.scales.iter().map(of_scale).sum::<u64>();
    let bytes = 4 * scalar * scene.decoder.parameter_count() + occupancy + scales;
    limit.unless_over(NUMBERS, bytes)?;
    let bytes = bytes.saturating_add(Field::<T>::memory_of_ray(scene));
    limit.unless_over(RAY, bytes)?;
    Ok(bytes)
}

/// A scene, prepared for fast evaluation.
#[derive(Clone, Debug)]
pub struct Field<T> {
    /// The origin of the field's positions, in model space.
    pub origin: DVec3,
    /// The box that rays march through, in model space.
    pub bounds: Aabb,
    /// Distances along a ray at which it begins and ends, in model units.
    pub near_far: [f64; 2],
    /// The rules of the field and the march (spec 4).
    pub rules: Rules,
    /// The background, sRGB in [0, 1].
    pub background: [T; 3],
    /// The sky, which is behind the scene instead of the background.
    pub sky: Option<FieldSky<T>>,
    /// The scales, coarsest first.
    pub scales: Vec<FieldScale<T>>,
    /// Appearance matrices and decoder: from appearance components to color.
    pub decoder: FieldDecoder<T>,
    /// The occupied cells, outside of which no sample counts.
    pub occupancy: Option<OccupancyCells<T>>,
    /// If there is no occupancy and coverage is *all*: the cells that tensors of the finest scale reach into.
    covered: Option<OccupancyCells<T>>,
    /// Bound of the rounding error of positions, in model units.
    position_error: T,
}

impl<T: Real> Field<T> {
    /// Prepares `scene`, which must have passed [`Scene::check`], within the memory that it allows.
    ///
    /// # Errors
    ///
    /// [`OverMemory`], before the memory is taken.
    pub fn new(scene: &Scene) -> Result<Self, OverMemory> {
        Self::within(scene, scene.memory)
    }

    /// Prepares `scene`, which must have passed [`Scene::check`], whatever memory it takes: for scenes that this program
    /// makes, and those of which a field within the memory of the scene was made.
    pub fn unlimited(scene: &Scene) -> Self {
        Self::within(scene, MemoryLimit::NONE).expect("no limit")
    }

    fn within(scene: &Scene, limit: MemoryLimit) -> Result<Self, OverMemory> {
        let bytes = memory_besides_index::<T>(scene, limit)?;
        Self::with_factors(scene, scene.scales.iter().map(held_factors).collect(), bytes, limit)
    }

    /// Checks that [`Field::new`] takes at most the memory that `scene` allows. Takes the time to index the tensors, unless the
    /// scene has no limit.
    ///
    /// # Errors
    ///
    /// [`OverMemory`].
    pub fn check_memory(scene: &Scene) -> Result<(), OverMemory> {
        if scene.memory.0 == u64::MAX { Ok(()) } else { Self::memory(scene, scene.memory).map(drop) }
    }

    /// The most bytes of memory that [`Field::new`] and a ray take for `scene`.
    ///
    /// # Errors
    ///
    /// [`OverMemory`] if they are more than `limit`.
    pub fn memory(scene: &Scene, limit: MemoryLimit) -> Result<u64, OverMemory> {
        let mut bytes = memory_besides_index::<T>(scene, limit)?;
        for scale in &scene.scales {
            let index = CellIndex::<T>::new(&scale.cloud, scene.bounds.center(), limit.0 - bytes);
            bytes = bytes.saturating_add(index.map_or_else(|needed| needed, |index| 2 * index.memory()));
            limit.unless_over(INDEX, bytes)?;
        }
        Ok(bytes)
    }

    /// The most bytes of memory that tracing a ray of `scene` takes, its samples and their components, features and
    /// activations.
    pub fn memory_of_ray(scene: &Scene) -> u64 {
        let contributions = scene.scales.iter().map(|s| s.top_k as usize * size_of::<Contribution<T>>()).sum::<usize>();
        let widths = scene.decoder.layers.iter().map(|layer| layer.inputs + layer.outputs).sum::<u32>();
        let components = scene.scales.iter().map(|s| s.factors.appearance_rank()).sum::<u32>();
        let row = size_of::<T>() * (widths + 2 * components) as usize;
        // Lists double as they grow.
        let sample = 3 * (64 + 16 * scene.scales.len() + contributions) + 2 * row;
        let steps = scene.rules.most_steps(&scene.bounds).ceil() as u64 + 1;
        steps.saturating_mul(sample as u64)
    }

    /// The field of `scene` like [`Field::new`], but takes each scale's factors out of `scene` as soon as they are
    /// converted, which keeps about one copy of them in memory at any time.
    ///
    /// # Errors
    ///
    /// All errors of [`Field::new`].
    pub fn from_scene(scene: &mut Scene) -> Result<Self, OverMemory> {
        let limit = scene.memory;
        Self::from_scene_within(scene, limit)
    }

    /// The field of `scene` like [`Field::unlimited`], but takes the factors out of `scene` as [`Field::from_scene`] does.
    pub fn unlimited_from_scene(scene: &mut Scene) -> Self {
        Self::from_scene_within(scene, MemoryLimit::NONE).expect("no limit")
    }

    fn from_scene_within(scene: &mut Scene, limit: MemoryLimit) -> Result<Self, OverMemory> {
        // Before the factors leave the scene.
        let bytes = memory_besides_index::<T>(scene, limit)?;
        let taken = |scale: &mut Scale| {
            let factors = held_factors(scale);
            scale.factors.blocks_mut().for_each(|block| block.values = Vec::new());
            factors
        };
        let factors = scene.scales.iter_mut().map(taken).collect();
        Self::with_factors(scene, factors, bytes, limit)
    }

    /// Takes bounds, occupancy and rules from `scene`, which has the same tensors, and keeps all parameters.
    pub fn set_space(&mut self, scene: &Scene) {
        let factors = self.scales.drain(..).map(|scale| [scale.density, scale.appearance]).collect();
        let (decoder, sky) = (self.decoder.clone(), self.sky.clone());
        let field = Self::with_factors(scene, factors, 0, MemoryLimit::NONE).expect("no limit");
        *self = Self { decoder, sky, ..field };
    }

    /// Prepares `scene` with `factors`: \[scale\]\[density, appearance\]. Every field is made here, so that none takes more
    /// memory than its `limit`, of which all but the index takes `bytes`.
    fn with_factors(
        scene: &Scene,
        factors: Vec<[Vec<FieldFactors<T>>; 2]>,
        mut bytes: u64,
        limit: MemoryLimit,
    ) -> Result<Self, OverMemory> {
        let origin = scene.bounds.center();
        let mut first_tensor = 0;
        let mut scales: Vec<FieldScale<T>> = Vec::with_capacity(scene.scales.len());
        for (scale, factors) in scene.scales.iter().zip(factors) {
            let prepared = FieldScale::new(scale, factors, origin, first_tensor, limit.0 - bytes);
            let of_index = prepared.as_ref().map_or_else(|needed| *needed, |scale| 2 * scale.index().memory());
            bytes = bytes.saturating_add(of_index);
            limit.unless_over(INDEX, bytes)?;
            scales.extend(prepared);
            first_tensor += scale.cloud.len() as u32;
        }
        let covered = match (&scene.occupancy, scene.rules.coverage, scales.last()) {
            // The finest scale covers least. Where it has no tensor no sample counts, so rays skip that space from
            // the first step on.
            (None, Coverage::All, Some(finest)) => Some(OccupancyCells::from_index(finest.index())),
            _ => None,
        };
        // Contracted positions are computed in 64 bits, or from points whose error shrinks with the contraction.
        let farthest = if scene.rules.contraction.is_some() { MAX_SPACING } else { scene.frame.far };
        // The error of positions that decisions keep their distance from (docs/numerics.md).
        let reach = (scene.bounds.size().max_element() + farthest) * T::epsilon().f64();
        Ok(Self {
            origin,
            covered,
            position_error: T::of(reach),
            bounds: scene.bounds,
            near_far: [scene.frame.near, scene.frame.far],
            rules: scene.rules.clone(),
            background: scene.frame.background.map(T::of_f32),
            sky: scene.rules.sky.as_ref().map(FieldSky::new),
            scales,
            decoder: FieldDecoder::new(scene),
            occupancy: scene.occupancy.as_ref().map(|o| OccupancyCells::new(o, origin)),
        })
    }

    /// `point`, in model space, relative to the field's origin.
    #[inline(always)]
    pub fn relative(&self, point: DVec3) -> [T; 3] {
        (point - self.origin).to_array().map(T::of)
    }

    /// The color behind the scene along `ray`: that of the sky; without one, `background`.
    #[inline(always)]
    pub fn behind(&self, ray: &Ray, background: [T; 3]) -> [T; 3] {
        self.sky.as_ref().map_or(background, |sky| sky.color(ray.direction))
    }

    /// True if `position`, relative to the field's origin, is in the model (spec 4.1).
    #[inline(always)]
    pub fn covers(&self, position: [T; 3]) -> bool {
        // Fine scales first: they cover least.
        let mut scales = self.scales.iter().rev();
        match self.rules.coverage {
            Coverage::All => scales.all(|s| s.is_covered(position)),
            Coverage::Any => scales.any(|s| s.is_covered(position)),
        }
    }

    /// The cells outside of which no sample counts, if they are known.
    pub fn cells(&self) -> Option<&OccupancyCells<T>> {
        self.occupancy.as_ref().or(self.covered.as_ref())
    }

    /// Bound of the rounding error of positions, in model units.
    #[cfg(feature = "gpu")]
    pub fn position_error(&self) -> T {
        self.position_error
    }

    /// Number of tensors over all scales.
    pub fn tensor_count(&self) -> usize {
        self.scales.iter().map(FieldScale::len).sum()
    }

    /// Bytes of the factors, appearance matrices, decoder layers and sky.
    pub fn parameter_bytes(&self) -> u64 {
        let factors = self.scales.iter().map(FieldScale::value_count).sum::<usize>();
        let layers = self.decoder.layers.iter().map(|l| l.weights.len() + l.bias.len()).sum::<usize>();
        let sky = self.sky.as_ref().map_or(0, |sky| sky.coefficients.len());
        ((factors + layers + sky + self.decoder.appearance.len()) * size_of::<T>()) as u64
    }

    /// ΣR, the number of appearance components over all scales.
    pub fn component_count(&self) -> usize {
        self.scales.iter().map(FieldScale::appearance_rank).sum()
    }
}
