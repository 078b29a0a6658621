//! `strivec bench peak`: the machine's peak rates.

use crate::measure::bench::Peak;

const EXAMPLES: &str = "\
Examples:
  strivec bench peak
  strivec bench peak --threads 1 --json";

/// The arguments.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct Args {}

/// The peak of the command's threads.
pub(super) fn measure(_: &Args) -> Peak {
    Peak::measure()
}
