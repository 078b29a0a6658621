//! `strivec bench`: speed of this build.
//!
//! Each subcommand measures one thing. Without a subcommand, all are measured quickly on a synthetic ball.

mod against;
mod files;
pub mod lab;
mod process;
mod render;
mod repeats;
mod report;
mod train;

use clap::Subcommand;
use serde::Serialize;

use super::{Context, Error};

const EXAMPLES: &str = "\
Examples:
  strivec bench
  strivec bench train lego --scene lego.strivec --set sampling.batch_rays=4096 --threads-list 1,2
  strivec bench render lego.strivec --size 800x800 --runs 5
  strivec bench against ../before/target/release/strivec --fail-above 1.05

Without a subcommand: training, rendering and files, on a ball of tensors, within a minute.";

/// The arguments.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct Args {
    #[command(subcommand)]
    what: Option<What>,
}

#[derive(Debug, Subcommand)]
enum What {
    /// Measure training steps by stage
    Train(train::Args),
    /// Measure frames by stage
    Render(render::Args),
    /// Measure reading, writing and upsampling of scenes
    Files(files::Args),
    /// Compare this build with another
    Against(against::Args),
}

/// All measurements, as `--json` prints them.
#[derive(Serialize)]
struct Everything {
    train: train::Report,
    render: render::Report,
    files: files::Report,
}

/// Runs a subcommand, or all quickly.
pub(super) fn run(args: &Args, session: &Context) -> Result<(), Error> {
    match &args.what {
        Some(What::Train(args)) => session.console.result(&train::measure(args, session)?, train::Report::text),
        Some(What::Render(args)) => session.console.result(&render::measure(args, session)?, render::Report::text),
        Some(What::Files(args)) => session.console.result(&files::measure(args, session)?, files::Report::text),
        Some(What::Against(args)) => against::run(args, session),
        None => {
            let everything = Everything {
                train: train::measure(&train::Args::quick(), session)?,
                render: render::measure(&render::Args::quick(), session)?,
                files: files::measure(&files::Args::quick(), session)?,
            };
            session.console.result(&everything, |e| {
                [e.train.text(), e.render.text(), e.files.text()]
                    .map(|part| part.trim_end().to_owned() + "\n")
                    .join("\n")
            })
        }
    }
}

#[cfg(test)]
mod tests {
    use clap::{CommandFactory, Parser};

    use super::*;

    #[derive(Debug, Parser)]
    #[command(name = "bench")]
    struct Bench {
        #[command(flatten)]
        globals: crate::session::Globals,
        #[command(flatten)]
        args: Args,
    }

    #[test]
    fn every_example_of_every_subcommand_parses() {
        let mut bench = Bench::command();
        let mut helps = vec![EXAMPLES.to_owned()];
        for sub in bench.get_subcommands_mut() {
            let help = sub.get_after_help().map(ToString::to_string).unwrap_or_default();
            assert!(help.contains(&format!("  strivec bench {}", sub.get_name())), "{} has no example", sub.get_name());
            helps.push(help);
        }
        for example in helps.iter().flat_map(|help| help.lines()).filter_map(|line| line.strip_prefix("  strivec ")) {
            Bench::try_parse_from(example.split_whitespace()).unwrap_or_else(|e| panic!("{example}: {e}"));
        }
    }

    #[test]
    fn arguments_that_contradict_each_other_are_refused() {
        for arguments in [
            &["train", "lego"][..],
            &["train", "--scene", "a"],
            &["train", "lego", "--scene", "a", "--resume", "b"],
            &["train", "lego", "--resume", "a", "--preset", "24"],
            &["train", "lego", "--at", "0", "--upsampled", "1"],
            &["train", "--downscale", "2"],
            &["render", "--runs", "0"],
            &["render", "--threads-list", "1,0"],
            &["against"],
            &["against", "old", "--value", "/x"],
            &["against", "old", "--fail-above", "-1"],
        ] {
            assert!(Bench::try_parse_from([&["bench"], arguments].concat()).is_err(), "{arguments:?}");
        }
    }
}
