//! Results on standard output, messages on standard error.

use std::io::{self, Write};
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};

use serde::Serialize;

use super::Error;

/// The process's two streams.
pub(super) struct Console {
    /// The program's name, with which error messages begin.
    name: &'static str,
    quiet: bool,
    json: bool,
    /// The reader of standard output has closed the pipe, as `head` does.
    closed: AtomicBool,
    /// Rows of the picture that was drawn last; 0 if there is a message below it.
    drawn_rows: AtomicU32,
}

impl Console {
    /// No messages if `quiet`; results as JSON if `json`.
    pub(super) fn new(name: &'static str, quiet: bool, json: bool) -> Self {
        Self { name, quiet, json, closed: AtomicBool::new(false), drawn_rows: AtomicU32::new(0) }
    }

    pub(super) fn is_quiet(&self) -> bool {
        self.quiet
    }

    /// Prints `result` as JSON with `--json`, else as `text`.
    ///
    /// A closed pipe is no error: the command continues, because its files may still be needed, and prints nothing
    /// more.
    ///
    /// # Errors
    ///
    /// If standard output cannot be written.
    pub(super) fn result<T: Serialize>(&self, result: &T, text: impl FnOnce(&T) -> String) -> Result<(), Error> {
        let text = if self.json {
            serde_json::to_string_pretty(result).map_err(|e| Error::Runtime(format!("JSON: {e}")))?
        } else {
            text(result)
        };
        self.print(&text)
    }

    /// Prints `text` in any output format, with a final line feed; see [`Console::result`].
    pub(super) fn print(&self, text: &str) -> Result<(), Error> {
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

    /// Prints a message to standard error, unless quiet.
    pub(super) fn say(&self, message: &str) {
        if !self.quiet {
            self.drawn_rows.store(0, Ordering::Relaxed);
            // A failure to write to standard error cannot be reported.
            let _ = writeln!(io::stderr().lock(), "{message}");
        }
    }

    /// Draws a picture of `rows` rows on standard error, which is a terminal, by the characters of `sequence`. It takes the
    /// place of the picture before, if no message came between.
    pub(super) fn draw(&self, sequence: &str, rows: u32) {
        let up = match self.drawn_rows.swap(rows, Ordering::Relaxed) {
            0 => String::new(),
            before => format!("\x1b[{before}A\r"),
        };
        // A failure to write to standard error cannot be reported.
        let _ = writeln!(io::stderr().lock(), "{up}{sequence}");
    }

    /// Prints the error of a command; messages of several lines, such as those about TOML, keep their lines.
    pub(super) fn fail(&self, error: &Error) {
        let _ = writeln!(io::stderr().lock(), "{}: {}", self.name, error.to_string().trim_end());
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
