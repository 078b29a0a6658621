//! Colors as bytes.

/// `value` in \[0, 1\] as a byte, rounded to nearest, half up. Values outside are clamped; NaN is 0.
#[inline]
pub fn byte(value: f64) -> u8 {
    (value.clamp(0.0, 1.0) * 255.0).round() as u8
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_are_rounded_and_clamped() {
        assert_eq!([0.0, 1.0, 0.5, -0.1, 1.7, f64::NAN].map(byte), [0, 255, 128, 0, 255, 0]);
        assert_eq!(
            (0..=255u8).map(|n| byte(f64::from(f32::from(n) / 255.0))).collect::<Vec<_>>(),
            (0..=255).collect::<Vec<u8>>()
        );
    }
}
