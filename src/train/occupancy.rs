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
    let min_depth = -(-MIN_ALPHA).ln_1p() * field.rules.distance_scale;
    let (mut occupancy, layers) = dense_vertices(field, cell, min_depth, &[DVec3::ZERO]);
    let [width, height] = [occupancy.vertices.x, occupancy.vertices.y].map(|d| d as usize);
    let spread: Vec<Vec<bool>> = layers.par_iter().map(|layer| spread_in_layer(layer, width, height)).collect();
    for z in 0..occupancy.vertices.z {
        let around = &spread[z.saturating_sub(1) as usize..(z as usize + 2).min(spread.len())];
        set(&mut occupancy, z, |i| around.iter().any(|layer| layer[i]));
    }
    occupancy
}

/// As [`estimate_occupancy`], as tight as the samples of the march allow: the vertices that have an opacity over one step,
/// with the distance scale, of at least `min_alpha` at any of eight points around them, half a cell apart. Their neighbors
/// are left out, since a cell is occupied if one of its corners is.
pub(super) fn tight_occupancy<T: Real>(field: &Field<T>, cell: DVec3, min_alpha: f64) -> Occupancy {
    let around: Vec<DVec3> = (0..8).map(|n| [0, 1, 2].map(|a| f64::from(n >> a & 1) * 0.5 - 0.25).into()).collect();
    let (mut occupancy, layers) = dense_vertices(field, cell, -(-min_alpha).ln_1p(), &around);
    for (z, layer) in (0..).zip(&layers) {
        set(&mut occupancy, z, |i| layer[i]);
    }
    occupancy
}

/// Adds the vertices of layer `z` for which `is_set`(index in the layer).
fn set(occupancy: &mut Occupancy, z: u32, is_set: impl Fn(usize) -> bool) {
    let [width, height] = [occupancy.vertices.x, occupancy.vertices.y];
    for i in (0..width * height).filter(|&i| is_set(i as usize)) {
        occupancy.set(UVec3::new(i % width, i / width, z));
    }
}

/// An empty occupancy of `field` on cells of about `cell`, and \[z\]\[y\]\[x\] true if the field has an optical depth over
/// a step of at least `min_depth` at any of the points `around` a vertex, in cells.
fn dense_vertices<T: Real>(
    field: &Field<T>,
    cell: DVec3,
    min_depth: f64,
    around: &[DVec3],
) -> (Occupancy, Vec<Vec<bool>>) {
    let vertices = (field.bounds.size() / cell).ceil().max(DVec3::splat(2.0)).as_uvec3();
    let grid = Occupancy::empty(field.bounds, vertices);
    let width = vertices.x as usize;
    let layer = |z: u32| {
        let mut dense = vec![false; width * vertices.y as usize];
        let (mut samples, mut open) = (Samples::default(), Vec::new());
        let mut mark = |row: &mut [bool], y: u32, offset: DVec3| {
            open.clear();
            for x in (0..vertices.x).filter(|&x| !row[x as usize]) {
                let position = field.relative(grid.position(UVec3::new(x, y, z)) + offset * grid.cell_size());
                if field.occupancy.as_ref().is_none_or(|o| o.contains(position)) {
                    open.push((x, position));
                }
            }
            field.density_features(open.iter().map(|open| open.1), &mut samples, |index, feature| {
                row[open[index].0 as usize] = field.optical_depth(feature).f64() >= min_depth;
            });
        };
        vectorized(
            #[inline(always)]
            || {
                for (y, row) in (0..).zip(dense.chunks_exact_mut(width)) {
                    around.iter().for_each(|&offset| mark(row, y, offset));
                }
            },
        );
        dense
    };
    let layers = (0..vertices.z).into_par_iter().map(layer).collect();
    (grid, layers)
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
