//! Interpolation of factors (spec 4.3): sums over neighbors of weight·x·y·z, a register of components at a time.
//! Twin: `shaders/gather.wgsl`.

use pulp::Simd;

use super::vector::MAX_LANES;
use super::{Contribution, FieldScale, Real};

/// A contribution, prepared for interpolation.
#[derive(Clone, Copy, Debug, Default)]
pub struct InterpolationSite<T> {
    /// The tensor's index over all scales.
    pub tensor: u32,
    /// The lower of the two rows on each axis, an index over the scale's rows.
    pub rows: [u32; 3],
    /// The fraction of the way to the next row, per axis, in [0, 1].
    pub fractions: [T; 3],
    /// The weight w of the tensor in its scale (spec 4.4).
    pub weight: T,
}

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
            site.rows[a] = (tensor * self.rows().count) as u32 + row;
            site.fractions[a] = fraction;
        }
        site
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

/// Splits `rank` components into registers. If they do not divide evenly, the last register overlaps the one before.
/// Returns the first component of register `index`, and the number of its components that the register before also has.
#[inline(always)]
pub(crate) fn register_at<T: Real, S: Simd>(rank: usize, index: usize) -> (usize, usize) {
    let first = index * T::lanes::<S>();
    let start = first.min(rank.saturating_sub(T::lanes::<S>()));
    (start, first - start)
}

/// A register of components. If `FULL`, `values` must fill it, which is faster.
#[inline(always)]
pub(crate) fn load<T: Real, S: Simd, const FULL: bool>(simd: S, values: &[T]) -> T::Register<S> {
    if FULL { T::load_full(simd, values) } else { T::load(simd, values) }
}

/// A scale's factors of density or appearance.
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
        // Up to three registers share the loads of rows and fractions.
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
        for site in sites {
            let xs = &self.values[site.rows[0] as usize * rank..][..2 * rank];
            let ys = &self.values[site.rows[1] as usize * rank..][..2 * rank];
            let zs = &self.values[site.rows[2] as usize * rank..][..2 * rank];
            let weight = T::splat(simd, site.weight);
            let fractions = [
                T::splat(simd, site.fractions[0]),
                T::splat(simd, site.fractions[1]),
                T::splat(simd, site.fractions[2]),
            ];
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
