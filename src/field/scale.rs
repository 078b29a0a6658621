//! One scale: finding a point's neighbours and interpolating their factors.

use glam::DVec3;

use super::{CellIndex, Real};
use crate::model::{Aggregation, Factors, MAX_TOP_K, Scale};

/// A scale's tensors.
#[derive(Clone, Debug)]
pub struct FieldScale<T> {
    /// The number of this scale's first tensor, counted over all scales.
    pub first_tensor: u32,
    /// \[tensor\] centres, relative to the field's origin.
    pub centers: Vec<[T; 3]>,
    /// Half edges.
    pub half: [T; 3],
    /// Cells along each axis.
    pub resolution: [u32; 3],
    /// Density components a tensor.
    pub density_rank: usize,
    /// Appearance components a tensor.
    pub appearance_rank: usize,
    /// Laid out as [`Factors`].
    pub density: Vec<T>,
    /// Laid out as [`Factors`].
    pub appearance: Vec<T>,
    top_k: usize,
    index: CellIndex<T>,
    rows: TensorRows<T>,
}

/// How a position within a tensor becomes rows of its factors.
#[derive(Clone, Copy, Debug)]
pub struct TensorRows<T> {
    half: [T; 3],
    cells_per_unit: [T; 3],
    last_cell: [i32; 3],
    first_row: [usize; 3],
    /// Rows of a tensor.
    pub count: usize,
}

/// Where a position falls: the lower of two rows and the fraction of the way to the next, per axis.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Interpolation<T> {
    pub(crate) rows: [usize; 3],
    pub(crate) fractions: [T; 3],
}

impl<T: Real> TensorRows<T> {
    fn new(half: DVec3, resolution: [u32; 3]) -> Self {
        Self {
            half: half.to_array().map(T::of),
            cells_per_unit: [0, 1, 2].map(|a| T::of(f64::from(resolution[a]) / (2.0 * half[a]))),
            last_cell: resolution.map(|d| d as i32 - 1),
            first_row: Factors::axis_rows(resolution),
            count: Factors::rows(resolution),
        }
    }

    /// Rows and fractions at `offset` from a tensor's centre.
    #[inline(always)]
    pub(crate) fn at(&self, offset: [T; 3]) -> Interpolation<T> {
        let mut rows = [0; 3];
        let mut fractions = [T::zero(); 3];
        for a in 0..3 {
            let u = (offset[a] + self.half[a]) * self.cells_per_unit[a];
            let lower = u.floor_i32().clamp(0, self.last_cell[a]);
            rows[a] = self.first_row[a] + lower as usize;
            fractions[a] = u - T::of(f64::from(lower));
        }
        Interpolation { rows, fractions }
    }
}

/// The nearest covering tensors of one scale, nearest first.
#[derive(Clone, Copy, Debug)]
pub struct Nearest<T> {
    /// How many.
    pub count: usize,
    /// Their numbers in the scale.
    pub tensors: [u32; MAX_TOP_K as usize],
    /// Their weights.
    pub weights: [T; MAX_TOP_K as usize],
}

impl<T: Real> Default for Nearest<T> {
    fn default() -> Self {
        Self { count: 0, tensors: [0; MAX_TOP_K as usize], weights: [T::zero(); MAX_TOP_K as usize] }
    }
}

#[inline(always)]
pub(crate) fn offset<T: Real>(position: [T; 3], center: [T; 3]) -> [T; 3] {
    [position[0] - center[0], position[1] - center[1], position[2] - center[2]]
}

impl<T: Real> FieldScale<T> {
    /// Prepares `scale` for positions relative to `origin`; `first_tensor` is the number of tensors before it.
    pub fn new(scale: &Scale, origin: DVec3, first_tensor: u32) -> Self {
        let convert = |values: &[f32]| values.iter().map(|&v| T::of_f32(v)).collect();
        Self {
            first_tensor,
            centers: scale.cloud.centers().map(|c| (c - origin).to_array().map(T::of)).collect(),
            half: scale.cloud.half.to_array().map(T::of),
            resolution: scale.cloud.resolution,
            density_rank: scale.factors.density_rank as usize,
            appearance_rank: scale.factors.appearance_rank as usize,
            density: convert(&scale.factors.density),
            appearance: convert(&scale.factors.appearance),
            top_k: scale.top_k as usize,
            index: CellIndex::new(&scale.cloud, origin),
            rows: TensorRows::new(scale.cloud.half, scale.cloud.resolution),
        }
    }

    /// Number of tensors.
    pub fn len(&self) -> usize {
        self.centers.len()
    }

    /// Whether there are no tensors.
    pub fn is_empty(&self) -> bool {
        self.centers.is_empty()
    }

    /// How positions become rows.
    pub fn rows(&self) -> &TensorRows<T> {
        &self.rows
    }

    /// Replaces the factors by those of another resolution (DESIGN, section 2: upsampling).
    pub fn set_resolution(&mut self, resolution: [u32; 3], density: Vec<T>, appearance: Vec<T>) {
        self.rows = TensorRows::new(DVec3::from_array(self.half.map(T::f64)), resolution);
        assert_eq!(density.len(), self.len() * self.rows.count * self.density_rank);
        assert_eq!(appearance.len(), self.len() * self.rows.count * self.appearance_rank);
        self.resolution = resolution;
        self.density = density;
        self.appearance = appearance;
    }

    #[inline(always)]
    fn covers(&self, offset: [T; 3]) -> bool {
        // Without short circuits: the three tests are one.
        (offset[0].abs() <= self.half[0]) & (offset[1].abs() <= self.half[1]) & (offset[2].abs() <= self.half[2])
    }

