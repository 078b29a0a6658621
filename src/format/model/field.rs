//! The reference field: spec 4 in f64, written for clarity. Every other implementation is compared with this one, so
//! nothing here is shared with them.
//!
//! Besides its value, each query returns its *decision margin* (spec 4.10): the smallest displacement of the point, per
//! axis and in model units, that changes a discrete decision (the covering tensors, the nearest ones, the occupancy).
//! Implementations in lower precision must agree if the margin exceeds their own position error.

use std::collections::HashMap;

use glam::{DVec3, IVec3};

use super::decoder::Decoder;
use super::factors::{Block, Form};
use super::memory::OverMemory;
use super::occupancy::Occupancy;
use super::rules::{Aggregation, Coverage, Reduction};
use super::scale::Scale;
use super::scene::Scene;

/// Margins are exact below this, in model units, and reported as at least this above it. In scenes whose bounds are
/// much larger or smaller than a few units it scales with the bounds ([`ReferenceField::margin_horizon`]).
pub const MARGIN_HORIZON: f64 = 1e-3;

/// The longest edges of bounds for which [`MARGIN_HORIZON`] holds.
const ORDINARY_EXTENT: [f64; 2] = [1.0 / 16.0, 16.0];

/// One of the tensors that a point aggregates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Neighbor {
    /// Number of the tensor in the scale.
    pub tensor: usize,
    /// Distance from the point to the tensor's center, in model units.
    pub distance: f64,
    /// Weight w of the tensor (spec 4.4).
    pub weight: f64,
}

/// A point with its neighbors.
#[derive(Clone, Debug)]
pub struct LocatedPoint {
    /// Position of the point, in model units.
    pub position: DVec3,
    /// \[scale\] the neighbors, nearest first; empty if the scale does not cover the point.
    pub neighbors: Vec<Vec<Neighbor>>,
    /// True if the point is in the model.
    pub covered: bool,
    /// The decision margin of coverage and neighbors, in model units.
    pub margin: f64,
}

/// The density feature at a point and its gradient.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DensityAt {
    /// f, before shift and softplus.
    pub feature: f64,
    /// ∂f/∂position.
    pub gradient: DVec3,
    /// The sum of the absolute values of all products in f; rounding errors are relative to it.
    pub magnitude: f64,
}

/// max(x, 0) + ln(1 + exp(−|x|)).
pub fn softplus(x: f64) -> f64 {
    x.max(0.0) + (-x.abs()).exp().ln_1p()
}

/// 1/(1 + exp(−x)), the derivative of [`softplus`].
pub fn sigmoid(x: f64) -> f64 {
    1.0 / (1.0 + (-x).exp())
}

/// 1 − exp(−`optical_depth`).
pub fn alpha(optical_depth: f64) -> f64 {
    -(-optical_depth).exp_m1()
}

/// The field of a scene (spec 4), in f64. The scene must have passed [`Scene::check`].
///
/// # Examples
///
/// ```
/// use strivec_format::model::ReferenceField;
///
/// let bytes = include_bytes!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../fixtures/v1/smallest.strivec"));
/// let scene = strivec_format::container::decode(bytes)?;
/// let field = ReferenceField::new(&scene);
/// let point = field.locate(scene.scales[0].cloud.center(0));
/// assert!(point.covered);
/// let sigma = field.density(field.density_feature(&point).feature);
/// let color = field.decode(&field.appearance_features(&point), glam::DVec3::NEG_Z);
/// assert!(sigma >= 0.0 && color.iter().all(|c| (0.0..=1.0).contains(c)));
/// # Ok::<(), strivec_format::container::Error>(())
/// ```
#[derive(Debug)]
pub struct ReferenceField<'a> {
    scene: &'a Scene,
    horizon: f64,
    buckets: Vec<Buckets>,
}

/// The tensors of a scale by the cells, a little over one edge length wide, that they reach within the margin horizon.
#[derive(Debug)]
struct Buckets {
    width: DVec3,
    tensors: HashMap<IVec3, Vec<u32>>,
}

impl Buckets {
    fn new(scale: &Scale, horizon: f64) -> Self {
        let width = Self::width(scale, horizon);
        let mut tensors = HashMap::<IVec3, Vec<u32>>::new();
        for (n, center) in scale.cloud.centers().enumerate() {
            let [first, last] = Self::reach(scale, horizon, center);
            for z in first.z..=last.z {
                for y in first.y..=last.y {
                    for x in first.x..=last.x {
                        tensors.entry(IVec3::new(x, y, z)).or_default().push(n as u32);
                    }
                }
            }
        }
        Self { width, tensors }
    }

