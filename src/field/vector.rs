//! Vector registers of either precision: the operations that the kernels use.
//!
//! Kernels are generic over [`pulp::Simd`] and are dispatched, a few hundred samples at a time, to the machine's best
//! instruction set. Loops of a few fixed lanes use these operations because compilers do not vectorize them.

use pulp::Simd;

/// The most lanes of a register in any instruction set.
pub const MAX_LANES: usize = 16;

/// The numbers of the field, f32 and f64. `unsafe` code trusts their registers, lanes and kernels, so no other type may
/// implement [`Vector`] and [`Real`](super::Real).
mod sealed {
    #[expect(unnameable_types, reason = "the name would let other crates implement the trait")]
    pub trait Sealed {}
    impl Sealed for f32 {}
    impl Sealed for f64 {}
}

/// A number with vector registers. Only f32 and f64 are; other crates cannot implement it.
pub trait Vector: sealed::Sealed + Copy {
    /// A register of `S`.
    type Register<S: Simd>: Copy;
    /// One truth value per lane.
    type Mask<S: Simd>: Copy;

    /// 0, 1, 2 and so on: the index of each lane of a register.
    const LANES: [Self; MAX_LANES];

    /// Lanes of a register.
    fn lanes<S: Simd>() -> usize;
    /// `value` in every lane.
    fn splat<S: Simd>(simd: S, value: Self) -> Self::Register<S>;
    /// The first values of `values`, which must fill a register.
    fn load<S: Simd>(simd: S, values: &[Self]) -> Self::Register<S>;
    /// Writes all lanes to the first of `values`, which must hold a register.
    fn store<S: Simd>(simd: S, values: &mut [Self], register: Self::Register<S>);
    /// a + b.
    fn plus<S: Simd>(simd: S, a: Self::Register<S>, b: Self::Register<S>) -> Self::Register<S>;
    /// a − b.
    fn minus<S: Simd>(simd: S, a: Self::Register<S>, b: Self::Register<S>) -> Self::Register<S>;
    /// a·b.
    fn times<S: Simd>(simd: S, a: Self::Register<S>, b: Self::Register<S>) -> Self::Register<S>;
    /// a/b.
    fn over<S: Simd>(simd: S, a: Self::Register<S>, b: Self::Register<S>) -> Self::Register<S>;
    /// a·b + c, rounded once if the instruction set has a fused operation.
    fn times_plus<S: Simd>(
        simd: S,
        a: Self::Register<S>,
        b: Self::Register<S>,
        c: Self::Register<S>,
    ) -> Self::Register<S>;
    /// √a.
    fn root<S: Simd>(simd: S, a: Self::Register<S>) -> Self::Register<S>;
    /// |a|.
    fn magnitude<S: Simd>(simd: S, a: Self::Register<S>) -> Self::Register<S>;
    /// The smaller of a and b.
    fn smaller<S: Simd>(simd: S, a: Self::Register<S>, b: Self::Register<S>) -> Self::Register<S>;
    /// a ≤ b.
    fn less_or_equal<S: Simd>(simd: S, a: Self::Register<S>, b: Self::Register<S>) -> Self::Mask<S>;
    /// a and b.
    fn both<S: Simd>(simd: S, a: Self::Mask<S>, b: Self::Mask<S>) -> Self::Mask<S>;
    /// a in the lanes in which `mask` is set, b in the others.
    fn select<S: Simd>(simd: S, mask: Self::Mask<S>, a: Self::Register<S>, b: Self::Register<S>) -> Self::Register<S>;
    /// Σ over the lanes.
    fn total<S: Simd>(simd: S, a: Self::Register<S>) -> Self;
    /// The smallest lane.
    fn least<S: Simd>(simd: S, a: Self::Register<S>) -> Self;
}

