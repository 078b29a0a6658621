//! Interpolating factors: sums over neighbors of weight·x·y·z, a register of components at a time.

use pulp::Simd;

use super::vector::MAX_LANES;
use super::{Contribution, FieldScale, Real};

/// A contribution, ready for interpolation.
#[derive(Clone, Copy, Debug, Default)]
pub struct InterpolationSite<T> {
    /// The tensor's number, counted over all scales.
    pub tensor: u32,
    /// The lower of two rows on each axis, counted over the scale.
    pub rows: [u32; 3],
    /// The fraction of the way to the next row, per axis.
    pub fractions: [T; 3],
    /// The contribution's weight.
    pub weight: T,
}

impl<T: Real> FieldScale<T> {
    /// What interpolating `contribution` at `position` needs.
    #[inline(always)]
    pub fn locate(&self, contribution: Contribution<T>, position: [T; 3]) -> InterpolationSite<T> {
        let tensor = (contribution.tensor - self.first_tensor) as usize;
        let mut sites =
            InterpolationSite { tensor: contribution.tensor, weight: contribution.weight, ..InterpolationSite::default() };
        for a in 0..3 {
            let (row, fraction) = self.rows().on_axis(a, position[a] - self.centers[tensor][a]);
            sites.rows[a] = (tensor * self.rows().count) as u32 + row;
            sites.fractions[a] = fraction;
        }
        sites
    }

    /// Σ over density components and `sites` of weight·x·y·z.
    #[inline(always)]
    pub(super) fn density_of<S: Simd>(&self, simd: S, sites: &[InterpolationSite<T>]) -> T {
        let mut total = T::splat(simd, T::zero());
        let factors = Rows { values: &self.density, rank: self.density_rank };
        factors.each_register(
            simd,
            sites,
            #[inline(always)]
            |_, overlap, sums| {
                let sums = if overlap == 0 { sums } else { T::times(simd, sums, all_but::<T, S>(simd, overlap)) };
                total = T::plus(simd, total, sums);
            },
        );
        T::total(simd, total)
    }

    /// components\[r\] = Σ over `sites` of weight·x·y·z of appearance component r.
    #[inline(always)]
    pub(super) fn appearance_of<S: Simd>(&self, simd: S, sites: &[InterpolationSite<T>], components: &mut [T]) {
        let factors = Rows { values: &self.appearance, rank: self.appearance_rank };
        factors.each_register(
            simd,
            sites,
            #[inline(always)]
            |first, _, sums| T::store(simd, &mut components[first..], sums),
        );
    }
}

/// 0 in the first `count` lanes, 1 in the others.
#[inline(always)]
pub(crate) fn all_but<T: Real, S: Simd>(simd: S, count: usize) -> T::Register<S> {
    let mut lanes = [T::one(); MAX_LANES];
    lanes[..count].fill(T::zero());
    T::load(simd, &lanes)
}

/// Cuts `rank` components into registers, the last of which overlaps the one before where they do not divide: the first
/// component of register number `n`, and how many of its components the register before has too.
#[inline(always)]
pub(crate) fn register_at<T: Real, S: Simd>(rank: usize, n: usize) -> (usize, usize) {
    let first = n * T::lanes::<S>();
    let at = first.min(rank.saturating_sub(T::lanes::<S>()));
    (at, first - at)
}

/// A register of components, by the shorter way where it is known to be full.
#[inline(always)]
pub(crate) fn load<T: Real, S: Simd, const FULL: bool>(simd: S, values: &[T]) -> T::Register<S> {
    if FULL { T::load_full(simd, values) } else { T::load(simd, values) }
}

/// A scale's factors.
struct Rows<'a, T> {
    values: &'a [T],
    rank: usize,
}

impl<T: Real> Rows<'_, T> {
    /// Calls `take` with each register's first component, its overlap, and its sums over `sites` of weight·x·y·z.
    #[inline(always)]
    fn each_register<S: Simd>(
        &self,
        simd: S,
        sites: &[InterpolationSite<T>],
        mut take: impl FnMut(usize, usize, T::Register<S>),
    ) {
        let registers = self.rank.div_ceil(T::lanes::<S>());
        if self.rank < T::lanes::<S>() {
            let [a] = self.products::<S, 1, false>(simd, [0], sites);
            return take(0, 0, a);
        }
        let mut n = 0;
        // Several at a time share the work on rows and fractions.
        while n < registers {
            let (first, second, third) = (
                register_at::<T, S>(self.rank, n),
                register_at::<T, S>(self.rank, n + 1),
                register_at::<T, S>(self.rank, n + 2),
            );
            match registers - n {
                1 => {
                    let [a] = self.products::<S, 1, true>(simd, [first.0], sites);
                    take(first.0, first.1, a);
                }
                2 => {
                    let [a, b] = self.products::<S, 2, true>(simd, [first.0, second.0], sites);
                    take(first.0, first.1, a);
                    take(second.0, second.1, b);
                }
                _ => {
                    let [a, b, c] = self.products::<S, 3, true>(simd, [first.0, second.0, third.0], sites);
                    take(first.0, first.1, a);
                    take(second.0, second.1, b);
                    take(third.0, third.1, c);
                }
            }
            n += 3;
        }
    }

    /// Σ over `sites` of weight·x·y·z, for `N` registers of components.
    #[inline(always)]
    fn products<S: Simd, const N: usize, const FULL: bool>(
        &self,
        simd: S,
        firsts: [usize; N],
        sites: &[InterpolationSite<T>],
    ) -> [T::Register<S>; N] {
        let rank = self.rank;
        let mut sums = [T::splat(simd, T::zero()); N];
        for at in sites {
            let xs = &self.values[at.rows[0] as usize * rank..][..2 * rank];
            let ys = &self.values[at.rows[1] as usize * rank..][..2 * rank];
            let zs = &self.values[at.rows[2] as usize * rank..][..2 * rank];
            let weight = T::splat(simd, at.weight);
            let fractions =
                [T::splat(simd, at.fractions[0]), T::splat(simd, at.fractions[1]), T::splat(simd, at.fractions[2])];
            for n in 0..N {
                let mut product = weight;
                for (a, rows) in [xs, ys, zs].into_iter().enumerate() {
                    let lower = load::<T, S, FULL>(simd, &rows[firsts[n]..rank]);
                    let upper = load::<T, S, FULL>(simd, &rows[rank + firsts[n]..]);
                    let value = T::times_plus(simd, fractions[a], T::minus(simd, upper, lower), lower);
                    if a < 2 {
                        product = T::times(simd, product, value);
                    } else {
                        sums[n] = T::times_plus(simd, product, value, sums[n]);
                    }
                }
            }
        }
        sums
    }
}
