//! Results on standard output, messages on standard error; or both to the program that a command runs within.

use std::io::{self, Write};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use serde::Serialize;

use super::Error;
use super::host::Host;
use strivec_format::escape::{escaped, escaped_json, escaped_lines};

/// The process's two streams, or the host.
pub(super) struct Console {
    /// The program's name, with which error messages begin.
    name: &'static str,
    quiet: bool,
    json: bool,
    /// The reader of standard output has closed the pipe, as `head` does.
    closed: AtomicBool,
    embedding: Option<Embedding>,
}

/// The host of a command that runs within another program, and the results that are kept for it.
struct Embedding {
    host: Arc<dyn Host>,
    results: Mutex<Vec<String>>,
}

impl Console {
    /// No messages if `quiet`; results as JSON if `json`.
    pub(super) fn new(name: &'static str, quiet: bool, json: bool) -> Self {
        Self { name, quiet, json, closed: AtomicBool::new(false), embedding: None }
    }

    /// Keeps results, as JSON, and passes messages to `host`, unless `quiet`.
    pub(super) fn of_host(host: Arc<dyn Host>, quiet: bool) -> Self {
        let embedding = Embedding { host, results: Mutex::default() };
        Self { embedding: Some(embedding), ..Self::new("", quiet, true) }
    }

    /// The results that were kept for a host.
    pub(super) fn into_results(self) -> Vec<String> {
        let results = self.embedding.map(|embedding| embedding.results.into_inner());
        results.map_or_else(Vec::new, |results| results.unwrap_or_else(PoisonError::into_inner))
    }

    /// The host that is to be told of progress.
    pub(super) fn host(&self) -> Option<&dyn Host> {
        self.embedding.as_ref().map(|embedding| &*embedding.host).filter(|_| !self.quiet)
    }

    pub(super) fn is_quiet(&self) -> bool {
        self.quiet
    }

    /// Prints `result` as JSON with `--json`, else as `text`, without unsafe characters ([`strivec_format::escape`]). `text`
    /// must itself escape line feeds in texts of files and in paths.
    ///
    /// A closed pipe is no error: the command continues, because its files may still be needed, and prints nothing
    /// more.
    ///
    /// # Errors
    ///
    /// If standard output cannot be written.
    pub(super) fn result<T: Serialize>(&self, result: &T, text: impl FnOnce(&T) -> String) -> Result<(), Error> {
        let text = if self.json {
            let json = serde_json::to_string_pretty(result).map_err(|e| Error::Runtime(format!("JSON: {e}")))?;
            escaped_json(&json)
        } else {
            escaped_lines(&text(result))
        };
        self.print(&text)
    }

    /// Prints `text`, which has no text of an untrusted file, in any output format, with a final line feed; see [`Console::result`].
    pub(super) fn print(&self, text: &str) -> Result<(), Error> {
        if let Some(embedding) = &self.embedding {
            embedding.results.lock().unwrap_or_else(PoisonError::into_inner).push(text.to_owned());
            return Ok(());
        }
        if self.closed.load(Ordering::Relaxed) {
            return Ok(());
        }
        let mut stdout = io::stdout().lock();
        let end = if text.ends_with('\n') { "" } else { "\n" };
        match write!(stdout, "{text}{end}").and_then(|()| stdout.flush()) {
            Err(error) if error.kind() == io::ErrorKind::BrokenPipe => {
                self.closed.store(true, Ordering::Relaxed);
                Ok(())
            }
            other => other.map_err(|e| Error::Io(format!("cannot write to standard output: {e}"))),
        }
    }

    /// Prints a message of one line to standard error, unless quiet.
    pub(super) fn say(&self, message: &str) {
        if let Some(host) = self.host() {
            host.message(&escaped(message));
        } else if !self.quiet {
            // A failure to write to standard error cannot be reported.
            let _ = writeln!(io::stderr().lock(), "{}", escaped(message));
        }
    }

    /// Prints the error of a command in one line, and the lines that belong to it below.
    pub(super) fn fail(&self, error: &Error) {
        let mut text = format!("{}: {}\n", self.name, escaped(&error.to_string()));
        if let Error::WithLines { lines, .. } = error {
            text.extend(lines.iter().map(|line| format!("  {}\n", escaped(line))));
        }
        if let Some(embedding) = &self.embedding {
            text.lines().for_each(|line| embedding.host.message(line));
            return;
        }
        let _ = io::stderr().lock().write_all(text.as_bytes());
    }

    /// The worst of `errors` as a command's result, after the others were printed.
    ///
    /// # Errors
    ///
    /// The error of the highest exit code, if there is any.
    pub(super) fn fail_with(&self, mut errors: Vec<Error>) -> Result<(), Error> {
        errors.sort_by_key(Error::exit_code);
        let Some(worst) = errors.pop() else { return Ok(()) };
        errors.iter().for_each(|error| self.fail(error));
        Err(worst)
    }
}
