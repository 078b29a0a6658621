//! Upsampling of factors to a finer resolution.

use crate::model::Factors;

/// Resamples every tensor's vectors of `rank` components from resolution `from` to `to`, linearly, the ends aligned
/// (paper, Implementation).
pub fn upsample(factors: &[f32], rank: usize, from: [u32; 3], to: [u32; 3]) -> Vec<f32> {
    let from_len = Factors::rows(from) * rank;
    if from_len == 0 {
        return Vec::new();
    }
    let mut resampled = Vec::with_capacity(factors.len() / from_len * Factors::rows(to) * rank);
    for tensor in factors.chunks_exact(from_len) {
        for (axis, first_row) in Factors::axis_rows(from).into_iter().enumerate() {
            for vertex in 0..=to[axis] {
                let at = f64::from(vertex) * f64::from(from[axis]) / f64::from(to[axis]);
                let lower = (at.floor() as u32).min(from[axis] - 1);
                let fraction = (at - f64::from(lower)) as f32;
                let rows = &tensor[(first_row + lower as usize) * rank..][..2 * rank];
                let (below, above) = rows.split_at(rank);
                resampled.extend(below.iter().zip(above).map(|(&b, &a)| (1.0 - fraction) * b + fraction * a));
            }
        }
    }
    resampled
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ends_stay_and_the_middle_is_interpolated() {
        // Rank 1, axes of 2, 3 and 2 vertices.
        let factors = [0.0, 1.0, 5.0, 7.0, 5.0, 2.0, 2.0];
        let finer = upsample(&factors, 1, [1, 2, 1], [2, 4, 3]);
        let two: f32 = 2.0;
        assert_eq!(&finer[..8], &[0.0, 0.5, 1.0, 5.0, 6.0, 7.0, 6.0, 5.0]);
        assert!(finer[8..].iter().all(|v| (v - two).abs() < 1e-6));
        assert_eq!(finer.len(), 12);
    }
}
