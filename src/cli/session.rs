//! The start of every command: global options, console and exit code.

use std::process::ExitCode;

use super::console::Console;
use super::error::{Error, USAGE};
use crate::escape::print_clap_error;

/// Options of every command.
#[derive(Clone, Debug, clap::Args)]
#[command(next_help_heading = "Options of every command")]
pub(super) struct Globals {
    /// Number of threads; results do not depend on it [default: one per core]
    #[arg(long, global = true, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=4096))]
    threads: Option<u16>,
    /// Print no progress and no messages except errors
    #[arg(long, short, global = true)]
    quiet: bool,
    /// Print results as JSON
    #[arg(long, global = true)]
    json: bool,
    /// Overwrite files that exist
    #[arg(long, global = true)]
    force: bool,
}

/// Console and global options.
pub(super) struct Session {
    pub(super) console: Console,
    /// Overwrite existing files.
    pub(super) force: bool,
}

/// Runs the `parsed` command of the program `name`.
pub(super) fn run_command<C>(
    name: &'static str,
    parsed: Result<(Globals, C), clap::Error>,
    run: impl FnOnce(&C, &Session) -> Result<(), Error>,
) -> ExitCode {
    let (globals, command) = match parsed {
        Ok(parsed) => parsed,
        Err(error) => {
            print_clap_error(&error);
            return ExitCode::from(if error.use_stderr() { USAGE } else { 0 });
        }
    };
    let session = Session { console: Console::new(name, globals.quiet, globals.json), force: globals.force };
    match start_threads(&globals).and_then(|()| run(&command, &session)) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            session.console.fail(&error);
            ExitCode::from(error.exit_code())
        }
    }
}

fn start_threads(globals: &Globals) -> Result<(), Error> {
    let Some(threads) = globals.threads else { return Ok(()) };
    let built = rayon::ThreadPoolBuilder::new().num_threads(threads.into()).build_global();
    built.map_err(|e| Error::Runtime(format!("cannot start {threads} threads: {e}")))
}
