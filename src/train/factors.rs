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
        let [x0, y0, z0] = rows.lower.map(|row| &row[..rank]);
        let [x1, y1, z1] = rows.upper.map(|row| &row[..rank]);
        let [fx, fy, fz] = at.fractions;
        for r in 0..rank {
            let x = x0[r] + fx * (x1[r] - x0[r]);
            let y = y0[r] + fy * (y1[r] - y0[r]);
            let z = z0[r] + fz * (z1[r] - z0[r]);
            let g = component(r);
            let (of_x, of_y, of_z) = (g * y * z, g * x * z, g * x * y);
            let (upper_x, upper_y, upper_z) = (fx * of_x, fy * of_y, fz * of_z);
            gx1[r] += upper_x;
            gx0[r] += of_x - upper_x;
            gy1[r] += upper_y;
            gy0[r] += of_y - upper_y;
            gz1[r] += upper_z;
            gz0[r] += of_z - upper_z;
        }
    }
}
