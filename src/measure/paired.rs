//! Differences of two scenes over the same views.

use serde::Serialize;

/// The mean of per-view differences and how certain it is. Views are hard or easy for both scenes alike, so that this is much
/// more certain than the difference of two independent means.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct PairedDifference {
    /// The mean over the views.
    pub mean: f64,
    /// The standard error of the mean: the standard deviation of the differences (n − 1) over √n; `None` for one view.
    pub standard_error: Option<f64>,
}

impl PairedDifference {
    /// The mean of `differences`, one for each view; `None` for none.
    ///
    /// ```
    /// use strivec_measure::PairedDifference;
    ///
    /// let found = PairedDifference::new(&[1.0, 2.0, 3.0, 6.0]).unwrap();
    /// assert_eq!(found.mean, 3.0);
    /// assert!((found.standard_error.unwrap() - (14.0_f64 / 3.0 / 4.0).sqrt()).abs() < 1e-12);
    /// ```
    pub fn new(differences: &[f64]) -> Option<Self> {
        if differences.is_empty() {
            return None;
        }
        let count = differences.len() as f64;
        let mean = differences.iter().sum::<f64>() / count;
        let squares: f64 = differences.iter().map(|d| (d - mean).powi(2)).sum();
        let standard_error = (differences.len() > 1).then(|| (squares / (count - 1.0) / count).sqrt());
        Some(Self { mean, standard_error })
    }
}
