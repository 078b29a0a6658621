//! Error maps: the difference of two pictures as a picture.

use super::Error;

/// Black, violet, red, orange, light yellow: lightness grows along it, so that it also reads without color.
const RAMP: [[f32; 3]; 5] =
    [[0.0, 0.0, 0.0], [0.32, 0.07, 0.48], [0.79, 0.21, 0.30], [0.98, 0.62, 0.19], [1.0, 1.0, 0.8]];

/// The difference that reports show as the brightest color.
pub const ERROR_FULL: f32 = 0.2;

/// The absolute difference of `a` and `b` as colors from black (none) to light yellow (`full` and above): the largest
/// of each pixel's channels. `full` must be positive. NaN shows as the largest difference.
///
/// # Errors
///
/// [`Error::Size`] if the pictures differ in size.
pub fn error_map(a: &[[f32; 3]], b: &[[f32; 3]], full: f32) -> Result<Vec<[f32; 3]>, Error> {
    if a.len() != b.len() {
        return Err(Error::Size { expected: a.len(), found: b.len() });
    }
    let largest = |(p, q): (&[f32; 3], &[f32; 3])| {
        let differences = [0, 1, 2].map(|c| (p[c] - q[c]).abs());
        if differences.iter().any(|d| d.is_nan()) { full } else { differences.into_iter().fold(0.0, f32::max) }
    };
    Ok(a.iter().zip(b).map(|pair| ramp(largest(pair) / full)).collect())
}

/// From black at 0 and below to light yellow at 1 and above.
pub fn ramp(value: f32) -> [f32; 3] {
    let at = value.clamp(0.0, 1.0) * (RAMP.len() - 1) as f32;
    let below = (at as usize).min(RAMP.len() - 2);
    let part = at - below as f32;
    std::array::from_fn(|c| RAMP[below][c] * (1.0 - part) + RAMP[below + 1][c] * part)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_difference_is_black_and_a_full_one_the_ramps_end() {
        let gray = [0.5; 3];
        let map = error_map(&[gray; 4], &[gray, [0.5, 0.6, 0.5], [0.0; 3], [f32::NAN; 3]], 0.2).unwrap();
        assert_eq!(map[0], RAMP[0]);
        assert!((map[1][0] - RAMP[2][0]).abs() < 1e-6, "half of the range, in one channel");
        assert_eq!([map[2], map[3]], [RAMP[4]; 2]);
    }
}
