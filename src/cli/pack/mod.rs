//! The command `strivec-pack`: compress, inspect, verify, compare and edit scene files.

mod conform;
mod convert;
mod diff;
mod edit;
mod encoding;
mod extract;
mod extras;
mod info;
mod input;
mod notes;
mod package;
mod rewriting;
mod schema;
mod verify;

use std::ffi::OsString;
use std::process::ExitCode;

use clap::{CommandFactory, Parser, Subcommand};

use super::session::{Context, Globals, run_call, run_command};
use super::{Call, Error, removed};
use crate::version::version;

const EXIT_CODES: &str = "\
Exit codes: 0 done, 1 usage, 2 input or output, 3 malformed input, 4 any other failure, 5 unsupported file or too little memory, 7 files differ.

INPUT may be a pattern such as 'scenes/*.strivec', or - for standard input. OUTPUT may be - for standard output, and is a \
folder for a pattern or several inputs.

Results go to standard output, progress and messages to standard error. format-spec/strivec-pack.schema.json describes --json.";

/// Compress, inspect, verify, compare and edit scene files
#[derive(Debug, Parser)]
#[command(name = "strivec-pack", version = version(), after_help = EXIT_CODES, arg_required_else_help = true)]
struct Cli {
    #[command(flatten)]
    globals: Globals,
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Compress scenes as far as their pictures allow
    Pack(package::Args),
    /// Print the contents of files and the bytes of each part
    Info(info::Args),
    /// Check that files are complete, undamaged and valid, and that renderers reproduce their probes
    Verify(verify::Args),
    /// Print the error or the numbers that files have for this reader, as the format's conformance suite asks
    Conform(conform::Args),
    /// Compare two files and their pictures
    Diff(diff::Args),
    /// Write files in another encoding, compression, or division into chunks
    Convert(convert::Args),
    /// Drop components that hardly affect any picture
    Prune(edit::PruneArgs),
    /// Keep the tensors in a box, or the coarsest scales
    Crop(edit::CropArgs),
    /// Move, turn or scale a scene in its dataset's space
    Transform(edit::TransformArgs),
    /// Write a scene as a folder of NumPy arrays and a JSON description
    Extract(extract::ExtractArgs),
    /// Write a folder made by `extract` as a scene file
    Assemble(extract::AssembleArgs),
    /// Print or change the notes of a file
    Notes(notes::Args),
    /// Print the JSON schema of --json results
    Schema,
}

/// The clap command, for man pages.
pub(super) fn command() -> clap::Command {
    Cli::command()
}

/// Runs the command in the process's arguments and returns its exit code.
pub fn main() -> ExitCode {
    run_command("strivec-pack", removed::parsed(Cli::try_parse()).map(|cli| (cli.globals, cli.command)), run)
}

/// Runs the command of `strivec-pack` that `arguments` name, without the program's name, within another program. Returns its results:
/// JSON, but for commands that print text in any case.
///
/// # Errors
///
/// As for [`call`](super::call).
pub fn call(arguments: &[OsString], call: &Call) -> Result<Vec<String>, Error> {
    let words = std::iter::once(OsString::from("strivec-pack")).chain(arguments.iter().cloned());
    run_call(removed::parsed(Cli::try_parse_from(words)).map(|cli| (cli.globals, cli.command)), call, run)
}

fn run(command: &Command, session: &Context) -> Result<(), Error> {
    match command {
        Command::Pack(args) => package::run(args, session),
        Command::Info(args) => info::run(args, session),
        Command::Verify(args) => verify::run(args, session),
        Command::Conform(args) => conform::run(args, session),
        Command::Diff(args) => diff::run(args, session),
        Command::Convert(args) => convert::run(args, session),
        Command::Prune(args) => edit::prune(args, session),
        Command::Crop(args) => edit::crop(args, session),
        Command::Transform(args) => edit::transform(args, session),
        Command::Extract(args) => extract::extract(args, session),
        Command::Assemble(args) => extract::assemble(args, session),
        Command::Notes(args) => notes::run(args, session),
        Command::Schema => schema::run(session),
    }
}
