//! Baking density features on a grid.

use glam::{DVec3, UVec3};
use rayon::prelude::*;

use super::density_cache::{BRICK, BRICK_VERTICES, NO_BRICK, ROW};
use super::{DensityCache, Field, Real, Samples, vectorized};

impl<T: Real> Field<T> {
    /// Bakes density features on a grid of `cells` cells along the longest edge of the bounds. Rendering then reads
    /// density features from the grid, which also decides whether a sample is in the model. Not for training.
    pub fn cache_density(&mut self, cells: u32) {
        self.density_cache = None;
        self.density_cache = Some(self.bake_density(cells));
    }

    /// Bytes of the cached density features; `None` if they are not cached.
    pub fn density_cache_bytes(&self) -> Option<u64> {
        self.density_cache.as_ref().map(DensityCache::bytes)
    }

    /// Bakes the density features on cubic cells, `cells` of them along the longest edge of the bounds.
    fn bake_density(&self, cells: u32) -> DensityCache<T> {
        let width = self.bounds.size().max_element() / f64::from(cells);
        let brick_width = width * BRICK as f64;
        let bricks = (self.bounds.size() / brick_width).ceil().max(DVec3::ONE).as_uvec3();
        let mut brick_indices = Vec::new();
        let mut baked = Vec::new();
        for z in 0..bricks.z {
            for y in 0..bricks.y {
                for x in 0..bricks.x {
                    let corner = self.bounds.min + UVec3::new(x, y, z).as_dvec3() * brick_width;
                    let [min, max] = [corner, corner + brick_width].map(|p| self.relative(p));
                    let counts = self.may_count_in(min, max);
                    brick_indices.push(if counts { baked.len() as u32 } else { NO_BRICK });
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
                            self.relative(*corner + vertex.as_dvec3() * width)
                        });
                        self.density_features(positions, samples, |vertex, feature| brick[vertex] = feature);
                    },
                );
            },
        );
        DensityCache {
            min: self.relative(self.bounds.min),
            cells_per_unit: T::of(1.0 / width),
            bricks: bricks.as_ivec3().to_array(),
            brick_indices,
            values,
        }
    }
}
