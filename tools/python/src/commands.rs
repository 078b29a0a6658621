//! The commands, within this process.

use std::ffi::OsString;
use std::sync::Arc;
use std::sync::mpsc::Sender;

use pyo3::prelude::*;
use strivec::cli::{self, Call, Host};
use strivec::train::TrainConfig;

use crate::errors::Failure;
use crate::following::{Event, followed};

/// Passes on the messages and the progress of a command.
struct Sending(Sender<Event>);

impl Host for Sending {
    fn message(&self, text: &str) {
        // Nobody receives after a second Ctrl-C.
        let _ = self.0.send(Event::Message(text.to_owned()));
    }

    fn progress(&self, task: &str, done: u64, total: u64, detail: &str) {
        let event = Event::Progress { task: task.to_owned(), done, total, detail: detail.to_owned() };
        let _ = self.0.send(event);
    }
}

/// Runs a command of `strivec`, or of `strivec-pack` if `packs`, on a thread of its own, as [`followed`] says. Returns the
/// texts of the results.
#[pyfunction]
pub(crate) fn command(
    py: Python<'_>,
    packs: bool,
    arguments: Vec<OsString>,
    listener: Option<Bound<'_, PyAny>>,
) -> PyResult<Vec<String>> {
    followed(py, listener, move |sender, interrupted| {
        let call = Call { host: Arc::new(Sending(sender)), interrupted };
        let run = if packs { cli::pack::call } else { cli::call };
        Ok(run(&arguments, &call)?)
    })
}

/// The settings of `preset`, or of TOML that names one, as JSON.
#[pyfunction]
pub(crate) fn settings_of_toml(toml: &str, preset: Option<&str>) -> PyResult<String> {
    let config = TrainConfig::from_toml(toml, preset).map_err(|e| Failure::usage(e.to_string()))?;
    Ok(serde_json::to_string(&config).map_err(|e| Failure::runtime(e.to_string()))?)
}

/// The TOML of settings in JSON, which need not be complete: those of `preset` take the place of what is missing.
#[pyfunction]
pub(crate) fn toml_of_settings(json: &str) -> PyResult<String> {
    let invalid = |e: &dyn std::fmt::Display| Failure::usage(format!("settings: {e}"));
    let mut settings: serde_json::Value = serde_json::from_str(json).map_err(|e| invalid(&e))?;
    remove_nulls(&mut settings);
    let text = toml::to_string(&settings).map_err(|e| invalid(&e))?;
    let config = TrainConfig::from_toml(&text, None).map_err(|e| invalid(&e))?;
    Ok(config.to_toml())
}

/// Removes keys without a value, which TOML cannot express.
fn remove_nulls(value: &mut serde_json::Value) {
    if let serde_json::Value::Object(table) = value {
        table.retain(|_, value| !value.is_null());
        table.values_mut().for_each(remove_nulls);
    } else if let serde_json::Value::Array(values) = value {
        values.iter_mut().for_each(remove_nulls);
    }
}
