//! The command `strivec-pack`: scene files made small, looked at, checked, compared and changed.

mod convert;
mod diff;
mod edit;
mod encoding;
mod extract;
mod info;
mod input;
mod notes;
mod package;
mod schema;
mod showing;
mod verify;

use std::process::ExitCode;

use clap::{Parser, Subcommand};

pub(super) use package::{JUDGED, PROBED};

use super::{Globals, run_command, version};

const EXIT_CODES: &str = "\
Exit codes: 0 done, 1 usage, 2 input or output, 3 malformed input, 4 anything else, 5 not supported, 7 differs.
INPUT may be a pattern such as 'scenes/*.strivec', or - for standard input; OUTPUT may be - for standard output.
Results go to standard output (with --json as format-spec/strivec-pack.schema.json says), progress and messages to
standard error.";

/// Scene files: made small, looked at, checked, compared, changed.
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
    /// Make trained scenes as small as their pictures allow
    Pack(package::Args),
    /// Say what is in a file, and what takes its bytes
    Info(info::Args),
    /// Check that files are whole, undamaged and valid, and that pictures come out right
    Verify(verify::Args),
    /// Say how two files differ
    Diff(diff::Args),
    /// Write files in another encoding, and change nothing else
    Convert(convert::Args),
    /// Drop what hardly any picture shows
    Prune(edit::PruneArgs),
    /// Keep what is in a box
    Crop(edit::CropArgs),
    /// Move, turn or scale a scene in its dataset's space
    Transform(edit::TransformArgs),
    /// Take a file apart: a folder of arrays and a description
    Extract(extract::ExtractArgs),
    /// Put such a folder together again
    Assemble(extract::AssembleArgs),
    /// Show notes, or change them
    Notes(notes::Args),
    /// Print the JSON schema of what --json prints
    Schema,
}

/// Runs the command that the process's arguments name, and reports how it ended.
pub fn main() -> ExitCode {
    run_command(
        "strivec-pack",
        Cli::try_parse().map(|cli| (cli.globals, cli.command)),
        |command, session| match command {
            Command::Pack(args) => package::run(args, session),
            Command::Info(args) => info::run(args, session),
            Command::Verify(args) => verify::run(args, session),
            Command::Diff(args) => diff::run(args, session),
            Command::Convert(args) => convert::run(args, session),
            Command::Prune(args) => edit::prune(args, session),
            Command::Crop(args) => edit::crop(args, session),
            Command::Transform(args) => edit::transform(args, session),
            Command::Extract(args) => extract::extract(args, session),
            Command::Assemble(args) => extract::assemble(args, session),
            Command::Notes(args) => notes::run(args, session),
            Command::Schema => schema::run(session),
        },
    )
}
