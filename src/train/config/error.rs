//! Errors of a training run's settings.

use strivec_format::Invalid;

/// Settings that cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ConfigError {
    /// There is no preset of this name.
    #[error("`preset`: there is no preset {name:?}; choose one of {known}")]
    UnknownPreset {
        /// The name.
        name: String,
        /// All presets, as a list.
        known: String,
    },
    /// The text is not TOML, or has fields that settings do not have.
    #[error("{0}")]
    Toml(Box<toml::de::Error>),
    /// A value out of range.
    #[error(transparent)]
    Value(#[from] Invalid),
}
