//! Appearance matrices.

use crate::Invalid;

/// The P×R matrix B that all tensors of a scale share (spec 3.8 and 4.6; paper 3.1). There is no bias.
#[derive(Clone, Debug, PartialEq)]
pub struct AppearanceMatrix {
    /// P, the length of the appearance feature vector.
    pub features: u32,
    /// R, the scale's appearance rank.
    pub rank: u32,
    /// \[P\]\[R\], row-major.
    pub weights: Vec<f32>,
}

impl AppearanceMatrix {
    pub(super) fn check(&self, place: &str, features: u32, rank: u32) -> Result<(), Invalid> {
        let name = || format!("{place} appearance matrix");
        Invalid::unless_equal(|| name() + " features", features, self.features)?;
        Invalid::unless_equal(|| name() + " rank", rank, self.rank)?;
        let weights = u64::from(self.features) * u64::from(self.rank);
        Invalid::unless_equal(|| name() + " weights", weights, self.weights.len() as u64)?;
        Invalid::unless_finite(name, &self.weights)
    }
}
