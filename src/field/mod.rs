//! The fast field: the same numbers as [`crate::model::ReferenceField`], arranged for speed. Rendering and training on
//! the CPU share it, generic over the precision: f32 for work, f64 to check the very same code.
//!
//! Positions are relative to the center of the scene's bounds, so that f32 keeps its precision far from the origin.

mod cells;
mod decoder;
mod density_cache;
mod gather;
mod index;
mod march;
mod matrix;
mod neighbors;
mod ray_marcher;
mod real;
mod scale;
mod shaded;
mod stages;
mod vector;

#[cfg(feature = "gpu")]
pub(crate) use cells::BLOCK_SHIFT;
pub use cells::OccupancyCells;
pub use decoder::{Activations, Dense, FieldDecoder};
pub use density_cache::DensityCache;
pub use gather::InterpolationSite;
#[cfg(feature = "toolkit")]
pub(crate) use gather::{all_but, load, register_at};
pub use index::CellIndex;
pub use march::Samples;
pub use matrix::{Matrix, MatrixMut, multiply};
pub use ray_marcher::RayMarcher;
pub use real::{Real, add_compensated};
use scale::aligned;
pub use scale::{Contribution, FieldScale, TensorRows};
#[cfg(feature = "toolkit")]
pub(crate) use scale::{Interpolation, offset};
pub use shaded::{Roulette, ShadedSamples};
pub use stages::{Stage, StageClock, Work};
pub use vector::Vector;

use aligned_vec::AVec;
use glam::DVec3;

use crate::geometry::Aabb;
use crate::model::{Coverage, Rules, Scene};

/// Runs `work` compiled for the best instruction set that this machine has. What `work` calls takes part only where it
/// is inlined into it.
#[inline(always)]
pub fn vectorized<R>(work: impl FnOnce() -> R) -> R {
    pulp::Arch::new().dispatch(work)
}

/// A scene's numbers, ready for fast evaluation.
#[derive(Clone, Debug)]
pub struct Field<T> {
    /// What positions are relative to, in model units.
    pub origin: DVec3,
    /// Where rays march, in model units.
    pub bounds: Aabb,
    /// Where rays begin and end, in model units.
    pub near_far: [f64; 2],
    /// The rules of the field and the march.
    pub rules: Rules,
    /// The color behind everything.
    pub background: [T; 3],
    /// Coarsest first.
    pub scales: Vec<FieldScale<T>>,
    /// From components to color.
    pub decoder: FieldDecoder<T>,
    /// Where samples count.
    pub occupancy: Option<OccupancyCells<T>>,
    /// Where there is no occupancy: what the finest scale may cover, if only that counts.
    covered: Option<OccupancyCells<T>>,
    /// What density features are read from instead of being interpolated from factors, in rendering alone.
    density_cache: Option<DensityCache<T>>,
    /// How far rounding may move a position, in model units.
    position_error: T,
}

impl<T: Real> Field<T> {
    /// Prepares `scene`, which must have passed [`Scene::check`].
    pub fn new(scene: &Scene) -> Self {
        let factors = scene.scales.iter().map(|s| [aligned(&s.factors.density), aligned(&s.factors.appearance)]);
        Self::with_factors(scene, factors.collect())
    }

    /// As [`Field::new`]; each scale's factors are dropped as soon as they are converted, so that hardly more than one
    /// copy of them is in memory at any time.
    pub fn consuming(mut scene: Scene) -> Self {
        let factors = scene.scales.iter_mut().map(|scale| {
            let factors = &mut scale.factors;
            [&mut factors.density, &mut factors.appearance].map(|values| aligned(&std::mem::take(values)))
        });
        let factors = factors.collect();
        Self::with_factors(&scene, factors)
    }

    /// Prepares `scene`, whose factors by scale, density first, are `factors`.
    fn with_factors(scene: &Scene, factors: Vec<[AVec<T>; 2]>) -> Self {
        let origin = scene.bounds.center();
        let mut first_tensor = 0;
        let scales: Vec<FieldScale<T>> = (scene.scales.iter().zip(factors))
            .map(|(scale, factors)| {
                let prepared = FieldScale::new(scale, factors, origin, first_tensor);
                first_tensor += scale.cloud.len() as u32;
                prepared
            })
            .collect();
        let covered = match (&scene.occupancy, scene.rules.coverage, scales.last()) {
            (None, Coverage::All, Some(finest)) => Some(OccupancyCells::of_index(finest.index())),
            _ => None,
        };
        let reach = (scene.bounds.size().max_element() + scene.frame.far) * T::epsilon().f64();
        Self {
            origin,
            covered,
            density_cache: None,
            position_error: T::of(reach),
            bounds: scene.bounds,
            near_far: [scene.frame.near, scene.frame.far],
            rules: scene.rules.clone(),
            background: scene.frame.background.map(T::of_f32),
            scales,
            decoder: FieldDecoder::new(scene),
            occupancy: scene.occupancy.as_ref().map(|o| OccupancyCells::new(o, origin)),
        }
    }

    /// Outside of which no sample counts, if anything says so.
    pub(crate) fn cells(&self) -> Option<&OccupancyCells<T>> {
        self.occupancy.as_ref().or(self.covered.as_ref())
    }

    /// How far rounding may move a position, in model units.
    #[cfg(feature = "gpu")]
    pub(crate) fn position_error(&self) -> T {
        self.position_error
    }

    /// Number of tensors over all scales.
    pub fn tensor_count(&self) -> usize {
        self.scales.iter().map(FieldScale::len).sum()
    }

    /// Bytes of the factors, matrices and networks.
    pub fn parameter_bytes(&self) -> u64 {
        let factors = self.scales.iter().map(|s| s.density.len() + s.appearance.len()).sum::<usize>();
        let layers = self.decoder.layers.iter().map(|l| l.weights.len() + l.bias.len()).sum::<usize>();
        ((factors + layers + self.decoder.appearance.len()) * size_of::<T>()) as u64
    }

    /// ΣR, the appearance components over all scales: a sample's row in the decoder's first product.
    pub fn component_count(&self) -> usize {
        self.scales.iter().map(|s| s.appearance_rank).sum()
    }
}
