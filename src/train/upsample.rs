//! Upsampling of factors to a finer resolution.

use strivec_format::model::Form;

/// Resamples every tensor's factors, of `rank` components of a `form`, from resolution `from` to `to`, linearly, the ends
/// aligned (paper, Implementation).
pub fn upsample(form: Form, factors: &[f32], rank: usize, from: [u32; 3], to: [u32; 3]) -> Vec<f32> {
    let from_len = form.rows(from) * rank;
    if from_len == 0 {
        return Vec::new();
    }
    let mut resampled = Vec::with_capacity(factors.len() / from_len * form.rows(to) * rank);
    let ranges = form.factors(from);
    for tensor in factors.chunks_exact(from_len) {
        let values = |n: usize| &tensor[ranges[n].start * rank..ranges[n].end * rank];
        match form {
            Form::Cp => (0..3).for_each(|a| along(values(a), rank, from[a], to[a], &mut resampled)),
            Form::Vm(axis) => {
                along(values(0), rank, from[axis], to[axis], &mut resampled);
                let [first, second] = Form::matrix_axes(axis);
                let mut rows = Vec::new();
                for row in values(1).chunks_exact((from[first] as usize + 1) * rank) {
                    along(row, rank, from[first], to[first], &mut rows);
                }
                // Bilinear, an axis after the other: whole rows along the second.
                along(&rows, (to[first] as usize + 1) * rank, from[second], to[second], &mut resampled);
            }
        }
    }
    resampled
}

/// Appends `values` at `from` + 1 vertices of `width` numbers each, resampled at `to` + 1 vertices.
fn along(values: &[f32], width: usize, from: u32, to: u32, resampled: &mut Vec<f32>) {
    for vertex in 0..=to {
        let at = f64::from(vertex) * f64::from(from) / f64::from(to);
        // The last vertex is in the cell before it, with a fraction of 1.
        let lower = (at.floor() as u32).min(from - 1);
        let fraction = (at - f64::from(lower)) as f32;
        let (below, above) = values[lower as usize * width..][..2 * width].split_at(width);
        resampled.extend(below.iter().zip(above).map(|(&b, &a)| (1.0 - fraction) * b + fraction * a));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ends_stay_and_the_middle_is_interpolated() {
        // Rank 1, axes of 2, 3 and 2 vertices.
        let factors = [0.0, 1.0, 5.0, 7.0, 5.0, 2.0, 2.0];
        let finer = upsample(Form::Cp, &factors, 1, [1, 2, 1], [2, 4, 3]);
        let two: f32 = 2.0;
        assert_eq!(&finer[..8], &[0.0, 0.5, 1.0, 5.0, 6.0, 7.0, 6.0, 5.0]);
        assert!(finer[8..].iter().all(|v| (v - two).abs() < 1e-6));
        assert_eq!(finer.len(), 12);
    }

    #[test]
    fn a_bilinear_matrix_stays_what_it_is() {
        let at = |[x, y]: [f32; 2]| 1.0 + 2.0 * x - y + 3.0 * x * y;
        let matrix = |[x, y]: [u32; 2]| {
            let vertex = move |n: u32, of: u32| n as f32 / of as f32;
            (0..=y).flat_map(move |j| (0..=x).map(move |i| at([vertex(i, x), vertex(j, y)]))).collect::<Vec<f32>>()
        };
        // The vector lies along y, the matrix is over x and z.
        let factors = [vec![1.0, 3.0], matrix([3, 2])].concat();
        let finer = upsample(Form::Vm(1), &factors, 1, [3, 1, 2], [5, 2, 4]);
        let expected = [vec![1.0, 2.0, 3.0], matrix([5, 4])].concat();
        assert_eq!(finer.len(), expected.len());
        assert!(finer.iter().zip(&expected).all(|(a, b)| (a - b).abs() < 1e-5), "{finer:?}");
    }
}
