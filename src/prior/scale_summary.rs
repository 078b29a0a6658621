//! What a scale will cost.

use crate::model::{Factors, TensorCloud};

/// One row of the table that is shown before training.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ScaleSummary {
    /// Number of tensors.
    pub tensors: u64,
    /// Cells along each axis of a tensor.
    pub resolution: [u32; 3],
    /// Density components a tensor.
    pub density_rank: u32,
    /// Appearance components a tensor.
    pub appearance_rank: u32,
    /// Factor entries and appearance weights, saturating.
    pub parameters: u64,
    /// The parameters as f32, in memory.
    pub bytes: u64,
}

impl ScaleSummary {
    /// The numbers of a scale on `cloud` with these ranks, whose appearance matrix leads to `features` features.
    pub fn of(cloud: &TensorCloud, density_rank: u32, appearance_rank: u32, features: u32) -> Self {
        let rows = Factors::rows(cloud.resolution) as u64;
        let ranks = u64::from(density_rank) + u64::from(appearance_rank);
        let entries = (cloud.len() as u64).saturating_mul(rows).saturating_mul(ranks);
        let parameters = entries.saturating_add(u64::from(features) * u64::from(appearance_rank));
        Self {
            tensors: cloud.len() as u64,
            resolution: cloud.resolution,
            density_rank,
            appearance_rank,
            parameters,
            bytes: parameters.saturating_mul(size_of::<f32>() as u64),
        }
    }
}
