//! Runs the programs of the build under test.
#![allow(dead_code, reason = "each test uses a part")]

use std::path::Path;
use std::process::{Command, Output};

pub(crate) const STRIVEC: &str = env!("CARGO_BIN_EXE_strivec");
pub(crate) const PACK: &str = env!("CARGO_BIN_EXE_strivec-pack");

/// The command `program` in `folder`.
pub(crate) fn command(program: &str, folder: &Path, arguments: &[&str]) -> Command {
    let mut command = Command::new(program);
    // No test finds what another has kept.
    command.current_dir(folder).args(arguments).env("STRIVEC_CACHE", "");
    command
}

/// The output of `program` in `folder`.
pub(crate) fn output_of(program: &str, folder: &Path, arguments: &[&str]) -> Output {
    command(program, folder, arguments).output().unwrap()
}

/// The output of `strivec` in `folder`.
pub(crate) fn strivec(folder: &Path, arguments: &[&str]) -> Output {
    output_of(STRIVEC, folder, arguments)
}

/// The output of `strivec-pack` in `folder`.
pub(crate) fn pack(folder: &Path, arguments: &[&str]) -> Output {
    output_of(PACK, folder, arguments)
}

pub(crate) fn code(output: &Output) -> i32 {
    output.status.code().expect("the command ends by itself")
}

pub(crate) fn text(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).unwrap()
}

/// Standard output of a command that must have succeeded.
#[track_caller]
pub(crate) fn printed(output: &Output) -> String {
    assert_eq!(code(output), 0, "{}", text(&output.stderr));
    text(&output.stdout)
}

/// The JSON of a command that must have succeeded.
#[track_caller]
pub(crate) fn json_of(output: &Output) -> serde_json::Value {
    serde_json::from_str(&printed(output)).unwrap()
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
    assert!(output.status.success(), "{arguments:?}: {}", text(&output.stderr));
    text(&output.stdout)
}

/// The JSON of a command of `strivec` that must succeed.
#[track_caller]
pub(crate) fn json(folder: &Path, arguments: &[&str]) -> serde_json::Value {
    serde_json::from_str(&run(folder, &[arguments, &["--json", "--quiet"]].concat())).unwrap()
}
