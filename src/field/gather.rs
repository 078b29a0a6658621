//! Interpolation of factors (spec 4.3): sums over neighbors of weight·x·y·z, a register of components at a time.
//! Twin: `shaders/gather.wgsl`.

use pulp::Simd;

use super::{Contribution, FieldScale, InterpolationSite, Real};

impl<T: Real> FieldScale<T> {
    /// The interpolation site of `contribution` at `position`, which is relative to the field's origin.
    #[inline(always)]
    pub fn locate(&self, contribution: Contribution<T>, position: [T; 3]) -> InterpolationSite<T> {
        let tensor = (contribution.tensor - self.first_tensor) as usize;
        let mut site = InterpolationSite {
            tensor: contribution.tensor,
            weight: contribution.weight,
            ..InterpolationSite::default()
        };
        for a in 0..3 {
            let (row, fraction) = self.rows().on_axis(a, position[a] - self.centers[tensor][a]);
            site.rows[a] = row;
            site.fractions[a] = fraction;
        }
        site
    }

    /// Σ over density components and `sites` of weight·x·y·z. Adds the number of components to `count`.
    #[inline(always)]
    pub(super) fn density_of<S: Simd>(&self, simd: S, sites: &[InterpolationSite<T>], count: &mut usize) -> T {
        let lanes = T::lanes::<S>();
        let mut total = T::splat(simd, T::zero());
        for site in sites {
            let rows = self.density.rows_at(simd, (site.tensor - self.first_tensor) as usize, site);
            for first in (0..rows.rank()).step_by(lanes) {
                total = T::plus(simd, total, rows.products(simd, first));
            }
            *count += rows.rank();
        }
        T::total(simd, total)
    }

    /// components\[r\] = Σ over `sites` of weight·x·y·z of appearance component r. Adds the number of components of all
    /// sites to `count`. `components` must be three registers longer than the scale's components; what is behind them is
    /// overwritten.
    #[inline(always)]
    pub(super) fn appearance_of<S: Simd>(
        &self,
        simd: S,
        sites: &[InterpolationSite<T>],
        components: &mut [T],
        count: &mut usize,
    ) {
        let (lanes, zero) = (T::lanes::<S>(), T::splat(simd, T::zero()));
        for begin in (0..self.appearance.held().rank()).step_by(3 * lanes) {
            let (mut a, mut b, mut c) = (zero, zero, zero);
            for site in sites {
                let rows = self.appearance.rows_at(simd, (site.tensor - self.first_tensor) as usize, site);
                if begin < rows.rank() {
                    a = T::plus(simd, a, rows.products(simd, begin));
                }
                if begin + lanes < rows.rank() {
                    b = T::plus(simd, b, rows.products(simd, begin + lanes));
                }
                if begin + 2 * lanes < rows.rank() {
                    c = T::plus(simd, c, rows.products(simd, begin + 2 * lanes));
                }
                *count += if begin == 0 { rows.rank() } else { 0 };
            }
            T::store(simd, &mut components[begin..], a);
            T::store(simd, &mut components[begin + lanes..], b);
            T::store(simd, &mut components[begin + 2 * lanes..], c);
        }
    }
}
