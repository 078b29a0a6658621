//! Interpolation of factors (spec 4.3): sums over neighbors of weight·component, a register of components at a time.
//! Twin: `shaders/gather.wgsl`.

use pulp::Simd;

use super::factors::{Factorized, Rows};
use super::{Contribution, FieldScale, Real};
use strivec_format::model::Form;

impl<T: Real> FieldScale<T> {
    /// The contribution of `tensor`, of this scale, with `weight` to `position`, which is relative to the field's origin.
    pub(super) fn contribution(&self, tensor: u32, weight: T, position: [T; 3]) -> Contribution<T> {
        let mut contribution = Contribution { tensor: self.first_tensor + tensor, weight, ..Contribution::default() };
        for a in 0..3 {
            let (lower, fraction) = self.vertices().on_axis(a, position[a] - self.centers[tensor as usize][a]);
            contribution.lower[a] = lower;
            contribution.fractions[a] = fraction;
        }
        contribution
    }

    /// `sums` plus a register of sums over density components and `contributions` of weight·component. Adds the number of
    /// components to `count`.
    #[inline(always)]
    pub(super) fn add_density<S: Simd>(
        &self,
        simd: S,
        contributions: &[Contribution<T>],
        sums: T::Register<S>,
        count: &mut usize,
    ) -> T::Register<S> {
        // A register of sums, which the caller adds up over all scales before the one sum over lanes: a sum over
        // lanes for each scale took 8 % of the stage (docs/experiments/2026-11-25-lean-training.md).
        let mut of_scale = T::splat(simd, T::zero());
        for block in &self.density {
            // The form is chosen outside of the loop over contributions, which then has no branch.
            match block.form() {
                Form::Cp => {
                    for contribution in contributions {
                        let rows = block.vectors_of(simd, self.tensor_of(contribution), contribution);
                        of_scale = rows.add_all(simd, of_scale);
                        *count += rows.rank();
                    }
                }
                Form::Vm(axis) => {
                    for contribution in contributions {
                        let tensor = self.tensor_of(contribution);
                        let rows = block.vector_and_matrix_of(simd, axis, tensor, contribution);
                        of_scale = rows.add_all(simd, of_scale);
                        *count += rows.rank();
                    }
                }
            }
        }
        T::plus(simd, sums, of_scale)
    }

    /// The number in this scale of the tensor of `contribution`.
    #[inline(always)]
    fn tensor_of(&self, contribution: &Contribution<T>) -> usize {
        (contribution.tensor - self.first_tensor) as usize
    }

    /// components\[r\] = Σ over `contributions` of weight times appearance component r. Adds the number of components
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
        let mut first = 0;
        for block in &self.appearance {
            let rank = block.held().rank();
            let components = &mut components[first..];
            first += rank;
            match block.form() {
                // Closures are inlined, as code outside of the dispatched function is compiled for the least
                // instruction set.
                Form::Cp => add_up(
                    simd,
                    rank,
                    contributions,
                    components,
                    count,
                    #[inline(always)]
                    |contribution| block.vectors_of(simd, self.tensor_of(contribution), contribution),
                ),
                Form::Vm(axis) => add_up(
                    simd,
                    rank,
                    contributions,
                    components,
                    count,
                    #[inline(always)]
                    |contribution| block.vector_and_matrix_of(simd, axis, self.tensor_of(contribution), contribution),
                ),
            }
        }
    }
}

/// [`FieldScale::appearance_of`] a block of `rank` components, whose rows at a contribution are `rows_of` it.
#[inline(always)]
fn add_up<'a, T: Real, S: Simd, F: Factorized<T, S>>(
    simd: S,
    rank: usize,
    contributions: &[Contribution<T>],
    components: &mut [T],
    count: &mut usize,
    rows_of: impl Fn(&Contribution<T>) -> Rows<'a, T, S, F>,
) {
    let (lanes, zero) = (T::lanes::<S>(), T::splat(simd, T::zero()));
    // Three registers are 48 components with AVX-512: the sums of a whole row stay in registers. Six gain 1 to 2 % of
    // a frame and were not kept (docs/experiments/2026-11-28-quarter.md).
    for begin in (0..rank).step_by(3 * lanes) {
        let (mut a, mut b, mut c) = (zero, zero, zero);
        for contribution in contributions {
            let rows = rows_of(contribution);
            a = rows.add(simd, begin, a);
            b = rows.add(simd, begin + lanes, b);
            c = rows.add(simd, begin + 2 * lanes, c);
            // Each contribution counts once, however many rounds its row takes.
            *count += if begin == 0 { rows.rank() } else { 0 };
        }
        // Whole registers: adding components one by one to their places takes half as long again
        // (docs/experiments/2026-11-25-held-components.md).
        T::store(simd, &mut components[begin..], a);
        T::store(simd, &mut components[begin + lanes..], b);
        T::store(simd, &mut components[begin + 2 * lanes..], c);
    }
}
