//! Registers of numbers: what the kernels need of an instruction set, for either precision.
//!
//! Kernels are generic over [`pulp::Simd`] and are dispatched, a few hundred samples at a time, to the best instruction
//! set that the machine has. Loops of a few fixed lanes are written with these, because compilers leave them scalar.

use pulp::Simd;

use super::Real;

/// No register holds more numbers.
pub(super) const MAX_LANES: usize = 16;

/// A number that comes in registers.
pub trait Vector: Copy {
    /// As many numbers as a register of `S` holds.
    type Register<S: Simd>: Copy;
    /// A truth value a lane.
    type Mask<S: Simd>: Copy;

    /// Numbers in a register.
    fn lanes<S: Simd>() -> usize;
    /// `value` in every lane.
    fn splat<S: Simd>(simd: S, value: Self) -> Self::Register<S>;
    /// The first numbers of `values`; 0 in the lanes that it is too short for.
    fn load<S: Simd>(simd: S, values: &[Self]) -> Self::Register<S>;
    /// The first numbers of `values`, which must fill a register.
    fn load_full<S: Simd>(simd: S, values: &[Self]) -> Self::Register<S>;
    /// Writes as many lanes as fit `values`.
    fn store<S: Simd>(simd: S, values: &mut [Self], register: Self::Register<S>);
    /// Writes to the first of `values`, which must have room for a register.
    fn store_full<S: Simd>(simd: S, values: &mut [Self], register: Self::Register<S>);
    /// a + b.
    fn plus<S: Simd>(simd: S, a: Self::Register<S>, b: Self::Register<S>) -> Self::Register<S>;
    /// a − b.
    fn minus<S: Simd>(simd: S, a: Self::Register<S>, b: Self::Register<S>) -> Self::Register<S>;
    /// a·b.
    fn times<S: Simd>(simd: S, a: Self::Register<S>, b: Self::Register<S>) -> Self::Register<S>;
    /// a/b.
    fn over<S: Simd>(simd: S, a: Self::Register<S>, b: Self::Register<S>) -> Self::Register<S>;
    /// a·b + c, rounded once where that is as fast.
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
    /// Both.
    fn both<S: Simd>(simd: S, a: Self::Mask<S>, b: Self::Mask<S>) -> Self::Mask<S>;
    /// a where `mask`, else b.
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
        fn load<S: Simd>(simd: S, values: &[Self]) -> Self::Register<S> {
            let lanes = Self::lanes::<S>();
            if values.len() >= lanes {
                return Self::load_full(simd, values);
            }
            let mut padded = [0.0; MAX_LANES];
            padded[..values.len()].copy_from_slice(values);
            bytemuck::pod_read_unaligned(bytemuck::cast_slice(&padded[..lanes]))
        }
        #[inline(always)]
        fn load_full<S: Simd>(_: S, values: &[Self]) -> Self::Register<S> {
            bytemuck::pod_read_unaligned(bytemuck::cast_slice(&values[..Self::lanes::<S>()]))
        }
        #[inline(always)]
        fn store<S: Simd>(simd: S, values: &mut [Self], register: Self::Register<S>) {
            if values.len() >= Self::lanes::<S>() {
                Self::store_full(simd, values, register);
            } else {
                let numbers: &[Self] = bytemuck::cast_slice(bytemuck::bytes_of(&register));
                values.copy_from_slice(&numbers[..values.len()]);
            }
        }
        #[inline(always)]
        fn store_full<S: Simd>(_: S, values: &mut [Self], register: Self::Register<S>) {
            let numbers: &[Self] = bytemuck::cast_slice(bytemuck::bytes_of(&register));
            // A length that the compiler knows becomes one store.
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

/// The largest whole numbers that are not above `values`, of less than 2²² in size.
#[inline(always)]
pub(super) fn floor<T: Real, S: Simd>(simd: S, values: T::Register<S>) -> T::Register<S> {
    let round = T::splat(simd, T::ROUND);
    let nearest = T::minus(simd, T::plus(simd, values, round), round);
    let below = T::minus(simd, nearest, T::splat(simd, T::one()));
    T::select(simd, T::less_or_equal(simd, nearest, values), nearest, below)
}
