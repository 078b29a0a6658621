//! The TOML form of settings.

use serde::Deserialize as _;
use serde::de::{Deserializer, Error as _};
use strivec_format::{Invalid, Place};
use toml::{Table, Value};

use super::near_names::near_names;
use super::sections::paper_rules;
use super::{ConfigError, Preset, TrainConfig};
use strivec_format::geometry::Contraction;
use strivec_format::model::Rules;

/// Keys that have another name than before, and their present names.
const RENAMED: [(&str, &str); 6] = [
    ("max_photograph_side", "photographs.max_side"),
    ("refine_poses", "poses.refine"),
    ("shell", "model.contraction.shell"),
    ("field", "model"),
    ("model.step_cells", "model.step"),
    ("model.sky", "photographs.sky_degree"),
];
/// The most similar keys that an error names.
const MAX_NEAR: usize = 3;

impl TrainConfig {
    /// Reads settings. Fields that `text` leaves out are those of the preset that it names, or of the default preset. If
    /// `preset` is given, it replaces the preset, the scales and the decoder of `text`.
    ///
    /// # Errors
    ///
    /// If `text` is not TOML of settings, or a field is out of range; the error names the line or the field.
    pub fn from_toml(text: &str, preset: Option<&str>) -> Result<Self, ConfigError> {
        let mut given: Table = toml::from_str(text).map_err(toml_error)?;
        // Errors have line numbers only if the text itself is deserialized.
        let read = toml::from_str::<Self>(text);
        check_keys(&given, || read.as_ref().err().map_or_else(String::new, place_of))?;
        read.map_err(toml_error)?;
        if let Some(preset) = preset {
            given.insert("preset".into(), preset.into());
            given.remove("scales");
            given.remove("decoder");
        }
        let preset = match given.get("preset").and_then(Value::as_str) {
            Some(name) => name.parse()?,
            None => Preset::default(),
        };
        preset.config().overridden(given)
    }

    /// These settings, of which `assignments` replace single ones. An assignment is `KEY=VALUE` with a dotted key and a
    /// value in TOML, such as `lean.max_loss=0.05`. A single word needs no quotes, and a number in the place of a key is an
    /// index, as in `scales.0.top_k=2`.
    ///
    /// # Errors
    ///
    /// [`ConfigError::Assignment`]; those of [`TrainConfig::from_toml`].
    pub fn with_assignments(self, assignments: &[String]) -> Result<Self, ConfigError> {
        let mut given = Table::new();
        for text in assignments {
            let assignment = assignment(text)?;
            check_keys(&assignment, String::new)?;
            if assignment.contains_key("preset") {
                let expected = "chosen before single settings, of which it sets all";
                return Err(Invalid::new(Place::option("preset"), expected, text).into());
            }
            merge(&mut given, assignment);
        }
        self.overridden(given)
    }

    /// These settings, of which those that are `given` are replaced.
    fn overridden(self, given: Table) -> Result<Self, ConfigError> {
        let mut whole = table_of(&self);
        merge(&mut whole, given);
        let config: Self = whole.try_into().map_err(toml_error)?;
        config.check()?;
        Ok(config)
    }

    /// The settings as TOML without comments, which [`TrainConfig::from_toml`] reads.
    pub fn to_toml(&self) -> String {
        toml::to_string_pretty(self).expect("settings have a TOML form")
    }
}

fn toml_error(error: toml::de::Error) -> ConfigError {
    ConfigError::Toml(Box::new(error))
}

fn table_of(config: &TrainConfig) -> Table {
    Table::try_from(config).expect("settings have a TOML form")
}

/// The table of one assignment.
fn assignment(text: &str) -> Result<Table, ConfigError> {
    let (key, value) = text.split_once('=').ok_or_else(|| ConfigError::Assignment(text.into()))?;
    let value = value.trim();
    if key.trim().is_empty() || value.is_empty() {
        return Err(ConfigError::Assignment(text.into()));
    }
    let is_word = value.starts_with(char::is_alphabetic)
        && value.chars().all(|c| c.is_alphanumeric() || "-_".contains(c))
        && !["true", "false", "inf", "nan"].contains(&value);
    let quoted = if is_word { format!("{value:?}") } else { value.to_owned() };
    toml::from_str(&format!("{key} = {quoted}")).map_err(toml_error)
}

/// Replaces the values of `table` that are `given`, table by table. Into an array goes a table whose keys are indices.
fn merge(table: &mut Table, given: Table) {
    for (key, value) in given {
        match (table.get_mut(&key), value) {
            (Some(Value::Table(inner)), Value::Table(given)) => merge(inner, given),
            (Some(Value::Array(list)), Value::Table(given)) if has_indices(list, &given) => {
                for (index, value) in given {
                    match (entry(list, &index), value) {
                        (Some(Value::Table(inner)), Value::Table(given)) => merge(inner, given),
                        (Some(entry), value) => *entry = value,
                        (None, _) => {}
                    }
                }
            }
            (_, value) => drop(table.insert(key, value)),
        }
    }
}

