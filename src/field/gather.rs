//! Interpolation of factors (spec 4.3): sums over neighbors of weight·x·y·z, a register of components at a time.
//! Twin: `shaders/gather.wgsl`.

use pulp::Simd;

use super::{Contribution, FieldScale, Real};

impl<T: Real> FieldScale<T> {
    /// The contribution of `tensor`, of this scale, with `weight` to `position`, which is relative to the field's origin.
    pub(super) fn contribution(&self, tensor: u32, weight: T, position: [T; 3]) -> Contribution<T> {
        let mut contribution = Contribution { tensor: self.first_tensor + tensor, weight, ..Contribution::default() };
        for a in 0..3 {
            let (row, fraction) = self.rows().on_axis(a, position[a] - self.centers[tensor as usize][a]);
            contribution.rows[a] = row;
            contribution.fractions[a] = fraction;
        }
        contribution
    }

    /// `sums` plus a register of sums over density components and `contributions` of weight·x·y·z. Adds the number of
    /// components to `count`.
    #[inline(always)]
    pub(super) fn add_density<S: Simd>(
        &self,
        simd: S,
        contributions: &[Contribution<T>],
        sums: T::Register<S>,
        count: &mut usize,
    ) -> T::Register<S> {
        let mut of_scale = T::splat(simd, T::zero());
        for contribution in contributions {
            let rows = self.density.rows_of(simd, (contribution.tensor - self.first_tensor) as usize, contribution);
            of_scale = rows.add_all(simd, of_scale);
            *count += rows.rank();
        }
        T::plus(simd, sums, of_scale)
    }

    /// components\[r\] = Σ over `contributions` of weight·x·y·z of appearance component r. Adds the number of components
    /// of all to `count`. `components` must be three registers longer than the scale's components; what is behind them is
    /// overwritten.
    #[inline(always)]
    pub(super) fn appearance_of<S: Simd>(
        &self,
        simd: S,
        contributions: &[Contribution<T>],
        components: &mut [T],
        count: &mut usize,
    ) {
        let (lanes, zero) = (T::lanes::<S>(), T::splat(simd, T::zero()));
        for begin in (0..self.appearance.held().rank()).step_by(3 * lanes) {
            let (mut a, mut b, mut c) = (zero, zero, zero);
            for contribution in contributions {
                let tensor = (contribution.tensor - self.first_tensor) as usize;
                let rows = self.appearance.rows_of(simd, tensor, contribution);
                a = rows.add(simd, begin, a);
                b = rows.add(simd, begin + lanes, b);
                c = rows.add(simd, begin + 2 * lanes, c);
                *count += if begin == 0 { rows.rank() } else { 0 };
            }
            T::store(simd, &mut components[begin..], a);
            T::store(simd, &mut components[begin + lanes..], b);
            T::store(simd, &mut components[begin + 2 * lanes..], c);
        }
    }
}
