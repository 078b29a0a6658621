//! Errors of a training run's settings.

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
    #[error("`{place}` must be {expected}, not {found}")]
    Value {
        /// The path of the field.
        place: String,
        /// The range.
        expected: String,
        /// The value.
        found: String,
    },
}
