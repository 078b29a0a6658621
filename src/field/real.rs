//! The two precisions of the field, f32 and f64, and the functions that its loops evaluate. Twin: `shaders/real.wgsl`.

use std::fmt::Debug;
use std::iter::Sum;

use pulp::Simd;

use super::matrix::ProductKernel;
use super::{Compiled, Vector};

/// f32 or f64.
pub trait Real:
    Compiled
    + Vector
    + num_traits::Float
    + num_traits::NumAssign
    + bytemuck::Pod
    + Debug
    + Default
    + Send
    + Sync
    + Sum
    + 'static
{
    /// `v`, rounded to the nearest.
    fn of(v: f64) -> Self;
    /// `v`, exactly.
    fn of_f32(v: f32) -> Self;
    /// The value in f64, exactly.
    fn f64(self) -> f64;
    /// The value rounded to f32.
    fn f32(self) -> f32;
    /// Rounded towards −∞, for values within ±2²²; unspecified for others.
    fn floor_i32(self) -> i32;
    /// `v`, rounded to the nearest.
    fn of_i32(v: i32) -> Self;
    /// A constant whose addition rounds a value to an integer, which the lowest bits of the sum then hold.
    const ROUND: Self;
    /// The value as an integer; it must be one in 0..2²².
    fn small_u32(self) -> u32;
    /// Sine and cosine, fast enough for every feature of every sample.
    fn sine_cosine(self) -> (Self, Self);
    /// e^x for x ≤ 0. Free of branches, like the two functions below, so that loops over it vectorize.
    fn exp_of_negative(self) -> Self;
    /// e^x − 1 for x ≤ 0.
    fn exp_m1_of_negative(self) -> Self;
    /// ln(1 + x) for x in [0, 1].
    fn ln_1p_of_unit(self) -> Self;
    /// The kernel of dense products on this processor.
    fn product_kernel() -> ProductKernel<Self>;
}

#[cfg(any(test, feature = "f64"))]
impl Real for f64 {
    #[inline(always)]
    fn of(v: f64) -> Self {
        v
    }
    #[inline(always)]
    fn of_f32(v: f32) -> Self {
        f64::from(v)
    }
    #[inline(always)]
    fn f64(self) -> f64 {
        self
    }
    #[inline(always)]
    fn f32(self) -> f32 {
        self as f32
    }
    #[inline(always)]
    fn floor_i32(self) -> i32 {
        self.floor() as i32
    }
    #[inline(always)]
    fn of_i32(v: i32) -> Self {
        f64::from(v)
    }
    const ROUND: Self = 6_755_399_441_055_744.0;
    #[inline(always)]
    fn small_u32(self) -> u32 {
        (self + Self::ROUND).to_bits() as u32
    }
    #[inline(always)]
    fn sine_cosine(self) -> (Self, Self) {
        self.sin_cos()
    }
    #[inline(always)]
    fn exp_of_negative(self) -> Self {
        self.exp()
    }
    #[inline(always)]
    fn exp_m1_of_negative(self) -> Self {
        self.exp_m1()
    }
    #[inline(always)]
    fn ln_1p_of_unit(self) -> Self {
        self.ln_1p()
    }
    fn product_kernel() -> ProductKernel<Self> {
        gemm_f64::gemm::f64::get_gemm_fn()
    }
}

impl Real for f32 {
    #[inline(always)]
    fn of(v: f64) -> Self {
        v as f32
    }
    #[inline(always)]
    fn of_f32(v: f32) -> Self {
        v
    }
    #[inline(always)]
    fn f64(self) -> f64 {
        f64::from(self)
    }
    #[inline(always)]
    fn f32(self) -> f32 {
        self
    }
    #[inline(always)]
    fn floor_i32(self) -> i32 {
        let shifted = self + Self::ROUND;
        let nearest = (shifted.to_bits() as i32).wrapping_sub(Self::ROUND.to_bits() as i32);
        nearest - i32::from(shifted - Self::ROUND > self)
    }
    #[inline(always)]
    fn of_i32(v: i32) -> Self {
        v as f32
    }
    const ROUND: Self = 12_582_912.0;
    #[inline(always)]
    fn small_u32(self) -> u32 {
        (self + Self::ROUND).to_bits() & 0x3f_ffff
    }

