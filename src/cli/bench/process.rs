//! Runs builds as separate processes.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use crate::Error;

/// This executable.
pub(super) fn this_build() -> Result<PathBuf, Error> {
    std::env::current_exe().map_err(|e| Error::Io(format!("cannot find the path of this executable: {e}")))
}

/// The standard output of `executable` with `arguments`. Fails if it does.
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
    Err(Error::Runtime(format!("{shown} {command}: failed with {}: {last}", output.status)))
}

/// The JSON that `executable` prints with `arguments`.
pub(super) fn json_of(executable: &Path, arguments: &[String]) -> Result<serde_json::Value, Error> {
    parsed(&output_of(executable, arguments)?).map_err(Error::malformed(executable))
}

fn parsed(output: &[u8]) -> Result<serde_json::Value, String> {
    serde_json::from_slice(output).map_err(|e| format!("the output is not JSON: {e}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn output_that_is_not_json_is_named() {
        assert!(parsed(b"text").unwrap_err().contains("not JSON"));
    }
}
