//! The command `strivec-player`.

use std::process::ExitCode;

fn main() -> ExitCode {
    strivec::desktop::main()
}