macro_rules! vector {
    ($number:ty, $registers:ident, $masks:ident, $lanes:ident, $($of:ident $to:ident,)*) => {
        impl Vector for $number {
            type Register<S: Simd> = S::$registers;
            type Mask<S: Simd> = S::$masks;
            const LANES: [Self; MAX_LANES] = [0., 1., 2., 3., 4., 5., 6., 7., 8., 9., 10., 11., 12., 13., 14., 15.];
            #[inline(always)]
            fn lanes<S: Simd>() -> usize {
                S::$lanes
            }
            vector!(methods $($of $to,)*);
        }
    };
    (methods
        $splat:ident $add:ident, $sub:ident $mul:ident, $div:ident $mul_add:ident,
        $sqrt:ident $abs:ident, $min:ident $less:ident, $and:ident $select:ident, $sum:ident $least:ident,
    ) => {
        #[inline(always)]
        fn splat<S: Simd>(simd: S, value: Self) -> Self::Register<S> {
            simd.$splat(value)
        }
        #[inline(always)]
        fn load<S: Simd>(_: S, values: &[Self]) -> Self::Register<S> {
            // One check of the length, and a load without an `unsafe` block.
            bytemuck::pod_read_unaligned(bytemuck::cast_slice(&values[..Self::lanes::<S>()]))
        }
        #[inline(always)]
        fn store<S: Simd>(_: S, values: &mut [Self], register: Self::Register<S>) {
            let numbers: &[Self] = bytemuck::cast_slice(bytemuck::bytes_of(&register));
            // A length known at compile time compiles to one store.
            values[..Self::lanes::<S>()].copy_from_slice(&numbers[..Self::lanes::<S>()]);
        }
        #[inline(always)]
        fn plus<S: Simd>(simd: S, a: Self::Register<S>, b: Self::Register<S>) -> Self::Register<S> {
            simd.$add(a, b)
        }
        #[inline(always)]
        fn minus<S: Simd>(simd: S, a: Self::Register<S>, b: Self::Register<S>) -> Self::Register<S> {
            simd.$sub(a, b)
        }
        #[inline(always)]
        fn times<S: Simd>(simd: S, a: Self::Register<S>, b: Self::Register<S>) -> Self::Register<S> {
            simd.$mul(a, b)
        }
        #[inline(always)]
        fn over<S: Simd>(simd: S, a: Self::Register<S>, b: Self::Register<S>) -> Self::Register<S> {
            simd.$div(a, b)
        }
        #[inline(always)]
        fn times_plus<S: Simd>(
            simd: S,
            a: Self::Register<S>,
            b: Self::Register<S>,
            c: Self::Register<S>,
        ) -> Self::Register<S> {
            simd.$mul_add(a, b, c)
        }
        #[inline(always)]
        fn root<S: Simd>(simd: S, a: Self::Register<S>) -> Self::Register<S> {
            simd.$sqrt(a)
        }
        #[inline(always)]
        fn magnitude<S: Simd>(simd: S, a: Self::Register<S>) -> Self::Register<S> {
            simd.$abs(a)
        }
        #[inline(always)]
        fn smaller<S: Simd>(simd: S, a: Self::Register<S>, b: Self::Register<S>) -> Self::Register<S> {
            simd.$min(a, b)
        }
        #[inline(always)]
        fn less_or_equal<S: Simd>(simd: S, a: Self::Register<S>, b: Self::Register<S>) -> Self::Mask<S> {
            simd.$less(a, b)
        }
        #[inline(always)]
        fn both<S: Simd>(simd: S, a: Self::Mask<S>, b: Self::Mask<S>) -> Self::Mask<S> {
            simd.$and(a, b)
        }
        #[inline(always)]
        fn select<S: Simd>(
            simd: S,
            mask: Self::Mask<S>,
            a: Self::Register<S>,
            b: Self::Register<S>,
        ) -> Self::Register<S> {
            simd.$select(mask, a, b)
        }
        #[inline(always)]
        fn total<S: Simd>(simd: S, a: Self::Register<S>) -> Self {
            simd.$sum(a)
        }
        #[inline(always)]
        fn least<S: Simd>(simd: S, a: Self::Register<S>) -> Self {
            simd.$least(a)
        }
    };
}

vector!(
    f32, f32s, m32s, F32_LANES,
    splat_f32s add_f32s, sub_f32s mul_f32s, div_f32s mul_add_e_f32s,
    sqrt_f32s abs_f32s, min_f32s less_than_or_equal_f32s, and_m32s select_f32s, reduce_sum_f32s reduce_min_f32s,
);
vector!(
    f64, f64s, m64s, F64_LANES,
    splat_f64s add_f64s, sub_f64s mul_f64s, div_f64s mul_add_e_f64s,
    sqrt_f64s abs_f64s, min_f64s less_than_or_equal_f64s, and_m64s select_f64s, reduce_sum_f64s reduce_min_f64s,
);