    /// Within 1.2e-7 for |x| < 1000 (tested): π/2 is subtracted in three parts, then Taylor polynomials on [−π/4, π/4].
    /// Free of branches, so that loops over it vectorize.
    #[inline(always)]
    fn sine_cosine(self) -> (Self, Self) {
        // The first parts have few bits, so that their products with small whole numbers are exact.
        const PARTS: [f32; 3] = [1.570_312_5, 4.837_513e-4, 7.549_79e-8];
        let shifted = self * std::f32::consts::FRAC_2_PI + Self::ROUND;
        let turns = shifted - Self::ROUND;
        let quadrant = shifted.to_bits();
        let r = ((self - turns * PARTS[0]) - turns * PARTS[1]) - turns * PARTS[2];
        // For |x| beyond about 2²² the remainder is meaningless; the clamp keeps the results finite.
        let r = r.clamp(-1.0, 1.0);
        let r2 = r * r;
        let sine = r + r * r2 * (-1.0 / 6.0 + r2 * (1.0 / 120.0 + r2 * (-1.0 / 5040.0 + r2 * (1.0 / 362_880.0))));
        let cosine = 1.0
            + r2 * (-0.5 + r2 * (1.0 / 24.0 + r2 * (-1.0 / 720.0 + r2 * (1.0 / 40320.0 - r2 * (1.0 / 3_628_800.0)))));
        let swap = quadrant & 1 != 0;
        let (s, c) = if swap { (cosine, sine) } else { (sine, cosine) };
        let sign_s = (quadrant & 2) << 30;
        let sign_c = (quadrant.wrapping_add(1) & 2) << 30;
        (f32::from_bits(s.to_bits() ^ sign_s), f32::from_bits(c.to_bits() ^ sign_c))
    }

    /// Within 2e-7 of the value; 0 below −87.
    #[inline(always)]
    fn exp_of_negative(self) -> Self {
        let (power, rest) = exponential_parts(self);
        power + power * rest
    }

    /// Within 3e-7 of the value.
    #[inline(always)]
    fn exp_m1_of_negative(self) -> Self {
        let (power, rest) = exponential_parts(self);
        (power - 1.0) + power * rest
    }

    /// Within 2e-7 of the value: 2·artanh(x/(2 + x)) as a series.
    #[inline(always)]
    fn ln_1p_of_unit(self) -> Self {
        let z = self / (2.0 + self);
        let z2 = z * z;
        let series = 1.0 / 7.0 + z2 * (1.0 / 9.0 + z2 * (1.0 / 11.0 + z2 * (1.0 / 13.0)));
        let series = z2 * (1.0 / 3.0 + z2 * (1.0 / 5.0 + z2 * series));
        (z + z) + (z + z) * series
    }
    fn product_kernel() -> ProductKernel<Self> {
        gemm_f32::gemm::f32::get_gemm_fn()
    }
}

/// 2ⁿ and e^r − 1 with `x` = n·ln 2 + r and |r| ≤ ln 2 / 2, for −88 < `x` ≤ 0. Smaller `x` count as −88.
#[inline(always)]
fn exponential_parts(x: f32) -> (f32, f32) {
    // The first part has few bits, so that n times it is exact.
    const LN_2_PARTS: [f32; 2] = [0.693_359_4, -2.121_944_4e-4];
    // Below, 2ⁿ is no normal number of f32.
    let x = if x > -88.0 { x } else { -88.0 };
    let shifted = x * std::f32::consts::LOG2_E + f32::ROUND;
    let n = shifted - f32::ROUND;
    let r = (x - n * LN_2_PARTS[0]) - n * LN_2_PARTS[1];
    let power = f32::from_bits((shifted.to_bits().wrapping_sub(f32::ROUND.to_bits()).wrapping_add(127)) << 23);
    let high = 1.0 / 24.0 + r * (1.0 / 120.0 + r * (1.0 / 720.0 + r * (1.0 / 5040.0)));
    (power, r + r * r * (0.5 + r * (1.0 / 6.0 + r * high)))
}

