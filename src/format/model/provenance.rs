//! The origin of a scene (spec 3.4).

/// The origin of the scene, as information only: nothing is computed from it.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct Provenance {
    /// The dataset's name.
    pub dataset: String,
    /// The preset's name.
    pub preset: String,
    /// Training steps.
    pub steps: u64,
    /// The random generator's seed.
    pub seed: u64,
    /// The tool and its version.
    pub tool: String,
}