    /// Whether any tensor covers `position`.
    #[inline(always)]
    pub fn is_covered(&self, position: [T; 3]) -> bool {
        let candidates = self.index.candidates(position);
        candidates.iter().any(|&n| self.covers(offset(position, self.centers[n as usize])))
    }

    /// The `top_k` nearest covering tensors and their weights (DESIGN, sections 2.1, 2.2 and 2.4).
    #[inline(always)]
    pub fn find_nearest(&self, position: [T; 3], aggregation: Aggregation, nearest: &mut Nearest<T>) {
        let mut count = 0;
        // Squared distances, until they become weights.
        let squares = &mut nearest.weights;
        for &n in self.index.candidates(position) {
            let offset = offset(position, self.centers[n as usize]);
            if !self.covers(offset) {
                continue;
            }
            let square = offset[0] * offset[0] + offset[1] * offset[1] + offset[2] * offset[2];
            // Candidates come in ascending order, so a tie leaves the smaller centre in front.
            let mut at = count;
            while at > 0 && square < squares[at - 1] {
                at -= 1;
            }
            if at == self.top_k {
                continue;
            }
            count = (count + 1).min(self.top_k);
            for i in (at + 1..count).rev() {
                squares[i] = squares[i - 1];
                nearest.tensors[i] = nearest.tensors[i - 1];
            }
            squares[at] = square;
            nearest.tensors[at] = n;
        }
        nearest.count = count;
        weigh(aggregation, &mut nearest.weights[..count]);
    }

    /// Adds `weight` times a tensor's density components at `position` to `components`.
    #[inline(always)]
    pub fn add_density_of(&self, tensor: u32, position: [T; 3], weight: T, components: &mut [T]) {
        let at = self.rows.at(offset(position, self.centers[tensor as usize]));
        let factors = self.tensor_factors(&self.density, self.density_rank, tensor);
        add_products(&RowPairs::new(factors, self.density_rank, &at), at.fractions, weight, components);
    }

    /// Adds `weight` times a tensor's appearance components at `position` to `components`.
    #[inline(always)]
    pub fn add_appearance_of(&self, tensor: u32, position: [T; 3], weight: T, components: &mut [T]) {
        let at = self.rows.at(offset(position, self.centers[tensor as usize]));
        let factors = self.tensor_factors(&self.appearance, self.appearance_rank, tensor);
        add_products(&RowPairs::new(factors, self.appearance_rank, &at), at.fractions, weight, components);
    }

    #[inline(always)]
    fn tensor_factors<'a>(&self, factors: &'a [T], rank: usize, tensor: u32) -> &'a [T] {
        let len = self.rows.count * rank;
        &factors[tensor as usize * len..][..len]
    }
}

/// The lower and upper rows of a tensor on its three axes, a component a value.
pub(crate) struct RowPairs<'a, T> {
    pub(crate) lower: [&'a [T]; 3],
    pub(crate) upper: [&'a [T]; 3],
}

impl<'a, T: Real> RowPairs<'a, T> {
    #[inline(always)]
    pub(crate) fn new(factors: &'a [T], rank: usize, at: &Interpolation<T>) -> Self {
        let pair = |a: usize| factors[at.rows[a] * rank..][..2 * rank].split_at(rank);
        let (x, y, z) = (pair(0), pair(1), pair(2));
        Self { lower: [x.0, y.0, z.0], upper: [x.1, y.1, z.1] }
    }
}

/// components\[r\] += `weight`·x·y·z of the interpolated component r. A plain loop over slices of one length, which the
/// compiler turns into the widest vectors there are; arrays of a few lanes it does not.
#[inline(always)]
fn add_products<T: Real>(rows: &RowPairs<'_, T>, fractions: [T; 3], weight: T, components: &mut [T]) {
    let rank = components.len();
    let [x0, y0, z0] = rows.lower.map(|row| &row[..rank]);
    let [x1, y1, z1] = rows.upper.map(|row| &row[..rank]);
    for r in 0..rank {
        let x = x0[r] + fractions[0] * (x1[r] - x0[r]);
        let y = y0[r] + fractions[1] * (y1[r] - y0[r]);
        let z = z0[r] + fractions[2] * (z1[r] - z0[r]);
        components[r] += weight * x * y * z;
    }
}

/// Σ `values`, in four interleaved sums.
#[inline(always)]
pub(crate) fn sum<T: Real>(values: &[T]) -> T {
    let mut sums = [T::zero(); 4];
    let quads = values.chunks_exact(4);
    let rest = quads.remainder();
    for quad in quads {
        for (sum, &v) in sums.iter_mut().zip(quad) {
            *sum += v;
        }
    }
    rest.iter().fold((sums[0] + sums[1]) + (sums[2] + sums[3]), |sum, &v| sum + v)
}

/// Squared distances, nearest first, to weights (DESIGN, section 2.4).
#[inline(always)]
fn weigh<T: Real>(aggregation: Aggregation, values: &mut [T]) {
    let Some(&first) = values.first() else { return };
    match aggregation {
        // The limit at a centre: that tensor alone counts.
        Aggregation::Normalised if first == T::zero() => {
            values.fill(T::zero());
            values[0] = T::one();
        }
        Aggregation::Normalised => {
            let nearest = first.sqrt();
            let mut sum = T::zero();
            for v in values.iter_mut() {
                *v = nearest / v.sqrt();
                sum += *v;
            }
            let scale = T::one() / sum;
            values.iter_mut().for_each(|v| *v *= scale);
        }
        Aggregation::Clamped => {
            let mut sum = T::zero();
            for v in values.iter_mut() {
                *v = T::one() / (v.sqrt() + T::of(1e-6));
                sum += *v;
            }
            let scale = T::one() / sum.max(T::one());
            values.iter_mut().for_each(|v| *v *= scale);
        }
    }
}
