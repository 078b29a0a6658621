//! The command `strivec-player`.
#![forbid(unsafe_code)]

use std::process::ExitCode;

fn main() -> ExitCode {
    strivec::desktop::main()
}
