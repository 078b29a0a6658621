//! Errors of arguments on the terminal.

use std::io::Write as _;

use strivec_format::escape::escaped_lines;

/// Prints help, the version, or the error in a program's arguments, escaped but for line feeds.
pub fn print_clap_error(error: &clap::Error) {
    let text = error.render().to_string();
    let safe = escaped_lines(&text);
    // A closed pipe is no error.
    let _ = if safe == text { error.print() } else { std::io::stderr().lock().write_all(safe.as_bytes()) };
}
