//! The command `strivec`.
#![forbid(unsafe_code)]

use std::process::ExitCode;

fn main() -> ExitCode {
    strivec::cli::main()
}
