//! The TOML form of settings.

use super::{ConfigError, TrainConfig};

impl TrainConfig {
    /// Reads settings. Fields that `text` leaves out are those of the preset that it names, or of
    /// [`TrainConfig::DEFAULT_PRESET`]. If `preset` is given, it replaces the preset, the scales and the decoder of
    /// `text`.
    ///
    /// # Errors
    ///
    /// If `text` is not TOML of settings, or a field is out of range; the error names the line or the field.
    pub fn from_toml(text: &str, preset: Option<&str>) -> Result<Self, ConfigError> {
        let toml_error = |e| ConfigError::Toml(Box::new(e));
        let mut given: toml::Table = toml::from_str(text).map_err(toml_error)?;
        // Errors have line numbers only if the text itself is deserialized.
        toml::from_str::<Self>(text).map_err(toml_error)?;
        if let Some(preset) = preset {
            given.insert("preset".into(), preset.into());
            given.remove("scales");
            given.remove("decoder");
        }
        let preset = given.get("preset").and_then(toml::Value::as_str).unwrap_or(Self::DEFAULT_PRESET);
        let mut whole = toml::Table::try_from(Self::preset(preset)?).expect("settings have a TOML form");
        overlay(&mut whole, given);
        let config: Self = whole.try_into().map_err(toml_error)?;
        config.check()?;
        Ok(config)
    }

    /// The settings as TOML without comments, which [`TrainConfig::from_toml`] reads.
    pub fn to_toml(&self) -> String {
        toml::to_string_pretty(self).expect("settings have a TOML form")
    }
}

/// Replaces the values of `table` that are `given`, table by table.
fn overlay(table: &mut toml::Table, given: toml::Table) {
    for (key, value) in given {
        match (table.get_mut(&key), value) {
            (Some(toml::Value::Table(inner)), toml::Value::Table(given)) => overlay(inner, given),
            (_, value) => drop(table.insert(key, value)),
        }
    }
}
