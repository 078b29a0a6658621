//! Where in space a scene holds its parameters, and where its pictures' errors are.

use glam::{DVec3, IVec3};
use rayon::prelude::*;

use crate::field::{Activations, Field, Samples, vectorized};
use crate::geometry::{Aabb, Lattice};
use crate::model::{Factors, Scene};
use crate::train::RayBatch;

/// Rays that one task follows.
const CHUNK: usize = 256;
/// The standard deviation of the photographs' colors up to which a cell is of a single color: that of a channel, of 1.
pub const FLAT: f64 = 0.03;

/// A regular grid of cells, and for each what is there.
#[derive(Clone, Debug, PartialEq)]
pub struct CellMap {
    /// Cells along each axis.
    pub size: [usize; 3],
    /// Edge of a cell, in model units.
    pub edge: f64,
    /// \[z\]\[y\]\[x\].
    pub cells: Vec<Cell>,
    /// Factor entries that belong to no cell: of tensors in whose boxes no ray sees anything.
    pub unseen_parameters: f64,
}

/// What is in a cell.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Cell {
    /// Factor entries. Those of a tensor are shared out over the cells of its box by how much is seen there.
    pub parameters: f64,
    /// The squared error, over channels, of the rays that see something there, times the share that they see of it.
    pub error: f64,
    /// How much is seen: the sum of the samples' weights.
    pub weight: f64,
    /// That times the photographs' colors, and times their squares over channels.
    color: [f64; 3],
    squared_color: f64,
}

impl Cell {
    /// The standard deviation of the photographs' colors there, over channels, rays and directions; nothing where
    /// nothing is seen.
    pub fn deviation(&self) -> Option<f64> {
        if self.weight <= 0.0 {
            return None;
        }
        let squared_mean: f64 = self.color.iter().map(|c| (c / self.weight).powi(2)).sum();
        Some(((self.squared_color / self.weight - squared_mean).max(0.0) / 3.0).sqrt())
    }
}

/// What a ray leaves in a cell.
struct Seen {
    cell: usize,
    ray: usize,
    weight: f64,
}

impl CellMap {
    /// Of `scene` within `bounds`, with `along` cells along their longest edge, as `batch`'s rays see it. The same on
    /// any number of threads.
    pub fn new(scene: &Scene, bounds: &Aabb, batch: &RayBatch, along: usize) -> Self {
        let edge = bounds.size().max_element() / along.max(1) as f64;
        let size = (bounds.size() / edge).ceil().max(DVec3::ONE).to_array().map(|n| n as usize);
        let mut map = Self { size, edge, cells: vec![Cell::default(); size.iter().product()], unseen_parameters: 0.0 };
        let lattice = Lattice { origin: bounds.min, pitch: DVec3::splat(edge) };
        let field = Field::<f32>::new(scene);
        let colors = batch.colors(&field);
        for seen in map.see(&field, batch, &lattice) {
            for Seen { cell, ray, weight } in seen {
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

    /// \[chunk\] what its rays see, of samples that get a color.
    fn see(&self, field: &Field<f32>, batch: &RayBatch, lattice: &Lattice) -> Vec<Vec<Seen>> {
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
                            seen.push(Seen { cell, ray: n * CHUNK + ray, weight: f64::from(colored.weights[at]) });
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
            let rows = Factors::rows(scale.cloud.resolution);
            let held = |values: &[f32], rank: u32| Factors::nonzero_components(values, rows, rank as usize);
            let factors = &scale.factors;
            let ranks = [factors.density_rank as usize, factors.appearance_rank as usize];
            let held =
                [held(&factors.density, factors.density_rank), held(&factors.appearance, factors.appearance_rank)];
            for n in 0..scale.cloud.len() {
                let components: usize =
                    (0..2).map(|p| held[p][n * ranks[p]..][..ranks[p]].iter().filter(|h| **h).count()).sum();
                let parameters = (components * rows) as f64;
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

    /// The cells whose centers `covered` contains; the nearest one where that is none.
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
