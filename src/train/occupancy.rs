//! Estimation of the occupancy from a field in training (spec 3.6).

use glam::{DVec3, UVec3};
use rayon::prelude::*;

use strivec_field::{Field, Real, Samples, vectorized};
use strivec_format::model::Occupancy;

/// The most vertices of an occupancy, half of what a file may have: larger grids have larger cells than asked for. Those of contracted
/// space have as fine cells far away as close by.
const MOST_VERTICES: f64 = (1 << 27) as f64;
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

/// An occupancy as tight as its vertices allow: on the cells that have an opacity over one step, with the
/// distance scale, of at least `min_alpha` at any of eight points in them, half a cell apart. A vertex occupies the eight
/// cells around it, so few others are occupied beside them.
pub(super) fn tight_occupancy<T: Real>(field: &Field<T>, cell: DVec3, min_alpha: f64) -> Occupancy {
    // Not a vertex on every side of a dense cell, which adds a cell all around: a frame evaluates 1.8 instead of 3.6
    // million samples, and pictures hardly change (docs/experiments/2026-11-26-tight-occupancy.md).
    let within: Vec<DVec3> = (0..8).map(|n| [0, 1, 2].map(|a| f64::from(n >> a & 1) * 0.5 + 0.25).into()).collect();
    let (mut occupancy, cells) = dense_vertices(field, cell, -(-min_alpha).ln_1p(), &within);
    occupy_cells(&mut occupancy, cells);
    occupancy
}

/// Sets vertices of `occupancy` such that all `cells` are occupied, \[z\]\[y\]\[x\] by their smallest vertex, and few
/// others: first the vertices with the most such cells around them, each if one of these is not occupied yet.
pub(super) fn occupy_cells(occupancy: &mut Occupancy, mut cells: Vec<Vec<bool>>) {
    let [width, height, _] = occupancy.vertices.to_array().map(|v| v as usize);
    let last = occupancy.vertices - 2;
    // Layers and indices of cells; those behind the last vertex are outside the bounds.
    let cells_around = |vertex: UVec3| {
        (0..8).filter_map(move |n| {
            let cell = vertex.checked_sub(UVec3::new(n & 1, n >> 1 & 1, n >> 2))?;
            cell.cmple(last).all().then(|| (cell.z as usize, cell.y as usize * width + cell.x as usize))
        })
    };
    let vertex_at = |index: usize, z: usize| UVec3::new((index % width) as u32, (index / width) as u32, z as u32);
    let count_around = |vertex| cells_around(vertex).filter(|&(z, i)| cells[z][i]).count() as u8;
    let counts: Vec<Vec<u8>> = (0..cells.len())
        .into_par_iter()
        .map(|z| (0..width * height).map(|i| count_around(vertex_at(i, z))).collect())
        .collect();
    // Greedy: a vertex with all eight cells dense occupies no other cell. Then those that occupy the fewest others.
    for count in (1..=8).rev() {
        for (z, counts) in counts.iter().enumerate() {
            for (i, _) in counts.iter().enumerate().filter(|c| *c.1 == count) {
                let vertex = vertex_at(i, z);
                let mut is_needed = false;
                for (z, i) in cells_around(vertex) {
                    is_needed |= std::mem::take(&mut cells[z][i]);
                }
                if is_needed {
                    occupancy.set(vertex);
                }
            }
        }
    }
}

/// The vertices of a grid of this `size`, in cells of about `cell` or of larger ones, at most [`MOST_VERTICES`].
fn vertices_within(size: DVec3, cell: DVec3) -> UVec3 {
    let mut times = 1.0;
    loop {
        let vertices = (size / (times * cell)).ceil().max(DVec3::splat(2.0));
        let excess = vertices.element_product() / MOST_VERTICES;
        if excess <= 1.0 {
            return vertices.as_uvec3();
        }
        times *= excess.cbrt().max(1.001);
    }
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
    let vertices = vertices_within(field.bounds.size(), cell);
    let grid = Occupancy::empty(field.bounds, vertices);
    let width = vertices.x as usize;
    let layer = |z: u32| {
        let mut dense = vec![false; width * vertices.y as usize];
        let (mut samples, mut open) = (Samples::default(), Vec::new());
        let mut mark = |row: &mut [bool], y: u32, offset: DVec3| {
            open.clear();
            for x in (0..vertices.x).filter(|&x| !row[x as usize]) {
                let position = field.relative(grid.position(UVec3::new(x, y, z)) + offset * grid.cell_size());
                // Space that was empty once stays empty, and need not be evaluated.
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
    // Axis by axis: three looks for an axis instead of 27.
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

#[cfg(test)]
mod tests {
    use super::*;
    use strivec_format::geometry::Aabb;
    use strivec_format::random::Random;

    /// The occupancy of `cells`, and the number of other cells that it has.
    fn cover(vertices: UVec3, is_dense: impl Fn(UVec3) -> bool) -> (Occupancy, usize) {
        let mut occupancy = Occupancy::empty(Aabb { min: DVec3::ZERO, max: DVec3::ONE }, vertices);
        let cell_at = |z: u32, index: u32| UVec3::new(index % vertices.x, index / vertices.x, z);
        let layer = |z| (0..vertices.x * vertices.y).map(|i| is_dense(cell_at(z, i))).collect();
        let cells: Vec<Vec<bool>> = (0..vertices.z).map(layer).collect();
        occupy_cells(&mut occupancy, cells);
        let mut others = 0;
        for z in 0..vertices.z - 1 {
            for cell in (0..vertices.x * vertices.y).map(|i| cell_at(z, i)).filter(|c| c.cmplt(vertices - 1).all()) {
                let is_occupied = occupancy.cell_is_occupied(cell.as_ivec3());
                assert!(is_occupied || !is_dense(cell), "{cell}");
                others += usize::from(is_occupied && !is_dense(cell));
            }
        }
        (occupancy, others)
    }

    #[test]
    fn a_grid_of_very_fine_cells_has_larger_ones() {
        assert_eq!(vertices_within(DVec3::new(4.0, 2.0, 1.0), DVec3::splat(0.1)), UVec3::new(40, 20, 10));
        for (size, cell) in [(DVec3::splat(4.0), 0.0053), (DVec3::new(1e-9, 4.0, 4.0), 1e-6), (DVec3::splat(1e9), 1e-9)]
        {
            let vertices = vertices_within(size, DVec3::splat(cell)).as_dvec3();
            let count = vertices.element_product();
            assert!(
                count <= MOST_VERTICES && count > 0.9 * MOST_VERTICES && vertices.min_element() >= 2.0,
                "{vertices}"
            );
        }
    }

    #[test]
    fn dense_cells_are_occupied_and_few_others() {
        let vertices = UVec3::new(20, 17, 23);
        let (wall, others) = cover(vertices, |cell| [7, 8].contains(&cell.x));
        assert_eq!(others, 0, "two cells thick");
        assert!(wall.iter().all(|vertex| vertex.x == 8));
        let (_, others) = cover(vertices, |cell| cell.x == 7);
        assert_eq!(others, 16 * 22, "one cell thick");
        let (_, others) = cover(vertices, |cell| cell == UVec3::ZERO);
        assert_eq!(others, 0, "a vertex of the bounds has one cell");
        let random = Random::new(3, "dense");
        let dense: Vec<bool> = (0..20 * 17 * 23).map(|n| random.below(n, 9) == 0).collect();
        cover(vertices, |cell| dense[((cell.z * 17 + cell.y) * 20 + cell.x) as usize]);
    }
}
