//! The start of every command: global options, console and exit code.

use std::process::ExitCode;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, OnceLock};

use super::console::Console;
use super::error::{Error, USAGE};
use super::host::Call;
use super::print_clap_error;

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
pub(super) struct Context {
    pub(super) console: Console,
    /// Overwrite existing files.
    pub(super) force: bool,
    /// The flag of the host, if there is one.
    interrupted: Option<Arc<AtomicBool>>,
}

impl Context {
    /// The flag to stop. The first Ctrl-C or termination signal sets it, and the second one ends the process; within
    /// another program, that program sets it.
    pub(super) fn interrupts(&self) -> Result<Arc<AtomicBool>, Error> {
        // The process has one handler, which a command of several trainings installs again.
        static INTERRUPTED: OnceLock<Arc<AtomicBool>> = OnceLock::new();
        if let Some(interrupted) = self.interrupted.as_ref().or_else(|| INTERRUPTED.get()) {
            return Ok(Arc::clone(interrupted));
        }
        let interrupted = Arc::new(AtomicBool::new(false));
        let seen = Arc::clone(&interrupted);
        ctrlc::set_handler(move || {
            if seen.swap(true, Ordering::SeqCst) {
                std::process::exit(4);
            }
        })
        .map_err(|e| Error::Runtime(format!("cannot handle Ctrl-C: {e}")))?;
        Ok(Arc::clone(INTERRUPTED.get_or_init(|| interrupted)))
    }
}

/// Runs the `parsed` command of the program `name`.
pub(super) fn run_command<C>(
    name: &'static str,
    parsed: Result<(Globals, C), clap::Error>,
    run: impl FnOnce(&C, &Context) -> Result<(), Error>,
) -> ExitCode {
    let (globals, command) = match parsed {
        Ok(parsed) => parsed,
        Err(error) => {
            print_clap_error(&error);
            return ExitCode::from(if error.use_stderr() { USAGE } else { 0 });
        }
    };
    let console = Console::new(name, globals.quiet, globals.json);
    let session = Context { console, force: globals.force, interrupted: None };
    let start_threads = || match globals.threads {
        None => Ok(()),
        Some(threads) => builder(threads).build_global().map_err(no_threads(threads)),
    };
    match start_threads().and_then(|()| run(&command, &session)) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            session.console.fail(&error);
            ExitCode::from(error.exit_code())
        }
    }
}

/// Runs the `parsed` command for the host of `call`; returns its results.
pub(super) fn run_call<C: Sync>(
    parsed: Result<(Globals, C), clap::Error>,
    call: &Call,
    run: impl FnOnce(&C, &Context) -> Result<(), Error> + Send,
) -> Result<Vec<String>, Error> {
    let (globals, command) = parsed.map_err(|error| Error::Usage(error.to_string().trim_end().into()))?;
    let console = Console::of_host(Arc::clone(&call.host), globals.quiet);
    let session = Context { console, force: globals.force, interrupted: Some(Arc::clone(&call.interrupted)) };
    match globals.threads {
        None => run(&command, &session)?,
        // The threads of the process are the host's.
        Some(threads) => {
            builder(threads).build().map_err(no_threads(threads))?.install(|| run(&command, &session))?;
        }
    }
    Ok(session.console.into_results())
}

fn builder(threads: u16) -> rayon::ThreadPoolBuilder {
    rayon::ThreadPoolBuilder::new().num_threads(threads.into())
}

fn no_threads(threads: u16) -> impl FnOnce(rayon::ThreadPoolBuildError) -> Error {
    move |error| Error::Runtime(format!("cannot start {threads} threads: {error}"))
}
