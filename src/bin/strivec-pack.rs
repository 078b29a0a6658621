//! The command `strivec-pack`.

use std::process::ExitCode;

fn main() -> ExitCode {
    strivec::cli::pack::main()
}
