//! The commands, within this process.

use std::ffi::OsString;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Sender, channel};

use pyo3::prelude::*;
use strivec::cli::{self, Call, Host};
use strivec::train::TrainConfig;

use crate::errors::Failure;
use crate::work::{caught, next, spawn};

/// Messages from the thread of a command.
enum Event {
    Message(String),
    Progress { task: String, done: u64, total: u64, detail: String },
    End(Result<Vec<String>, Failure>),
}

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

/// Runs a command of `strivec`, or of `strivec-pack` if `packs`, on a thread of its own. `listener` is called with a message, or
/// with task, done, total and detail. Ctrl-C and an exception of `listener` end the command as Ctrl-C ends it in a terminal, and
/// raise after it has kept what is done; a second Ctrl-C raises at once. Returns the texts of the results.
#[pyfunction]
pub(crate) fn command(
    py: Python<'_>,
    packs: bool,
    arguments: Vec<OsString>,
    listener: Option<Bound<'_, PyAny>>,
) -> PyResult<Vec<String>> {
    let (sender, mut receiver) = channel();
    let interrupted = Arc::new(AtomicBool::new(false));
    let call = Call { host: Arc::new(Sending(sender.clone())), interrupted: Arc::clone(&interrupted) };
    spawn(move || {
        let run = if packs { cli::pack::call } else { cli::call };
        let _ = sender.send(Event::End(caught(|| Ok(run(&arguments, &call)?))));
    })?;
    let mut raised: Option<PyErr> = None;
    let told = |event: &Event| match (&listener, event) {
        (None, _) | (_, Event::End(_)) => Ok(()),
        (Some(listener), Event::Message(text)) => listener.call1((text,)).map(drop),
        (Some(listener), Event::Progress { task, done, total, detail }) => {
            listener.call1((task, done, total, detail)).map(drop)
        }
    };
    loop {
        let mut result = py.check_signals();
        if let (Some(_), Err(again)) = (&raised, &result) {
            return Err(again.clone_ref(py));
        }
        if let Some(event) = next(py, &mut receiver)? {
            if result.is_ok() && raised.is_none() {
                result = told(&event);
            }
            if let Event::End(end) = event {
                result?;
                return match raised {
                    Some(raised) => Err(raised),
                    None => Ok(end?),
                };
            }
        }
        if let Err(error) = result {
            interrupted.store(true, Ordering::SeqCst);
            raised.get_or_insert(error);
        }
    }
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
    let config: TrainConfig = serde_json::from_str(json).map_err(|e| Failure::usage(format!("settings: {e}")))?;
    Ok(config.to_toml())
}
