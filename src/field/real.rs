//! The two precisions.

use std::fmt::Debug;
use std::iter::Sum;

use super::Vector;

/// f32 or f64.
pub trait Real:
    Vector + num_traits::Float + num_traits::NumAssign + bytemuck::Pod + Debug + Default + Send + Sync + Sum + 'static
{
    /// The nearest value to `v`.
    fn of(v: f64) -> Self;
    /// `v`, exactly.
    fn of_f32(v: f32) -> Self;
    /// The value in f64, exactly.
    fn f64(self) -> f64;
    /// The value rounded to f32.
    fn f32(self) -> f32;
    /// Rounded towards −∞, for numbers within ±2²²; some number for others.
    fn floor_i32(self) -> i32;
    /// The nearest value to `v`.
    fn of_i32(v: i32) -> Self;
    /// What to add so that the sum is rounded to an integer, which its lowest bits tell.
    const ROUND: Self;
    /// The integer in 0..2²² that this is.
    fn small_u32(self) -> u32;
    /// Sine and cosine; cheap enough to be called for every feature of every sample.
    fn sine_cosine(self) -> (Self, Self);
}

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
    /// Free of branches, so that loops over it vectorise.
    #[inline(always)]
    fn sine_cosine(self) -> (Self, Self) {
        const PARTS: [f32; 3] = [1.570_312_5, 4.837_513e-4, 7.549_79e-8];
        let shifted = self * std::f32::consts::FRAC_2_PI + Self::ROUND;
        let turns = shifted - Self::ROUND;
        let quadrant = shifted.to_bits();
        let r = ((self - turns * PARTS[0]) - turns * PARTS[1]) - turns * PARTS[2];
        // Out of the rounding trick's range the remainder is meaningless; keep the results finite all the same.
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