    fn width(scale: &Scale, horizon: f64) -> DVec3 {
        2.0 * scale.cloud.half_edge + 4.0 * horizon
    }

    /// The first and the last cell that the tensor at `center` reaches, on each axis.
    fn reach(scale: &Scale, horizon: f64, center: DVec3) -> [IVec3; 2] {
        let (reach, width) = (scale.cloud.half_edge + 2.0 * horizon, Self::width(scale, horizon));
        [center - reach, center + reach].map(|corner| (corner / width).floor().as_ivec3())
    }

    /// The most bytes that the buckets of `scale` take.
    fn memory(scale: &Scale, horizon: f64) -> u64 {
        /// An entry alone in its cell: a list of four on the heap, and its place in a table that is being doubled.
        const ENTRY_BYTES: u64 = 160;
        let entries = |center| {
            let [first, last] = Self::reach(scale, horizon, center);
            (last - first + 1).as_u64vec3().element_product()
        };
        ENTRY_BYTES * scale.cloud.centers().map(entries).sum::<u64>()
    }

    /// Every tensor that covers `position`, or does so after a displacement within the horizon, ascending.
    fn near(&self, position: DVec3) -> &[u32] {
        let cell = (position / self.width).floor().as_ivec3();
        self.tensors.get(&cell).map_or(&[], Vec::as_slice)
    }
}

impl<'a> ReferenceField<'a> {
    /// Prepares `scene` for queries.
    pub fn new(scene: &'a Scene) -> Self {
        let horizon = horizon_of(scene);
        Self { scene, horizon, buckets: scene.scales.iter().map(|s| Buckets::new(s, horizon)).collect() }
    }

    /// The most bytes of memory that [`Self::new`] takes for `scene`.
    pub fn memory(scene: &Scene) -> u64 {
        let horizon = horizon_of(scene);
        scene.scales.iter().map(|s| Buckets::memory(s, horizon)).sum()
    }

    /// Checks that [`Self::new`] takes at most the memory that `scene` allows.
    ///
    /// # Errors
    ///
    /// [`OverMemory`].
    pub fn check_memory(scene: &Scene) -> Result<(), OverMemory> {
        scene.memory.unless_over("the reference field", Self::memory(scene))
    }

    /// Margins of this scene are exact below this, in model units, and reported as at least this above it.
    pub fn margin_horizon(&self) -> f64 {
        self.horizon
    }

