//! Errors as exceptions of `strivec.errors`.

use std::any::Any;
use std::path::Path;

use pyo3::prelude::*;
use strivec::cli;
use strivec::container;
use strivec::recipe;

/// An exception before it is one: its class, its sentence, and the lines of a file or of a program's log that show the fault.
#[derive(Debug)]
pub(crate) struct Failure {
    class: &'static str,
    message: String,
    lines: Vec<String>,
}

impl Failure {
    pub(crate) fn usage(message: impl Into<String>) -> Self {
        Self::new("UsageError", message)
    }

    pub(crate) fn malformed(message: impl Into<String>) -> Self {
        Self::new("MalformedError", message)
    }

    pub(crate) fn runtime(message: impl Into<String>) -> Self {
        Self::new("RunError", message)
    }

    /// A fault of this program, by what its thread panicked with.
    pub(crate) fn of_panic(payload: &(dyn Any + Send)) -> Self {
        let text = payload.downcast_ref::<String>().map(String::as_str);
        let text = text.or_else(|| payload.downcast_ref::<&str>().copied()).unwrap_or("no message");
        Self::new("InternalError", format!("a fault of strivec itself, please report it: {text}"))
    }

    /// Why the bytes of `file` are no scene, or a scene was not written.
    pub(crate) fn container(file: &Path, error: container::Error) -> Self {
        cli::Error::container(file, error).into()
    }

    fn new(class: &'static str, message: impl Into<String>) -> Self {
        Self { class, message: message.into(), lines: Vec::new() }
    }
}

impl From<cli::Error> for Failure {
    fn from(error: cli::Error) -> Self {
        let class = match error {
            cli::Error::WithLines { error, lines } => return Self { lines, ..(*error).into() },
            cli::Error::Usage(_) => "UsageError",
            cli::Error::Io(_) => "InputError",
            cli::Error::Malformed(_) => "MalformedError",
            cli::Error::Unsupported(_) => "UnsupportedError",
            cli::Error::Memory(_) => "MemoryLimitError",
            cli::Error::Differs(_) => "DiffersError",
            cli::Error::Runtime(_) => "RunError",
        };
        Self::new(class, error.to_string())
    }
}

impl From<recipe::Error> for Failure {
    /// The class is that of the command's error; the message names settings, not flags.
    fn from(error: recipe::Error) -> Self {
        let message = error.to_string();
        Self { message, ..cli::Error::from(error).into() }
    }
}

impl From<recipe::FileError> for Failure {
    fn from(error: recipe::FileError) -> Self {
        recipe::Error::from(error).into()
    }
}

impl From<Failure> for PyErr {
    fn from(failure: Failure) -> Self {
        Python::attach(|py| {
            let class = py.import("strivec.errors").and_then(|errors| errors.getattr(failure.class));
            let error = class.and_then(|class| class.call1((failure.message,)));
            match error.and_then(|error| error.setattr("lines", failure.lines).map(|()| error)) {
                Ok(error) => Self::from_value(error),
                Err(broken) => broken,
            }
        })
    }
}
