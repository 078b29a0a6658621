//! The command `strivec-pack`.
#![forbid(unsafe_code)]

use std::process::ExitCode;

fn main() -> ExitCode {
    strivec::cli::pack::main()
}
