//! The command `strivec`.

use std::process::ExitCode;

fn main() -> ExitCode {
    strivec::cli::main()
}
