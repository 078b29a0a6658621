//! `strivec dataset info`: what was understood of a dataset, before anything is trained.

mod info;
mod options;
mod picture;

use clap::Subcommand;

pub(super) use options::DatasetOptions;

use super::{Context, Error};

const EXAMPLES: &str = "\
Examples:
  strivec dataset info capture
  strivec dataset info capture --picture cameras.png";

/// The arguments.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct Args {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Print a dataset's layout, splits, cameras and place, and what is missing
    Info(info::Args),
}

/// Runs the subcommand.
pub(super) fn run(args: &Args, session: &Context) -> Result<(), Error> {
    match &args.command {
        Command::Info(args) => info::run(args, session),
    }
}