    /// The scene.
    pub fn scene(&self) -> &'a Scene {
        self.scene
    }

    /// The neighbors of `position`, in model units, with their weights (spec 4.1, 4.2 and 4.4).
    pub fn locate(&self, position: DVec3) -> LocatedPoint {
        let mut margin = self.horizon;
        let neighbors: Vec<_> = (self.scene.scales.iter().zip(&self.buckets))
            .map(|(scale, buckets)| {
                let (neighbors, scale_margin) = self.nearest(scale, buckets.near(position), position);
                margin = margin.min(scale_margin);
                neighbors
            })
            .collect();
        let covered = match self.scene.rules.coverage {
            Coverage::All => neighbors.iter().all(|n| !n.is_empty()),
            Coverage::Any => neighbors.iter().any(|n| !n.is_empty()),
        };
        LocatedPoint { position, neighbors, covered, margin }
    }

    fn nearest(&self, scale: &Scale, near: &[u32], position: DVec3) -> (Vec<Neighbor>, f64) {
        let top_k = scale.top_k as usize;
        let half = scale.cloud.half_edge;
        // The distance to a tensor, and how far the point is from a face of its box: positive outside, at most 0 inside.
        let to = |n: u32| {
            let offset = position - scale.cloud.center(n as usize);
            (offset.length(), (offset.abs() - half).max_element())
        };
        // (distance, tensor) of the nearest covering tensors and of the next, without an order among all of them: they may be
        // any number. Centers are stored ascending by (z, y, x), so the smaller number is the lexicographically smaller center.
        let mut covering: Vec<(f64, usize)> = Vec::with_capacity(top_k + 2);
        for &n in near {
            let (distance, outside) = to(n);
            if outside <= 0.0 && (covering.len() <= top_k || distance < covering[top_k].0) {
                covering.insert(covering.partition_point(|c| c.0 <= distance), (distance, n as usize));
                covering.truncate(top_k + 1);
            }
        }
        let nearest = &covering[..covering.len().min(top_k)];

        // A tensor whose box begins or ends here matters if it is, or would be, among the nearest.
        let reach = if covering.len() >= top_k { nearest[top_k - 1].0 + 4.0 * self.horizon } else { f64::INFINITY };
        let faces = near.iter().map(|&n| to(n)).filter(|c| c.0 <= reach).map(|c| c.1.abs());
        let mut margin = faces.fold(f64::INFINITY, f64::min);
        if let Some(next) = covering.get(top_k) {
            // A displacement by e on every axis changes a distance by up to √3·e, a difference of two by twice that.
            margin = margin.min((next.0 - nearest[top_k - 1].0) / (2.0 * 3.0_f64.sqrt()));
        }

        let weights = aggregation_weights(self.scene.rules.aggregation, nearest.iter().map(|c| c.0));
        let neighbors = (nearest.iter().zip(weights))
            .map(|(&(distance, tensor), weight)| Neighbor { tensor, distance, weight })
            .collect();
        (neighbors, margin)
    }

    /// The occupancy of `position` (spec 4.8), true if occupied, and the margin of this decision in model units.
    pub fn occupied(&self, position: DVec3) -> (bool, f64) {
        match &self.scene.occupancy {
            None => (true, self.horizon),
            Some(occupancy) => (occupancy.contains(position), occupancy_margin(occupancy, position, self.horizon)),
        }
    }

    /// The density feature f at a point of the model (spec 4.3 and 4.5).
    pub fn density_feature(&self, point: &LocatedPoint) -> DensityAt {
        let mut sum = DensityAt { feature: 0.0, gradient: DVec3::ZERO, magnitude: 0.0 };
        let mut scales = 0;
        for (scale, neighbors) in self.scene.scales.iter().zip(&point.neighbors) {
            if neighbors.is_empty() {
                continue;
            }
            scales += 1;
            let of = |n: &Neighbor| density_of(scale, n.tensor, point.position - scale.cloud.center(n.tensor));
            let values: Vec<_> = neighbors.iter().map(of).collect();
            let mean: f64 = neighbors.iter().zip(&values).map(|(n, value)| n.weight * value.0).sum();
            for (n, (value, slope, magnitude)) in neighbors.iter().zip(values) {
                sum.feature += n.weight * value;
                sum.magnitude += n.weight * magnitude;
                sum.gradient += n.weight * slope;
                if n.distance > 0.0 && neighbors.len() > 1 {
                    // w = u/Σu with u = 1/d: ∂f/∂x gains ∇u·(G − f_scale)/Σu, where f_scale is Σ w G.
                    let direct = (point.position - scale.cloud.center(n.tensor)) / n.distance;
                    sum.gradient -= direct * (n.weight / n.distance) * (value - mean);
                }
            }
        }
        if self.scene.rules.density_reduction == Reduction::Mean {
            sum.feature /= f64::from(scales);
            sum.gradient /= f64::from(scales);
            sum.magnitude /= f64::from(scales);
        }
        sum
    }

    /// The density σ of a density feature (spec 4.5).
    pub fn density(&self, feature: f64) -> f64 {
        softplus(feature + self.scene.rules.density_shift)
    }

    /// The P appearance features F at a point of the model (spec 4.6).
    pub fn appearance_features(&self, point: &LocatedPoint) -> Vec<f64> {
        let mut features = vec![0.0; self.scene.features() as usize];
        let mut scales = 0;
        for (scale, neighbors) in self.scene.scales.iter().zip(&point.neighbors) {
            if neighbors.is_empty() {
                continue;
            }
            scales += 1;
            let mut components = vec![0.0; scale.factors.appearance_rank() as usize];
            for n in neighbors {
                let interpolation = AxisInterpolation::at(scale, point.position - scale.cloud.center(n.tensor));
                let mut first = 0;
                for block in &scale.factors.appearance {
                    interpolation.for_each(block, n.tensor, n.weight, |r, (value, _)| components[first + r] += value);
                    first += block.rank as usize;
                }
            }
            for (feature, row) in
                features.iter_mut().zip(scale.appearance_matrix.weights.chunks_exact(components.len()))
            {
                *feature += row.iter().zip(&components).map(|(&b, a)| f64::from(b) * a).sum::<f64>();
            }
        }
        if self.scene.rules.appearance_reduction == Reduction::Mean {
            features.iter_mut().for_each(|f| *f /= f64::from(scales));
        }
        features
    }

    /// The color, in \[0, 1\], of P `features` along the unit vector `direction` from the camera (spec 4.7).
    pub fn decode(&self, features: &[f64], direction: DVec3) -> [f64; 3] {
        self.decoder_output(features, direction).map(sigmoid)
    }

    /// [`ReferenceField::decode`] before the sigmoid: y of spec 4.7.
    pub fn decoder_output(&self, features: &[f64], direction: DVec3) -> [f64; 3] {
        let mut values = decoder_input(&self.scene.decoder, features, direction);
        let layers = &self.scene.decoder.layers;
        for (i, layer) in layers.iter().enumerate() {
            let mut outputs: Vec<f64> = layer.bias.iter().map(|&b| f64::from(b)).collect();
            for (output, row) in outputs.iter_mut().zip(layer.weights.chunks_exact(layer.inputs as usize)) {
                *output += row.iter().zip(&values).map(|(&w, v)| f64::from(w) * v).sum::<f64>();
            }
            if i + 1 < layers.len() {
                outputs.iter_mut().for_each(|v| *v = v.max(0.0));
            }
            values = outputs;
        }
        [values[0], values[1], values[2]]
    }
}

