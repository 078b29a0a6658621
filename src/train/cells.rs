//! The parameters of a scene and the errors of its pictures, by cells of space.

use glam::{DVec3, IVec3};
use rayon::prelude::*;

use crate::RayBatch;
use strivec_field::{Activations, Field, Samples, vectorized};
use strivec_format::geometry::{Aabb, Lattice};
use strivec_format::model::Scene;

/// Rays per task.
const CHUNK: usize = 256;
/// The largest standard deviation of the photographs' colors, per channel in \[0, 1\], of a cell that counts as one
/// color.
pub const FLAT: f64 = 0.03;

/// A regular grid of cells with parameters and errors.
#[derive(Clone, Debug, PartialEq)]
pub struct CellMap {
    /// Cells along each axis.
    pub size: [usize; 3],
    /// Edge of a cell, in model units.
    pub edge: f64,
    /// \[z\]\[y\]\[x\] the cells.
    pub cells: Vec<Cell>,
    /// Factor entries of tensors in whose boxes no ray sees anything; they belong to no cell.
    pub unseen_parameters: f64,
}

/// Parameters, errors and colors of a cell.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Cell {
    /// Factor entries. Those of a tensor are distributed over the cells of its box in proportion to their weights.
    pub parameters: f64,
    /// Squared error of the rays through the cell, summed over channels, weighted by the cell's share of each ray.
    pub error: f64,
    /// The sum of the samples' visibility weights.
    pub weight: f64,
    /// The photographs' colors, and their squares summed over channels, both weighted.
    color: [f64; 3],
    squared_color: f64,
}

impl Cell {
    /// The standard deviation of the photographs' colors in the cell, over channels, rays and directions; `None` if no
    /// ray sees the cell.
    pub fn deviation(&self) -> Option<f64> {
        if self.weight <= 0.0 {
            return None;
        }
        let squared_mean: f64 = self.color.iter().map(|c| (c / self.weight).powi(2)).sum();
        Some(((self.squared_color / self.weight - squared_mean).max(0.0) / 3.0).sqrt())
    }
}

/// The contribution of a ray's sample to a cell.
struct CellContribution {
    cell: usize,
    ray: usize,
    weight: f64,
}

impl CellMap {
    /// The map of `scene` within `bounds`, with `along` cells along their longest edge, measured by `batch`'s rays. The
    /// result does not depend on the number of threads.
    pub fn new(scene: &Scene, bounds: &Aabb, batch: &RayBatch, along: usize) -> Self {
        let edge = bounds.size().max_element() / along.max(1) as f64;
        let size = (bounds.size() / edge).ceil().max(DVec3::ONE).to_array().map(|n| n as usize);
        let mut map = Self { size, edge, cells: vec![Cell::default(); size.iter().product()], unseen_parameters: 0.0 };
        let lattice = Lattice { origin: bounds.min, pitch: DVec3::splat(edge) };
        let field = Field::<f32>::unlimited(scene);
        let colors = batch.colors(&field);
        for seen in map.see(&field, batch, &lattice) {
            for CellContribution { cell, ray, weight } in seen {
                let (cell, target) = (&mut map.cells[cell], &batch.targets[ray].color);
                cell.weight += weight;
                for (c, (&shown, &wanted)) in colors[ray].iter().zip(target).enumerate() {
                    cell.error += weight * f64::from(shown - wanted).powi(2);
                    cell.color[c] += weight * f64::from(wanted);
                    cell.squared_color += weight * f64::from(wanted).powi(2);
                }
            }
        }
        map.share_out_parameters(scene, &lattice);
        map
    }

    /// \[chunk\] the shaded samples of its rays.
    fn see(&self, field: &Field<f32>, batch: &RayBatch, lattice: &Lattice) -> Vec<Vec<CellContribution>> {
        (batch.rays.par_chunks(CHUNK).enumerate())
            .map_init(<(Samples<f32>, Activations<f32>)>::default, |(samples, activations), (n, rays)| {
                vectorized(
                    #[inline(always)]
                    || {
                        field.march(rays, samples);
                        field.select_shaded(samples, None, &mut activations.shaded);
                    },
                );
                let colored = &activations.shaded;
                let mut seen = Vec::with_capacity(colored.len());
                for ray in 0..rays.len() {
                    for at in colored.ray_range(ray) {
                        let position = samples.positions[colored.slots[at] as usize].map(f64::from);
                        if let Some(cell) = self.cell_of(lattice, field.origin + DVec3::from_array(position)) {
                            seen.push(CellContribution {
                                cell,
                                ray: n * CHUNK + ray,
                                weight: f64::from(colored.weights[at]),
                            });
                        }
                    }
                }
                seen
            })
            .collect()
    }

    fn cell_of(&self, lattice: &Lattice, position: DVec3) -> Option<usize> {
        let cell = lattice.cell_of(position);
        let is_within = cell.cmpge(IVec3::ZERO).all() && (0..3).all(|a| (cell[a] as usize) < self.size[a]);
        is_within.then(|| self.index(cell.to_array().map(|c| c as usize)))
    }

    fn index(&self, [x, y, z]: [usize; 3]) -> usize {
        (z * self.size[1] + y) * self.size[0] + x
    }

    fn share_out_parameters(&mut self, scene: &Scene, lattice: &Lattice) {
        for scale in &scene.scales {
            let resolution = scale.cloud.resolution;
            let mut of_tensor = vec![0; scale.cloud.len()];
            for block in scale.factors.blocks() {
                let (rank, rows) = (block.rank as usize, block.form.rows(resolution));
                let held = block.nonzero_components(resolution);
                for (sum, held) in of_tensor.iter_mut().zip(held.chunks_exact(rank)) {
                    *sum += rows * held.iter().filter(|h| **h).count();
                }
            }
            for (n, &parameters) in of_tensor.iter().enumerate() {
                let parameters = parameters as f64;
                let covered = self.cells_in(lattice, &Aabb::around(scale.cloud.center(n), scale.cloud.half_edge));
                let seen: f64 = covered.iter().map(|&c| self.cells[c].weight).sum();
                if seen > 0.0 {
                    covered.iter().for_each(|&c| self.cells[c].parameters += parameters * self.cells[c].weight / seen);
                } else {
                    self.unseen_parameters += parameters;
                }
            }
        }
    }

    /// The cells whose centers `covered` contains; the nearest cell if there are none.
    fn cells_in(&self, lattice: &Lattice, covered: &Aabb) -> Vec<usize> {
        let range = |a: usize| {
            let most = self.size[a] - 1;
            let at = |position: f64| (position - lattice.origin[a]) / self.edge - 0.5;
            let first = (at(covered.min[a]).ceil().max(0.0) as usize).min(most);
            let last = (at(covered.max[a]).floor().max(0.0) as usize).clamp(first, most);
            first..=last
        };
        let [xs, ys, zs] = [range(0), range(1), range(2)];
        let rows = zs.flat_map(|z| ys.clone().map(move |y| [y, z]));
        rows.flat_map(|[y, z]| xs.clone().map(move |x| [x, y, z])).map(|cell| self.index(cell)).collect()
    }

    /// \[z\]\[x\], the top row first: the sums of `value` along y, as seen from the front.
    pub fn from_the_front(&self, value: impl Fn(&Cell) -> f64) -> Vec<Vec<f64>> {
        let sum = |x: usize, z: usize| (0..self.size[1]).map(|y| value(&self.cells[self.index([x, y, z])])).sum();
        (0..self.size[2]).rev().map(|z| (0..self.size[0]).map(|x| sum(x, z)).collect()).collect()
    }
}