fn entry<'a>(list: &'a mut [Value], index: &str) -> Option<&'a mut Value> {
    list.get_mut(index.parse::<usize>().ok()?)
}

/// True if all keys of `given` are indices of `list`.
fn has_indices(list: &[Value], given: &Table) -> bool {
    given.keys().all(|key| key.parse().is_ok_and(|index: usize| index < list.len()))
}

/// The lines of `error` that show its place in the text.
fn place_of(error: &toml::de::Error) -> String {
    let text = error.to_string();
    text.trim_end().strip_suffix(error.message()).unwrap_or_default().to_owned()
}

/// An error if settings have no key that `given` has; `place` shows where it is.
fn check_keys(given: &Table, place: impl FnOnce() -> String) -> Result<(), ConfigError> {
    let known = table_of(&complete());
    let Some(key) = unknown_key(given, &known, "") else { return Ok(()) };
    let mut keys = Vec::new();
    leaves(&known, "", &mut keys);
    let last = |key: &str| key.rsplit('.').next().unwrap_or_default().to_owned();
    let name = last(&key);
    let mut near: Vec<&str> = match RENAMED.iter().find(|(before, _)| *before == key) {
        Some((_, now)) => vec![now],
        None => keys.iter().filter(|known| last(known) == name).map(String::as_str).collect(),
    };
    if near.is_empty() {
        let names: Vec<String> = keys.iter().map(|key| last(key)).collect();
        for similar in near_names(&name, names.iter().map(String::as_str)) {
            let of_name = keys.iter().filter(|known| last(known) == similar).map(String::as_str);
            near.extend(of_name.filter(|key| !near.contains(key)).collect::<Vec<_>>());
        }
    }
    near.truncate(MAX_NEAR);
    let near = near.iter().map(|key| format!("`{key}`")).collect::<Vec<_>>().join(" or ");
    Err(ConfigError::UnknownKey {
        place: place(),
        key,
        near: if near.is_empty() { near } else { format!("; set {near}") },
    })
}

/// The first key of `given`, with the tables that it is in, that `known` does not have.
fn unknown_key(given: &Table, known: &Table, place: &str) -> Option<String> {
    given.iter().find_map(|(key, value)| {
        let path = format!("{place}{key}");
        match (known.get(key), value) {
            (None, _) => Some(path),
            (Some(Value::Table(known)), Value::Table(given)) => unknown_key(given, known, &format!("{path}.")),
            (Some(Value::Array(known)), Value::Array(given)) => {
                let known = known.first()?.as_table()?;
                let mut tables = given.iter().enumerate().filter_map(|(i, value)| Some((i, value.as_table()?)));
                tables.find_map(|(i, given)| unknown_key(given, known, &format!("{path}.{i}.")))
            }
            (Some(Value::Array(known)), Value::Table(given)) => {
                let known = known.first()?.as_table()?;
                let mut tables = given.iter().filter_map(|(i, value)| Some((i, value.as_table()?)));
                tables.find_map(|(i, given)| unknown_key(given, known, &format!("{path}.{i}.")))
            }
            _ => None,
        }
    })
}

/// Appends the dotted keys of all values in `table`, which is at `place`, to `keys`.
fn leaves(table: &Table, place: &str, keys: &mut Vec<String>) {
    for (key, value) in table {
        let path = format!("{place}{key}");
        match value {
            Value::Table(inner) => leaves(inner, &format!("{path}."), keys),
            Value::Array(list) if list.first().is_some_and(Value::is_table) => {
                list.iter().filter_map(Value::as_table).for_each(|inner| leaves(inner, &format!("{path}.0."), keys));
            }
            _ => keys.push(path),
        }
    }
}

/// Settings of which none is absent, for their keys.
pub(super) fn complete() -> TrainConfig {
    let mut config = Preset::default().config();
    config.schedule.max_file_bytes = Some(1);
    (config.photographs.max_side, config.photographs.sky_degree) = (Some(1), Some(0));
    (config.lean.max_parameters, config.lean.max_drop) = (Some(1), Some(1.0));
    (config.space.near_far, config.space.inner_box) = (Some([0.0, 1.0]), Some([glam::DVec3::ZERO, glam::DVec3::ONE]));
    config.space.unbounded = Some(true);
    config.model.contraction = Some(Contraction { shell: 1.0 });
    config.scales.iter_mut().for_each(|scale| scale.whole_scene = true);
    config
}

/// Rules of which a part may be given; the others are the paper's.
pub(super) fn partial_rules<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Rules, D::Error> {
    let given = Table::deserialize(deserializer)?;
    let mut whole = Table::try_from(paper_rules()).map_err(D::Error::custom)?;
    merge(&mut whole, given);
    whole.try_into().map_err(D::Error::custom)
}
