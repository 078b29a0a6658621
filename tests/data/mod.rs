//! Real scenes that the repository does not hold: folders below the one that `STRIVEC_DATA` names.

use std::env;
use std::io::{self, Write};
use std::path::PathBuf;

/// The folder `name` of the data; `None` if `STRIVEC_DATA` is not set, with a line that the test harness does not
/// capture.
///
/// # Panics
///
/// If `STRIVEC_DATA` is set and holds no such folder.
pub(crate) fn folder(name: &str) -> Option<PathBuf> {
    let Some(data) = env::var_os("STRIVEC_DATA") else {
        let test = std::thread::current().name().unwrap_or("a test").to_owned();
        // Not `eprintln!`, which is captured from a test that passes.
        let _ = writeln!(io::stderr(), "{test}: not run: STRIVEC_DATA is not set");
        return None;
    };
    let folder = PathBuf::from(data).join(name);
    assert!(folder.is_dir(), "STRIVEC_DATA holds no folder {}", folder.display());
    Some(folder)
}