/// The margin horizon of `scene`.
fn horizon_of(scene: &Scene) -> f64 {
    let extent = scene.bounds.size().max_element();
    let [least, most] = ORDINARY_EXTENT;
    MARGIN_HORIZON * (extent / extent.clamp(least, most))
}

/// Weights of neighbors at these distances, nearest first (spec 4.4).
fn aggregation_weights(aggregation: Aggregation, distances: impl Iterator<Item = f64> + Clone) -> Vec<f64> {
    let Some(nearest) = distances.clone().next() else { return Vec::new() };
    let (raw, divisor): (Vec<f64>, f64) = match aggregation {
        // The limit at a center. No two centers coincide.
        Aggregation::Normalized if nearest == 0.0 => {
            (distances.enumerate().map(|(i, _)| if i == 0 { 1.0 } else { 0.0 }).collect(), 1.0)
        }
        Aggregation::Normalized => {
            let raw: Vec<f64> = distances.map(|d| nearest / d).collect();
            let sum = raw.iter().sum();
            (raw, sum)
        }
        Aggregation::Clamped => {
            let raw: Vec<f64> = distances.map(|d| 1.0 / (d + 1e-6)).collect();
            let sum: f64 = raw.iter().sum();
            (raw, sum.max(1.0))
        }
    };
    raw.into_iter().map(|w| w / divisor).collect()
}

/// The interpolation at an offset from a tensor's center, on its three axes (spec 4.3).
struct AxisInterpolation {
    resolution: [u32; 3],
    /// The lower vertex, per axis.
    lower: [usize; 3],
    /// Position between it and the next, in [0, 1].
    fractions: [f64; 3],
    /// Cells per model unit.
    cells_per_unit: DVec3,
}

/// A number of a component, and its slopes on x, y and z, per model unit.
type ValueAndSlopes = (f64, DVec3);

impl AxisInterpolation {
    fn at(scale: &Scale, offset: DVec3) -> Self {
        let resolution = scale.cloud.resolution;
        let mut lower = [0; 3];
        let mut fractions = [0.0; 3];
        for a in 0..3 {
            let cells = f64::from(resolution[a]);
            let u = (offset[a] + scale.cloud.half_edge[a]) / (2.0 * scale.cloud.half_edge[a]) * cells;
            let vertex = u.floor().clamp(0.0, cells - 1.0);
            lower[a] = vertex as usize;
            fractions[a] = u - vertex;
        }
        Self { resolution, lower, fractions, cells_per_unit: 1.0 / scale.cloud.cell_size() }
    }

