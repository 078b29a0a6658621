//! Scales of a scene (spec 3.7).

use super::factors::Factors;
use super::matrix::AppearanceMatrix;
use super::tensor_cloud::TensorCloud;
use crate::Invalid;

/// The largest [`Scale::top_k`].
pub const MAX_TOP_K: u32 = 16;

/// A cloud of tensors of one size, their factors, and the appearance matrix they share.
#[derive(Clone, Debug, PartialEq)]
pub struct Scale {
    /// The centers of the tensors and the boxes that they cover.
    pub cloud: TensorCloud,
    /// The largest number of neighbors of a point (spec 4.2).
    pub top_k: u32,
    /// The factors of the tensors.
    pub factors: Factors,
    /// Shared by all tensors of the scale.
    pub appearance_matrix: AppearanceMatrix,
}

impl Scale {
    /// Number of factor entries and appearance weights.
    pub fn parameter_count(&self) -> u64 {
        self.factors.parameter_count() + self.appearance_matrix.weights.len() as u64
    }

    /// Number of factor entries and appearance weights without components that are zero, which files leave out.
    pub fn nonzero_parameter_count(&self) -> u64 {
        self.factors.nonzero_parameter_count(self.cloud.resolution) + self.appearance_matrix.weights.len() as u64
    }

    /// Keeps the tensors of the numbers `kept`, which ascend, and removes the others.
    pub fn keep_tensors(&mut self, kept: &[usize]) {
        self.factors.keep_tensors(kept, self.cloud.len());
        self.cloud.keep_tensors(kept);
    }

    pub(super) fn check(&self, place: &str, features: u32, has_finite_factors: bool) -> Result<(), Invalid> {
        self.cloud.check(place)?;
        if !(1..=MAX_TOP_K).contains(&self.top_k) {
            let expected = format!("1 to {MAX_TOP_K}");
            return Err(Invalid::new(format!("{place} top_k"), expected, self.top_k));
        }
        self.factors.check(place, self.cloud.len(), self.cloud.resolution)?;
        if !has_finite_factors {
            self.factors.check_numbers(place)?;
        }
        self.appearance_matrix.check(place, features, self.factors.appearance_rank())
    }
}
