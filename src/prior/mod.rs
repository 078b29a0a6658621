//! Placeholder.
/// x
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct CoarseOptions { /// x
pub a: u32 }