    /// Calls `take` with `weight` times each component of `block`.
    fn for_each(&self, block: &Block, tensor: usize, weight: f64, mut take: impl FnMut(usize, ValueAndSlopes)) {
        let (form, rank, weight) = (block.form, block.rank as usize, (weight, DVec3::ZERO));
        let first = tensor * form.rows(self.resolution);
        let factors = form.factors(self.resolution);
        for r in 0..rank {
            let value =
                |factor: usize, row: usize| f64::from(block.values[(first + factors[factor].start + row) * rank + r]);
            take(
                r,
                match form {
                    Form::Cp => {
                        let [x, y, z] = [0, 1, 2].map(|a| self.vector(a, |vertex| value(a, vertex)));
                        product(product(product(weight, x), y), z)
                    }
                    Form::Vm(axis) => {
                        let vector = self.vector(axis, |vertex| value(0, vertex));
                        product(product(weight, vector), self.matrix(axis, |row| value(1, row)))
                    }
                },
            );
        }
    }

    /// The interpolation between the vertices of a vector along `axis`.
    fn vector(&self, axis: usize, vertex: impl Fn(usize) -> f64) -> ValueAndSlopes {
        let [lower, upper] = [vertex(self.lower[axis]), vertex(self.lower[axis] + 1)];
        let mut slopes = DVec3::ZERO;
        slopes[axis] = (upper - lower) * self.cells_per_unit[axis];
        ((1.0 - self.fractions[axis]) * lower + self.fractions[axis] * upper, slopes)
    }

    /// The interpolation between the vertices of a matrix over the other axes than `axis`.
    fn matrix(&self, axis: usize, vertex: impl Fn(usize) -> f64) -> ValueAndSlopes {
        let [first, second] = Form::matrix_axes(axis);
        let row_len = self.resolution[first] as usize + 1;
        let row = |n: usize| self.vector(first, |column| vertex(n * row_len + column));
        let (lower, upper) = (row(self.lower[second]), row(self.lower[second] + 1));
        let fraction = self.fractions[second];
        let mut slopes = (1.0 - fraction) * lower.1 + fraction * upper.1;
        slopes[second] = (upper.0 - lower.0) * self.cells_per_unit[second];
        ((1.0 - fraction) * lower.0 + fraction * upper.0, slopes)
    }
}

fn product(a: ValueAndSlopes, b: ValueAndSlopes) -> ValueAndSlopes {
    (a.0 * b.0, a.1 * b.0 + a.0 * b.1)
}

/// A tensor's density feature at `offset` from its center, its gradient, and the sum of the absolute products.
fn density_of(scale: &Scale, tensor: usize, offset: DVec3) -> (f64, DVec3, f64) {
    let interpolation = AxisInterpolation::at(scale, offset);
    let mut sum = (0.0, DVec3::ZERO, 0.0);
    for block in &scale.factors.density {
        interpolation.for_each(block, tensor, 1.0, |_, (value, slopes)| {
            sum = (sum.0 + value, sum.1 + slopes, sum.2 + value.abs());
        });
    }
    sum
}

/// [features, direction, PE(features), PE(direction)].
fn decoder_input(decoder: &Decoder, features: &[f64], direction: DVec3) -> Vec<f64> {
    let direction = direction.to_array();
    let mut input = [features, &direction].concat();
    for (values, frequencies) in [(features, decoder.feature_frequencies), (&direction, decoder.direction_frequencies)]
    {
        let angles = || values.iter().flat_map(move |v| (0..frequencies).map(move |k| v * f64::from(1u32 << k)));
        input.extend(angles().map(f64::sin));
        input.extend(angles().map(f64::cos));
    }
    input
}

/// The smallest displacement per axis that moves `position` into a cell of the opposite occupancy.
fn occupancy_margin(occupancy: &Occupancy, position: DVec3, horizon: f64) -> f64 {
    let at = occupancy.cell_coordinates(position);
    let cell = at.floor().as_ivec3();
    let here = occupancy.cell_is_occupied(cell);
    let size = occupancy.cell_size();
    let mut margin = horizon;
    for code in 0..27 {
        let step = IVec3::new(code % 3 - 1, code / 3 % 3 - 1, code / 9 - 1);
        if occupancy.cell_is_occupied(cell.saturating_add(step)) != here {
            let displacement = (0..3).map(|a| match step[a] {
                -1 => (at[a] - f64::from(cell[a])) * size[a],
                1 => (f64::from(cell[a]) + 1.0 - at[a]) * size[a],
                _ => 0.0,
            });
            margin = margin.min(displacement.fold(0.0, f64::max));
        }
    }
    margin
}
