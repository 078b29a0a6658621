//! Builds as processes of their own.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use crate::cli::Error;

/// This executable.
pub(super) fn this_build() -> Result<PathBuf, Error> {
    std::env::current_exe().map_err(|e| Error::Io(format!("this executable: cannot find it: {e}")))
}

/// What `executable` prints when it succeeds with `arguments`.
pub(super) fn output_of(executable: &Path, arguments: &[String]) -> Result<Vec<u8>, Error> {
    let shown = executable.display();
    let output = (Command::new(executable).args(arguments).stdin(Stdio::null()).output())
        .map_err(|e| Error::Io(format!("{shown}: cannot run it: {e}")))?;
    if output.status.success() {
        return Ok(output.stdout);
    }
    let message = String::from_utf8_lossy(&output.stderr);
    let last = message.lines().last().unwrap_or("no message").to_owned();
    let command = arguments.join(" ");
    Err(Error::Runtime(format!("{shown} {command}: expected success, found {}: {last}", output.status)))
}

/// The JSON that `executable` prints with `arguments`.
pub(super) fn json_of(executable: &Path, arguments: &[String]) -> Result<serde_json::Value, Error> {
    parsed(&output_of(executable, arguments)?).map_err(Error::malformed(executable))
}

fn parsed(output: &[u8]) -> Result<serde_json::Value, String> {
    serde_json::from_slice(output).map_err(|e| format!("output: expected JSON, found {e}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn output_that_is_not_json_is_named() {
        assert!(parsed(b"text").unwrap_err().contains("expected JSON"));
    }
}
