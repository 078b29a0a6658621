//! Gradients of the tensors' factors. One task owns a tensor: it walks the tensor's pairs in the order of chunk and
//! sample, so its vectors and their gradient stay in cache and have one writer.

use super::chunk::{Chunk, NOT_COLORED};
use crate::field::{FieldScale, Interpolation, Real, RowPairs, offset};
use crate::model::Factors;

/// Where a scale's components lie in a coloured sample's row.
#[derive(Clone, Copy, Debug)]
pub(super) struct ComponentRange {
    /// The scale's first component.
    pub(super) first: usize,
    /// ΣR, the row's length.
    pub(super) width: usize,
}

/// A tensor's gradients, laid out as its factors. Reused.
#[derive(Debug, Default)]
pub(super) struct TensorGradient<T> {
    pub(super) density: Vec<T>,
    pub(super) appearance: Vec<T>,
    /// Whether `appearance` is anything but zero.
    pub(super) has_appearance: bool,
}

impl<T: Real> TensorGradient<T> {
    /// Computes the gradients of tensor `n` of `scale`, whose factors are `density` and `appearance`.
    #[inline(always)]
    pub(super) fn accumulate(
        &mut self,
        scale: ScaleGeometry<'_, T>,
        n: usize,
        [density, appearance]: [&[T]; 2],
        chunks: &[Chunk<T>],
    ) {
        for (gradient, factors) in [(&mut self.density, density), (&mut self.appearance, appearance)] {
            gradient.clear();
            gradient.resize(factors.len(), T::zero());
        }
        self.has_appearance = false;
        let center = scale.centers[n];
        for chunk in chunks {
            for pair in chunk.pairs_of(scale.first_tensor + n) {
                let sample = pair.sample as usize;
                let at = scale.rows.at(offset(chunk.samples.positions[sample], center));
                let feature_gradient = pair.weight * chunk.feature_gradients[sample];
                scale.add(density, &mut self.density, scale.ranks[0], &at, |_| feature_gradient);
                if pair.colored != NOT_COLORED {
                    self.has_appearance = true;
                    let first = pair.colored as usize * scale.components.width + scale.components.first;
                    let gradients = &chunk.component_gradients[first..][..scale.ranks[1]];
                    scale.add(appearance, &mut self.appearance, scale.ranks[1], &at, |r| pair.weight * gradients[r]);
                }
            }
        }
    }
}

/// What a scale's gradients need besides its factors, which the optimiser borrows meanwhile.
#[derive(Clone, Copy, Debug)]
pub(super) struct ScaleGeometry<'a, T> {
    pub(super) first_tensor: usize,
    pub(super) centers: &'a [[T; 3]],
    pub(super) rows: crate::field::TensorRows<T>,
    pub(super) resolution: [u32; 3],
    /// Density and appearance.
    pub(super) ranks: [usize; 2],
    pub(super) components: ComponentRange,
}

impl<'a, T: Real> ScaleGeometry<'a, T> {
    pub(super) fn new(scale: &FieldScale<T>, centers: &'a [[T; 3]], components: ComponentRange) -> Self {
        Self {
            first_tensor: scale.first_tensor as usize,
            centers,
            rows: *scale.rows(),
            resolution: scale.resolution,
            ranks: [scale.density_rank, scale.appearance_rank],
            components,
        }
    }

    /// Adds one pair's gradients: each of x·y·z by the product of the other two, shared between the two vertices.
    /// `component(r)` is ∂L/∂(component r).
    #[inline(always)]
    fn add(
        &self,
        factors: &[T],
        gradients: &mut [T],
        rank: usize,
        at: &Interpolation<T>,
        component: impl Fn(usize) -> T,
    ) {
        let rows = RowPairs::new(factors, rank, at);
        let [_, second, third] = Factors::axis_rows(self.resolution);
        let (x_rows, rest) = gradients.split_at_mut(second * rank);
        let (y_rows, z_rows) = rest.split_at_mut((third - second) * rank);
        let (gx0, gx1) = x_rows[at.rows[0] * rank..][..2 * rank].split_at_mut(rank);
        let (gy0, gy1) = y_rows[(at.rows[1] - second) * rank..][..2 * rank].split_at_mut(rank);
        let (gz0, gz1) = z_rows[(at.rows[2] - third) * rank..][..2 * rank].split_at_mut(rank);
        let [fx, fy, fz] = at.fractions;
        let mut r = 0;
        // Blocks of one vector register, values apart from sums: this form vectorises without checks for overlap.
        while r + LANES <= rank {
            let [x, y, z] = [0, 1, 2].map(|a| {
                let (lower, upper) = (lanes(&rows.lower[a][r..]), lanes(&rows.upper[a][r..]));
                std::array::from_fn::<T, LANES, _>(|l| lower[l] + at.fractions[a] * (upper[l] - lower[l]))
            });
            let g: [T; LANES] = std::array::from_fn(|l| component(r + l));
            add_lanes(&mut gx0[r..], &mut gx1[r..], fx, std::array::from_fn(|l| g[l] * y[l] * z[l]));
            add_lanes(&mut gy0[r..], &mut gy1[r..], fy, std::array::from_fn(|l| g[l] * x[l] * z[l]));
            add_lanes(&mut gz0[r..], &mut gz1[r..], fz, std::array::from_fn(|l| g[l] * x[l] * y[l]));
            r += LANES;
        }
        for r in r..rank {
            let [x, y, z] =
                [0, 1, 2].map(|a| rows.lower[a][r] + at.fractions[a] * (rows.upper[a][r] - rows.lower[a][r]));
            let g = component(r);
            for (lower, upper, fraction, product) in [
                (&mut gx0[r], &mut gx1[r], fx, g * y * z),
                (&mut gy0[r], &mut gy1[r], fy, g * x * z),
                (&mut gz0[r], &mut gz1[r], fz, g * x * y),
            ] {
                let to_upper = fraction * product;
                *upper += to_upper;
                *lower += product - to_upper;
            }
        }
    }
}

/// Components that the gradient's kernel handles at once.
const LANES: usize = 8;

#[inline(always)]
fn lanes<T>(values: &[T]) -> &[T; LANES] {
    values[..LANES].try_into().expect("LANES long")
}

/// Shares `product` between the lower and the upper vertex's gradients.
#[inline(always)]
fn add_lanes<T: Real>(lower: &mut [T], upper: &mut [T], fraction: T, product: [T; LANES]) {
    let lower: &mut [T; LANES] = (&mut lower[..LANES]).try_into().expect("LANES long");
    let upper: &mut [T; LANES] = (&mut upper[..LANES]).try_into().expect("LANES long");
    for l in 0..LANES {
        let to_upper = fraction * product[l];
        upper[l] += to_upper;
        lower[l] += product[l] - to_upper;
    }
}
