//! Density features baked on a grid: an approximation for rendering, which then reads eight numbers a sample instead of
//! interpolating the factors of all its neighbors.

use glam::{DVec3, UVec3};
use rayon::prelude::*;

use super::{Field, OccupancyCells, Real, Samples, vectorized};

/// Cells along a brick's edge.
const BRICK: usize = 8;
/// Vertices along a brick's edge; bricks share none, so that a sample reads from one alone.
const ROW: usize = BRICK + 1;
const BRICK_VERTICES: usize = ROW * ROW * ROW;
/// The brick of those that were not baked.
const NO_BRICK: u32 = u32::MAX;

/// Density features at the vertices of a regular grid over the field's bounds, in bricks of 8³ cells; only bricks in
/// which samples may count are there.
#[derive(Clone, Debug)]
pub struct DensityCache<T> {
    min: [T; 3],
    cells_per_unit: T,
    /// Bricks along x, y and z.
    bricks: [i32; 3],
    /// \[z\]\[y\]\[x\] the brick's number.
    numbers: Vec<u32>,
    /// \[number\]\[z\]\[y\]\[x\]; not a number outside the model.
    values: Vec<T>,
}

impl<T: Real> DensityCache<T> {
    /// Bakes `field` on cubic cells, `cells` of them along the longest edge of its bounds.
    pub(super) fn bake(field: &Field<T>, cells: u32) -> Self {
        let width = field.bounds.size().max_element() / f64::from(cells);
        let brick_width = width * BRICK as f64;
        let bricks = (field.bounds.size() / brick_width).ceil().max(DVec3::ONE).as_uvec3();
        let occupied = field.cells();
        let mut numbers = Vec::new();
        let mut baked = Vec::new();
        for z in 0..bricks.z {
            for y in 0..bricks.y {
                for x in 0..bricks.x {
                    let corner = field.bounds.min + UVec3::new(x, y, z).as_dvec3() * brick_width;
                    let [min, max] = [corner, corner + brick_width].map(|p| field.relative(p));
                    let counts = occupied.is_none_or(|cells: &OccupancyCells<T>| cells.any_in(min, max));
                    numbers.push(if counts { baked.len() as u32 } else { NO_BRICK });
                    baked.extend(counts.then_some(corner));
                }
            }
        }
        let mut values = vec![T::nan(); baked.len() * BRICK_VERTICES];
        (values.par_chunks_mut(BRICK_VERTICES).zip(&baked)).for_each_init(
            Samples::default,
            |samples, (brick, corner)| {
                vectorized(
                    #[inline(always)]
                    || {
                        let positions = (0..BRICK_VERTICES).map(|v| {
                            let vertex = UVec3::new((v % ROW) as u32, (v / ROW % ROW) as u32, (v / (ROW * ROW)) as u32);
                            field.relative(*corner + vertex.as_dvec3() * width)
                        });
                        field.density_features(positions, samples, |vertex, feature| brick[vertex] = feature);
                    },
                );
            },
        );
        Self {
            min: field.relative(field.bounds.min),
            cells_per_unit: T::of(1.0 / width),
            bricks: bricks.as_ivec3().to_array(),
            numbers,
            values,
        }
    }

    /// The memory that it takes.
    pub fn bytes(&self) -> u64 {
        (size_of_val(&*self.numbers) + size_of_val(&*self.values)) as u64
    }

    /// The density feature at `position`, interpolated between those vertices of its cell that are in the model; `None`
    /// where none is.
    #[inline(always)]
    pub(super) fn feature(&self, position: [T; 3]) -> Option<T> {
        let (mut number, mut vertex) = (0, 0);
        let mut fractions = [T::zero(); 3];
        for a in [2, 1, 0] {
            let at = (position[a] - self.min[a]) * self.cells_per_unit;
            // Rounding may take a sample on a face of the bounds out of them.
            let cell = at.floor_i32().clamp(0, self.bricks[a] * BRICK as i32 - 1);
            fractions[a] = at - T::of_i32(cell);
            number = number * self.bricks[a] as usize + cell as usize / BRICK;
            vertex = vertex * ROW + cell as usize % BRICK;
        }
        let brick = self.numbers[number];
        if brick == NO_BRICK {
            return None;
        }
        let values = &self.values[brick as usize * BRICK_VERTICES..][..BRICK_VERTICES];
        let (mut sum, mut weights) = (T::zero(), T::zero());
        for corner in 0..8 {
            let value = values[vertex + (corner & 1) + ROW * (corner >> 1 & 1) + ROW * ROW * (corner >> 2)];
            let along = |a: usize| if corner >> a & 1 == 1 { fractions[a] } else { T::one() - fractions[a] };
            let weight = along(0) * along(1) * along(2);
            if !value.is_nan() {
                sum += weight * value;
                weights += weight;
            }
        }
        (weights > T::zero()).then(|| sum / weights)
    }
}

impl<T: Real> Field<T> {
    /// From now on reads density features from a grid of `cells` along the longest edge of the bounds. Whether a sample
    /// is in the model is then decided on the grid, too. Not for training.
    pub fn cache_density(&mut self, cells: u32) {
        self.density_cache = None;
        self.density_cache = Some(DensityCache::bake(self, cells));
    }

    /// The memory that cached density features take; `None` where they are not cached.
    pub fn density_cache_bytes(&self) -> Option<u64> {
        self.density_cache.as_ref().map(DensityCache::bytes)
    }
}
