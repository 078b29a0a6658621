//! One scale of a plan.

use strivec_format::model::FactorKind;

/// One scale of a [`super::Plan`].
#[derive(Clone, Debug, PartialEq)]
pub struct ScalePlan {
    /// Number of tensors.
    pub tensors: u64,
    /// Edge of a tensor's box, per axis, in model units.
    pub edge: [f64; 3],
    /// Cells of a tensor after the last upsampling.
    pub resolution: [u32; 3],
    /// The factors of components.
    pub factors: FactorKind,
    /// Density components.
    pub density_rank: u32,
    /// Appearance components.
    pub appearance_rank: u32,
    /// The most neighbors that a point aggregates.
    pub top_k: u32,
    /// Parameters of the factors and the appearance matrix.
    pub parameters: u64,
}

impl ScalePlan {
    /// Bytes in memory, as 32-bit floating point.
    pub fn bytes(&self) -> u64 {
        4 * self.parameters
    }
}
