//! One scale of a scene.

use super::{AppearanceMatrix, BrokenInvariant, Factors, TensorCloud};

/// The largest [`Scale::top_k`].
pub const MAX_TOP_K: u32 = 16;

/// A cloud of tensors of one size, their factors, and the appearance matrix they share.
#[derive(Clone, Debug, PartialEq)]
pub struct Scale {
    /// Where the tensors are and what they cover.
    pub cloud: TensorCloud,
    /// M: how many of the covering tensors a point aggregates.
    pub top_k: u32,
    /// The tensors' vectors.
    pub factors: Factors,
    /// Shared by all tensors of the scale.
    pub appearance_matrix: AppearanceMatrix,
}

impl Scale {
    /// Number of factor entries and appearance weights.
    pub fn parameter_count(&self) -> u64 {
        self.factors.parameter_count() + self.appearance_matrix.weights.len() as u64
    }

    /// The same without components of tensors that are zeros, which files leave out.
    pub fn held_parameter_count(&self) -> u64 {
        let rows = Factors::rows(self.cloud.resolution);
        self.factors.held_parameter_count(rows) + self.appearance_matrix.weights.len() as u64
    }

    /// Keeps the tensors of the numbers `kept`, which ascend, and removes the others.
    pub fn keep_tensors(&mut self, kept: &[usize]) {
        self.factors.keep_tensors(kept, self.cloud.len());
        self.cloud.keep_tensors(kept);
    }

    pub(super) fn check(&self, place: &str, features: u32) -> Result<(), BrokenInvariant> {
        self.cloud.check(place)?;
        if !(1..=MAX_TOP_K).contains(&self.top_k) {
            let expected = format!("1 to {MAX_TOP_K}");
            return Err(BrokenInvariant::new(format!("{place} top_k"), expected, self.top_k));
        }
        self.factors.check(place, self.cloud.len(), self.cloud.resolution)?;
        let matrix = &self.appearance_matrix;
        let name = || format!("{place} appearance matrix");
        BrokenInvariant::unless_equal(|| name() + " features", features, matrix.features)?;
        BrokenInvariant::unless_equal(|| name() + " rank", self.factors.appearance_rank, matrix.rank)?;
        let weights = u64::from(matrix.features) * u64::from(matrix.rank);
        BrokenInvariant::unless_equal(|| name() + " weights", weights, matrix.weights.len() as u64)?;
        BrokenInvariant::unless_finite(name, &matrix.weights)
    }
}
