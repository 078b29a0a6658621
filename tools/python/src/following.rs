//! Long work on a thread of its own, whose messages and progress a function of Python receives.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Sender, channel};

use pyo3::prelude::*;

use crate::errors::Failure;
use crate::work::{caught, next, spawn};

/// Messages from the thread of the work.
pub(crate) enum Event {
    Message(String),
    Progress { task: String, done: u64, total: u64, detail: String },
    End(Result<Vec<String>, Failure>),
}

/// Runs `work` on a thread of its own, with a channel for its events and a flag that asks it to stop. `listener` is called
/// with a message, or with task, done, total and detail. Ctrl-C and an exception of `listener` set the flag, and raise after
/// the work has ended, so that it keeps what is done; a second Ctrl-C raises at once. Returns the texts of the results.
pub(crate) fn followed(
    py: Python<'_>,
    listener: Option<Bound<'_, PyAny>>,
    work: impl FnOnce(Sender<Event>, Arc<AtomicBool>) -> Result<Vec<String>, Failure> + Send + 'static,
) -> PyResult<Vec<String>> {
    let (sender, mut receiver) = channel();
    let interrupted = Arc::new(AtomicBool::new(false));
    let flag = Arc::clone(&interrupted);
    spawn(move || {
        let events = sender.clone();
        let _ = sender.send(Event::End(caught(|| work(events, flag))));
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
