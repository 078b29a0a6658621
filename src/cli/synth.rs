//! `strivec synth`: a synthetic dataset.

use std::path::PathBuf;

use super::{Error, Session, picture_size};

const EXAMPLES: &str = "\
Examples:
  strivec synth toy --views 40 --size 200x200 --seed 1";

/// The arguments.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct Args {
    /// Folder for the dataset; made where it is absent
    out: PathBuf,
    /// Views of the training split
    #[arg(long, value_name = "N", default_value_t = 60, value_parser = clap::value_parser!(u32).range(1..=10_000))]
    views: u32,
    /// Size of the pictures
    #[arg(long, value_name = "WxH", default_value = "200x200", value_parser = picture_size::parse)]
    size: [u32; 2],
    /// Of every random choice; the bytes depend on it alone
    #[arg(long, value_name = "S", default_value_t = 0)]
    seed: u64,
}

/// Makes the dataset.
pub(super) fn run(args: &Args, _session: &Session) -> Result<(), Error> {
    let Args { out, views, size, seed } = args;
    let [width, height] = size;
    let what = format!("{}: {views} views of {width}x{height} with seed {seed}", out.display());
    Err(Error::Runtime(format!("{what}: making synthetic scenes is not built in yet")))
}
