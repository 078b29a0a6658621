//! Gradients of the tensors' factors. One task owns a tensor: it walks the tensor's pairs in the order of chunk and
//! sample, so its vectors and their gradient stay in cache and have one writer.

use super::chunk::{Chunk, NOT_COLORED};
use crate::field::{FieldScale, Interpolation, LANES, Real, RowPairs, offset};

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
                scale.add(density, &mut self.density, scale.ranks[0], &at, Uniform(feature_gradient));
                if pair.colored != NOT_COLORED {
                    self.has_appearance = true;
                    let first = pair.colored as usize * scale.components.width + scale.components.first;
                    let gradients = &chunk.component_gradients[first..][..scale.ranks[1]];
                    let weighted = Weighted { weight: pair.weight, gradients };
                    scale.add(appearance, &mut self.appearance, scale.ranks[1], &at, weighted);
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

/// ∂L/∂(component r of one pair).
trait ComponentGradient<T> {
    fn lanes(&self, r: usize) -> [T; LANES];
    fn one(&self, r: usize) -> T;
}

/// The same for every component: density.
struct Uniform<T>(T);

impl<T: Real> ComponentGradient<T> for Uniform<T> {
    #[inline(always)]
    fn lanes(&self, _: usize) -> [T; LANES] {
        [self.0; LANES]
    }
    #[inline(always)]
    fn one(&self, _: usize) -> T {
        self.0
    }
}

/// The sample's gradients times the pair's weight: appearance.
struct Weighted<'a, T> {
    weight: T,
    gradients: &'a [T],
}

impl<T: Real> ComponentGradient<T> for Weighted<'_, T> {
    #[inline(always)]
    fn lanes(&self, r: usize) -> [T; LANES] {
        let gradients: &[T; LANES] = self.gradients[r..r + LANES].try_into().expect("LANES long");
        gradients.map(|g| self.weight * g)
    }
    #[inline(always)]
    fn one(&self, r: usize) -> T {
        self.weight * self.gradients[r]
    }
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
    #[inline(always)]
    fn add(
        &self,
        factors: &[T],
        gradients: &mut [T],
        rank: usize,
        at: &Interpolation<T>,
        component: impl ComponentGradient<T>,
    ) {
        let rows = RowPairs::new(factors, rank, at);
        let [_, second, third] = crate::model::Factors::axis_rows(self.resolution);
        let (x_rows, rest) = gradients.split_at_mut(second * rank);
        let (y_rows, z_rows) = rest.split_at_mut((third - second) * rank);
        let x_rows = &mut x_rows[at.rows[0] * rank..][..2 * rank];
        let y_rows = &mut y_rows[(at.rows[1] - second) * rank..][..2 * rank];
        let z_rows = &mut z_rows[(at.rows[2] - third) * rank..][..2 * rank];
        let whole = rank / LANES * LANES;
        for r in (0..whole).step_by(LANES) {
            let block = rows.block(r);
            let g = component.lanes(r);
            let mut products = [[T::zero(); LANES]; 3];
            for l in 0..LANES {
                let [x, y, z] = block.component(l, at.fractions);
                products[0][l] = g[l] * y * z;
                products[1][l] = g[l] * x * z;
                products[2][l] = g[l] * x * y;
            }
            for (a, axis_rows) in [&mut *x_rows, &mut *y_rows, &mut *z_rows].into_iter().enumerate() {
                let (lower, upper) = axis_rows.split_at_mut(rank);
                let lower: &mut [T; LANES] = (&mut lower[r..r + LANES]).try_into().expect("LANES long");
                let upper: &mut [T; LANES] = (&mut upper[r..r + LANES]).try_into().expect("LANES long");
                for l in 0..LANES {
                    let to_upper = at.fractions[a] * products[a][l];
                    upper[l] += to_upper;
                    lower[l] += products[a][l] - to_upper;
                }
            }
        }
        for r in whole..rank {
            let [x, y, z] = rows.one(r, at.fractions);
            let g = component.one(r);
            for (a, (axis_rows, product)) in
                [(&mut *x_rows, g * y * z), (&mut *y_rows, g * x * z), (&mut *z_rows, g * x * y)].into_iter().enumerate()
            {
                let to_upper = at.fractions[a] * product;
                axis_rows[rank + r] += to_upper;
                axis_rows[r] += product - to_upper;
            }
        }
    }
}
