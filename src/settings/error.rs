//! Errors of a training run's settings.

use strivec_format::Invalid;

/// Settings that cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ConfigError {
    /// There is no preset of this name.
    #[error("`preset`: there is no preset {name:?}{near}; choose one of {known}")]
    UnknownPreset {
        /// The name.
        name: String,
        /// The advice to take the preset of the most similar name; empty if there is none.
        near: String,
        /// All presets, as a list.
        known: String,
    },
    /// There is no setting of this name.
    #[error("{place}there is no setting `{key}`{near}")]
    UnknownKey {
        /// The lines that show its place in the text, each with a line feed; empty if there is no text.
        place: String,
        /// The dotted key.
        key: String,
        /// The advice to set the settings of similar names; empty if there are none.
        near: String,
    },
    /// An assignment without a key or without a value.
    #[error("{0:?} is not a setting of the form KEY=VALUE, such as lean.max_loss=0.05")]
    Assignment(String),
    /// The text is not TOML, or has values of another type.
    #[error("{0}")]
    Toml(Box<toml::de::Error>),
    /// A value out of range.
    #[error(transparent)]
    Value(#[from] Invalid),
}
