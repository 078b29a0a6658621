//! The orthonormal cosine transform (DCT-II and its inverse) of short vectors.

use std::f64::consts::PI;

/// The transform of vectors of one length.
pub(super) struct CosineTransform {
    length: usize,
    /// \[k\]\[i\] a_k·cos(π·(i + ½)·k/length).
    basis: Vec<f32>,
}

impl CosineTransform {
    pub(super) fn new(length: usize) -> Self {
        let entry = |k: usize, i: usize| {
            let norm = if k == 0 { 1.0 } else { 2.0 } / length as f64;
            norm.sqrt() * (PI * (i as f64 + 0.5) * k as f64 / length as f64).cos()
        };
        let basis = (0..length).flat_map(|k| (0..length).map(move |i| entry(k, i) as f32)).collect();
        Self { length, basis }
    }

    fn row(&self, k: usize) -> &[f32] {
        &self.basis[k * self.length..][..self.length]
    }

    /// The coefficients of `values`.
    pub(super) fn forward(&self, values: &[f32], coefficients: &mut Vec<f32>) {
        coefficients.clear();
        coefficients.extend((0..self.length).map(|k| self.row(k).iter().zip(values).map(|(b, v)| b * v).sum::<f32>()));
    }

    /// The values of `coefficients`.
    pub(super) fn inverse(&self, coefficients: &[f32], values: &mut Vec<f32>) {
        values.clear();
        values.resize(self.length, 0.0);
        // Most coefficients are 0.
        for (k, &c) in coefficients.iter().enumerate().filter(|c| *c.1 != 0.0) {
            values.iter_mut().zip(self.row(k)).for_each(|(v, b)| *v += c * b);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_come_back_and_keep_their_length() {
        for length in [1, 2, 3, 8, 32, 122] {
            let transform = CosineTransform::new(length);
            let values: Vec<f32> = (0..length).map(|i| ((i * 37 + 5) % 23) as f32 - 11.0).collect();
            let (mut coefficients, mut back) = (Vec::new(), Vec::new());
            transform.forward(&values, &mut coefficients);
            transform.inverse(&coefficients, &mut back);
            let squares = |v: &[f32]| v.iter().map(|v| f64::from(v * v)).sum::<f64>();
            assert!((squares(&coefficients) / squares(&values) - 1.0).abs() < 1e-5, "{length}");
            assert!(back.iter().zip(&values).all(|(b, v)| (b - v).abs() < 1e-4), "{length}");
        }
    }

    #[test]
    fn a_constant_is_one_coefficient() {
        let mut coefficients = Vec::new();
        CosineTransform::new(4).forward(&[3.0; 4], &mut coefficients);
        assert!((coefficients[0] - 6.0).abs() < 1e-6 && coefficients[1..].iter().all(|c| c.abs() < 1e-6));
    }
}
