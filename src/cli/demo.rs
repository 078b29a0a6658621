//! `strivec demo`: the whole way once, on a scene that the command makes itself.

use std::path::PathBuf;

use super::{Error, Session};

const EXAMPLES: &str = "\
Examples:
  strivec demo
  strivec demo --out /tmp/demo --seed 7";

/// The arguments.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct Args {
    /// Folder for the dataset, demo.strivec and the picture sheet; made where it is absent
    #[arg(long, value_name = "DIR", default_value = "demo")]
    pub(super) out: PathBuf,
    /// Of every random choice
    #[arg(long, value_name = "S", default_value_t = 0)]
    pub(super) seed: u64,
}

/// Makes, trains and shows the scene.
pub(super) fn run(args: &Args, _session: &Session) -> Result<(), Error> {
    let folder = args.out.display();
    Err(Error::Runtime(format!("{folder}: the demo with seed {} is not built in yet", args.seed)))
}
