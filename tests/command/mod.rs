//! Runs the programs of the build under test.
#![allow(dead_code, reason = "each test uses a part")]

use std::path::Path;
use std::process::{Command, Output};

pub(crate) const STRIVEC: &str = env!("CARGO_BIN_EXE_strivec");
pub(crate) const PACK: &str = env!("CARGO_BIN_EXE_strivec-pack");

/// The output of `strivec` in `folder`.
pub(crate) fn strivec(folder: &Path, arguments: &[&str]) -> Output {
    output_of(STRIVEC, folder, arguments)
}

/// The output of `program` in `folder`.
pub(crate) fn output_of(program: &str, folder: &Path, arguments: &[&str]) -> Output {
    Command::new(program).current_dir(folder).args(arguments).output().unwrap()
}

/// Standard output of a command of `strivec` that must succeed.
#[track_caller]
pub(crate) fn run(folder: &Path, arguments: &[&str]) -> String {
    run_program(STRIVEC, folder, arguments)
}

/// Standard output of a command of `program` that must succeed.
#[track_caller]
pub(crate) fn run_program(program: &str, folder: &Path, arguments: &[&str]) -> String {
    let output = output_of(program, folder, arguments);
    assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}

/// The JSON of a command of `strivec` that must succeed.
#[track_caller]
pub(crate) fn json(folder: &Path, arguments: &[&str]) -> serde_json::Value {
    serde_json::from_str(&run(folder, &[arguments, &["--json", "--quiet"]].concat())).unwrap()
}
