//! Growth of a cost with a parameter: cost ∝ parameter^exponent, fitted on logarithmic axes.

use serde::Serialize;

/// A fitted power law.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Growth {
    /// The exponent; 1 if twice the parameter costs twice as much.
    pub exponent: f64,
    /// Standard error of the exponent; `None` for two points.
    pub standard_error: Option<f64>,
}

impl Growth {
    /// Least squares through the logarithms of `points`: (parameter, cost). `None` if there are fewer than two
    /// different parameters, or a value is not positive.
    pub fn fit(points: &[(f64, f64)]) -> Option<Self> {
        let positive = |v: f64| v > 0.0 && v.is_finite();
        if !points.iter().all(|&(x, y)| positive(x) && positive(y)) {
            return None;
        }
        let logs: Vec<(f64, f64)> = points.iter().map(|&(x, y)| (x.ln(), y.ln())).collect();
        let n = logs.len() as f64;
        let mean = |of: fn(&(f64, f64)) -> f64| logs.iter().map(of).sum::<f64>() / n;
        let (mean_x, mean_y) = (mean(|p| p.0), mean(|p| p.1));
        let square = logs.iter().map(|(x, _)| (x - mean_x).powi(2)).sum::<f64>();
        // Equal parameters leave a rounding error here, not always 0.
        if logs.is_empty() || square < 1e-12 {
            return None;
        }
        let exponent = logs.iter().map(|(x, y)| (x - mean_x) * (y - mean_y)).sum::<f64>() / square;
        let residual = logs.iter().map(|(x, y)| (y - mean_y - exponent * (x - mean_x)).powi(2)).sum::<f64>();
        let standard_error = (logs.len() > 2).then(|| (residual / (n - 2.0) / square).sqrt());
        Some(Self { exponent, standard_error })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn planted_exponents_are_found() {
        for exponent in [-1.0, 0.0, 0.5, 1.0, 2.0] {
            let points: Vec<_> = [1.0, 2.0, 5.0, 8.0].map(|x: f64| (x, 3.0 * x.powf(exponent))).into();
            let growth = Growth::fit(&points).unwrap();
            assert!((growth.exponent - exponent).abs() < 1e-12, "{growth:?}");
            assert!(growth.standard_error.unwrap() < 1e-12, "{growth:?}");
        }
    }

    #[test]
    fn the_standard_error_is_that_of_the_planted_noise() {
        // ln x = 0, 1, 2, 3. By hand: Σ(x − x̄)² = 5, Σ(x − x̄)·noise = −0.2, residual 0.04 − 0.2²/5 = 0.032.
        let noise = [0.1, -0.1, 0.1, -0.1];
        let points: Vec<_> = (0..4).map(|i| (f64::from(i).exp(), (f64::from(i) + noise[i as usize]).exp())).collect();
        let growth = Growth::fit(&points).unwrap();
        assert!((growth.exponent - (1.0 - 0.2 / 5.0)).abs() < 1e-12, "{growth:?}");
        assert!((growth.standard_error.unwrap() - (0.032f64 / 2.0 / 5.0).sqrt()).abs() < 1e-12, "{growth:?}");
    }

    #[test]
    fn what_has_no_exponent_is_refused() {
        for points in [&[][..], &[(1.0, 1.0)], &[(2.0, 1.0), (2.0, 3.0)], &[(1.0, 0.0), (2.0, 1.0)], &[(-1.0, 1.0)]] {
            assert_eq!(Growth::fit(points), None, "{points:?}");
        }
        assert_eq!(Growth::fit(&[(1.0, 1.0), (2.0, 4.0)]).unwrap().standard_error, None);
    }
}
