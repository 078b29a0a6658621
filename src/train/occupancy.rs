//! Estimation of the occupancy from a field in training (spec 3.6).

use glam::{DVec3, UVec3};
use rayon::prelude::*;

use crate::field::{Field, Real, Samples, vectorized};
use crate::model::Occupancy;

/// The least opacity of one step, without the distance scale, at which a vertex is dense.
const MIN_ALPHA: f64 = 1e-4;

/// The occupancy of `field` over its bounds, on cells of about `cell` (model units): vertices whose opacity over one
/// step is at least 1e-4, and their neighbors. If the field has an occupancy already, vertices outside of it stay
/// empty.
pub fn estimate_occupancy<T: Real>(field: &Field<T>, cell: DVec3) -> Occupancy {
    let vertices = (field.bounds.size() / cell).ceil().max(DVec3::splat(2.0)).as_uvec3();
    let mut occupancy = Occupancy::empty(field.bounds, vertices);
    let layers: Vec<Vec<bool>> = (0..vertices.z)
        .into_par_iter()
        .map(|z| {
            vectorized(
                #[inline(always)]
                || dense_vertices(field, &occupancy, z),
            )
        })
        .collect();
    let (width, height) = (vertices.x as usize, vertices.y as usize);
    let spread: Vec<Vec<bool>> = layers.par_iter().map(|layer| spread_in_layer(layer, width, height)).collect();
    for z in 0..vertices.z {
        let around = &spread[z.saturating_sub(1) as usize..(z as usize + 2).min(spread.len())];
        for i in 0..width * height {
            if around.iter().any(|layer| layer[i]) {
                occupancy.set(UVec3::new((i % width) as u32, (i / width) as u32, z));
            }
        }
    }
    occupancy
}

/// \[y\]\[x\] true if the vertices of layer `z` are dense, without their neighbors.
#[inline(always)]
fn dense_vertices<T: Real>(field: &Field<T>, grid: &Occupancy, z: u32) -> Vec<bool> {
    let mut samples = Samples::default();
    let mut dense = Vec::with_capacity((grid.vertices.x * grid.vertices.y) as usize);
    let min_depth = -(-MIN_ALPHA).ln_1p() * field.rules.distance_scale;
    for y in 0..grid.vertices.y {
        for x in 0..grid.vertices.x {
            let position = field.relative(grid.position(UVec3::new(x, y, z)));
            let known_empty = field.occupancy.as_ref().is_some_and(|o| !o.contains(position));
            let feature = if known_empty { None } else { field.density_feature(position, &mut samples) };
            dense.push(feature.is_some_and(|f| field.optical_depth(f).f64() >= min_depth));
        }
    }
    dense
}

/// Dilation by one vertex along x and y.
fn spread_in_layer(layer: &[bool], width: usize, height: usize) -> Vec<bool> {
    let along_x: Vec<bool> = (0..layer.len())
        .map(|i| {
            let x = i % width;
            layer[i] || (x > 0 && layer[i - 1]) || (x + 1 < width && layer[i + 1])
        })
        .collect();
    (0..layer.len())
        .map(|i| {
            let y = i / width;
            along_x[i] || (y > 0 && along_x[i - width]) || (y + 1 < height && along_x[i + width])
        })
        .collect()
}
