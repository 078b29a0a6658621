//! `strivec view`: start the desktop player.

use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::process;

use super::Error;

const EXAMPLES: &str = "\
Examples:
  strivec view lego.strivec
  strivec view before.strivec after.strivec --compare

Starts strivec-player, beside this program or in PATH, with the same arguments; strivec-player --help lists its options.";

/// The player's program name.
const PLAYER: &str = "strivec-player";

/// The arguments.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct Args {
    /// Scene files or URLs, and options of strivec-player
    #[arg(value_name = "FILE", trailing_var_arg = true, allow_hyphen_values = true)]
    arguments: Vec<OsString>,
}

/// Runs the player until its window is closed.
pub(super) fn run(args: &Args) -> Result<(), Error> {
    let program = beside_this_program().unwrap_or_else(|| PathBuf::from(PLAYER));
    let status =
        process::Command::new(&program).args(&args.arguments).status().map_err(|error| match error.kind() {
            std::io::ErrorKind::NotFound => {
                let install = "install it with `cargo install --path . --features player`";
                Error::Io(format!("{PLAYER} is neither beside this program nor in PATH; {install}"))
            }
            _ => Error::io("start", &program)(error),
        })?;
    if status.success() {
        return Ok(());
    }
    Err(Error::Runtime(format!("{PLAYER} ended with {status}")))
}

/// The player in this executable's folder, if it is there.
fn beside_this_program() -> Option<PathBuf> {
    let this = std::env::current_exe().ok()?;
    let player = this.parent().map(Path::to_path_buf)?.join(format!("{PLAYER}{}", std::env::consts::EXE_SUFFIX));
    player.is_file().then_some(player)
}