/// Adds `term` to `sum` with Kahan's compensation: `lost` is the accumulated rounding error of `sum`.
#[inline(always)]
pub fn add_compensated<T: Real>(sum: &mut T, lost: &mut T, term: T) {
    // Rust does not reorder sums of floating-point numbers; WGSL does, so the shader hides the sum
    // (docs/numerics.md).
    let change = term - *lost;
    let after = *sum + change;
    *lost = (after - *sum) - change;
    *sum = after;
}

/// ⌊`values`⌋ per lane, for values within ±2²².
#[inline(always)]
pub(super) fn floor<T: Real, S: Simd>(simd: S, values: T::Register<S>) -> T::Register<S> {
    let round = T::splat(simd, T::ROUND);
    let nearest = T::minus(simd, T::plus(simd, values, round), round);
    let below = T::minus(simd, nearest, T::splat(simd, T::one()));
    T::select(simd, T::less_or_equal(simd, nearest, values), nearest, below)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn single_precision_sine_and_cosine_stay_within_their_bound() {
        let mut worst = 0.0f64;
        for i in -1_000_000..=1_000_000 {
            let x = i as f32 * 1e-3;
            let (s, c) = x.sine_cosine();
            let (es, ec) = f64::from(x).sin_cos();
            worst = worst.max((s.f64() - es).abs()).max((c.f64() - ec).abs());
        }
        assert!(worst < 1.2e-7, "{worst}");
    }

    /// The largest error of `fast` relative to `exact` over `arguments`.
    fn relative_error(arguments: impl Iterator<Item = f32>, fast: fn(f32) -> f32, exact: fn(f64) -> f64) -> f64 {
        let error = |x: f32| (fast(x).f64() / exact(x.f64()) - 1.0).abs();
        arguments.map(error).fold(0.0, f64::max)
    }

    #[test]
    fn exponentials_and_logarithm_stay_within_their_bounds() {
        let negative = || (0..870_000).map(|i| i as f32 * -1e-4).chain((1..30).map(|i| -(0.1f32.powi(i))));
        let unit = || (1..1_000_000).map(|i| i as f32 * 1e-6).chain((1..30).map(|i| 0.1f32.powi(i)));
        assert!(relative_error(negative(), Real::exp_of_negative, f64::exp) < 2e-7);
        assert!(relative_error(negative().filter(|x| *x != 0.0), Real::exp_m1_of_negative, f64::exp_m1) < 3e-7);
        assert!(relative_error(unit(), Real::ln_1p_of_unit, f64::ln_1p) < 2e-7);
        assert_eq!([0.0f32.exp_of_negative(), 0.0f32.exp_m1_of_negative(), 0.0f32.ln_1p_of_unit()], [1.0, 0.0, 0.0]);
        assert!((-1e30f32).exp_of_negative() < 1e-37 && (-1e30f32).exp_m1_of_negative() == -1.0);
    }

    #[test]
    fn sine_and_cosine_are_finite_for_any_finite_argument() {
        for x in [1e9f32, -1e30, f32::MAX, f32::MIN_POSITIVE] {
            let (s, c) = x.sine_cosine();
            assert!(s.abs() <= 1.001 && c.abs() <= 1.001, "{x}: {s} {c}");
        }
    }

    #[test]
    fn floor_rounds_down_on_both_sides_of_zero() {
        assert_eq!([-1.5f32, -1.0, -0.5, 0.0, 0.5, 1.0].map(Real::floor_i32), [-2, -1, -1, 0, 0, 1]);
    }
}
