//! The command `strivec`: one file per command, each with its arguments and one `run`.
//!
//! Results go to standard output, progress and messages to standard error. Errors of the layers below become one
//! sentence and an exit code here ([`Error`]); nothing below this layer prints or uses clap.
#![forbid(unsafe_code)]

mod approximations;
mod backend;
pub mod bench;
mod camera_path;
mod clap_error;
mod compare;
mod console;
mod dataset;
mod demo;
mod error;
mod eval;
mod evaluation;
mod export;
mod host;
mod import;
mod info;
mod named_value;
mod numbers;
mod observer;
mod output;
pub mod pack;
mod picture_size;
mod plan;
mod plots;
mod pose;
mod prior;
mod progress;
mod quantity;
mod removed;
mod render;
mod scale_table;
mod scene_file;
mod session;
mod settings;
mod shell;
mod shrink;
mod state_file;
mod synth;
mod table;
mod time_left;
mod trade;
mod train;
mod training_curve;
pub mod version;
mod video;
mod view;
mod view_selection;
mod viewpoints;
mod watch;

use std::ffi::OsString;
use std::process::ExitCode;

use clap::{CommandFactory, FromArgMatches as _, Parser, Subcommand};

use self::version::version;
pub use clap_error::print_clap_error;
pub use error::Error;
pub use host::{Call, Host};
pub use info::info_of;
pub use output::{check_output, write_atomically};
use session::{Context, Globals, run_call, run_command};

const EXIT_CODES: &str = "\
Exit codes: 0 done, 1 usage, 2 input or output, 3 malformed input, 4 interrupted or any other failure, 5 unsupported file or too little memory.

Results go to standard output, progress and messages to standard error.";

/// Commands that the list of commands leaves out.
const FOR_DEVELOPERS: [&str; 4] = ["synth", "bench", "completions", "man"];

/// Sparse tri-vector radiance fields: train, render and measure scenes
#[derive(Debug, Parser)]
#[command(name = "strivec", version = version(), after_help = EXIT_CODES, arg_required_else_help = true)]
struct Cli {
    #[command(flatten)]
    globals: Globals,
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Make a small synthetic dataset, train a scene on it and evaluate it
    Demo(demo::Args),
    /// Compute camera poses of photographs or of a video by COLMAP
    Pose(pose::Args),
    /// Train a scene from photographs
    Train(train::Args),
    /// Remove the parameters that a scene needs least
    Shrink(shrink::Args),
    /// Estimate size, memory and time of a training
    Plan(plan::Args),
    /// Render pictures or a video of a scene
    Render(render::Args),
    /// Write a scene as a mesh, points, splats or a grid for other programs
    Export(export::Args),
    /// Turn meshes, point clouds, grids and octrees into a prior (occupied cells)
    Prior(Box<prior::Args>),
    /// Turn a checkpoint of TensoRF into a scene
    Import(import::Args),
    /// Print what was understood of a dataset
    Dataset(dataset::Args),
    /// Compare a scene's pictures with photographs
    Eval(eval::Args),
    /// Compare several scenes with each other over the same photographs
    Compare(compare::Args),
    /// Measure speed against quality and store render settings in the file
    Trade(trade::Args),
    /// Print the contents of scene files
    Info(info::Args),
    /// Make a synthetic dataset with exact geometry
    Synth(synth::Args),
    /// Measure the speed of training, rendering and files
    Bench(bench::Args),
    /// Open scenes in the desktop player
    View(view::Args),
    /// Print a completion script for a shell
    Completions(shell::CompletionsArgs),
    /// Write man pages of strivec and strivec-pack
    Man(shell::ManArgs),
}

/// Runs the command in the process's arguments and returns its exit code.
pub fn main() -> ExitCode {
    run_command("strivec", parsed(std::env::args_os()), run)
}

/// Runs the command of `strivec` that `arguments` name, without the program's name, within another program. Returns its results:
/// JSON, but for commands that print text in any case.
///
/// # Errors
///
/// The errors of the command; [`Error::Usage`] for arguments that it does not have.
pub fn call(arguments: &[OsString], call: &Call) -> Result<Vec<String>, Error> {
    let words = std::iter::once(OsString::from("strivec")).chain(arguments.iter().cloned());
    run_call(parsed(words), call, run)
}

/// The global options and the command that `words` name.
fn parsed(words: impl IntoIterator<Item = OsString>) -> Result<(Globals, Command), clap::Error> {
    let cli = removed::parsed(command().try_get_matches_from(words)).and_then(|m| Cli::from_arg_matches(&m))?;
    Ok((cli.globals, cli.command))
}

/// The command line, with help that is short: commands for developers come last, and the short help of a command leaves
/// out the options that all have.
fn command() -> clap::Command {
    let mut command = Cli::command();
    let about = |name: &str| command.find_subcommand(name).and_then(clap::Command::get_about).map(ToString::to_string);
    let rows: Vec<_> =
        FOR_DEVELOPERS.iter().map(|name| format!("  {name:<11}  {}\n", about(name).unwrap_or_default())).collect();
    command.build();
    command.after_help(format!("For developers:\n{}\n{EXIT_CODES}", rows.concat())).mut_subcommands(|sub| {
        let is_hidden = FOR_DEVELOPERS.contains(&sub.get_name());
        with_short_help(sub).hide(is_hidden)
    })
}

/// `command` and those below it without the options of all commands in their short help.
fn with_short_help(command: clap::Command) -> clap::Command {
    let shorter = |arg: clap::Arg| if arg.is_global_set() { arg.hide_short_help(true) } else { arg };
    command.mut_args(shorter).mut_subcommands(with_short_help)
}

fn run(command: &Command, session: &Context) -> Result<(), Error> {
    match command {
        Command::Demo(args) => demo::run(args, session),
        Command::Pose(args) => pose::run(args, session),
        Command::Train(args) => train::run(args, session),
        Command::Shrink(args) => shrink::run(args, session),
        Command::Plan(args) => plan::run(args, session),
        Command::Render(args) => render::run(args, session),
        Command::Export(args) => export::run(args, session),
        Command::Prior(args) => prior::run(args, session),
        Command::Import(args) => import::run(args, session),
        Command::Dataset(args) => dataset::run(args, session),
        Command::Eval(args) => eval::run(args, session),
        Command::Compare(args) => compare::run(args, session),
        Command::Trade(args) => trade::run(args, session),
        Command::Info(args) => info::run(args, session),
        Command::Synth(args) => synth::run(args, session),
        Command::Bench(args) => bench::run(args, session),
        Command::View(args) => view::run(args),
        Command::Completions(args) => shell::completions(args, Cli::command(), session),
        Command::Man(args) => shell::man(args, [Cli::command(), pack::command()], session),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_short_help_of_training_fits_on_a_screen() {
        let mut command = command().term_width(100);
        let train = command.find_subcommand_mut("train").unwrap();
        let help = train.render_help().to_string();
        assert!(help.lines().count() <= 50, "{} lines:\n{help}", help.lines().count());
        assert!(!help.contains("--threads") && train.render_long_help().to_string().contains("--threads"), "{help}");
    }

    #[test]
    fn commands_for_developers_come_last() {
        let help = command().render_help().to_string();
        let [usual, developers] = help.split("For developers:").collect::<Vec<_>>()[..] else { panic!("{help}") };
        for name in FOR_DEVELOPERS {
            let row = format!("\n  {name} ");
            assert!(!usual.contains(&row) && developers.contains(&row), "{help}");
        }
        assert!(usual.contains("--threads"), "{help}");
    }

    #[test]
    fn the_arguments_are_consistent_and_every_command_has_an_example() {
        let mut command = Cli::command();
        command.clone().debug_assert();
        for sub in command.get_subcommands_mut() {
            let name = sub.get_name().to_owned();
            let help = sub.get_after_help().map(ToString::to_string).unwrap_or_default();
            let example = help.lines().find(|line| line.trim_start().starts_with("strivec"));
            let example = example.unwrap_or_else(|| panic!("{name} has no example")).trim();
            // A redirection is the shell's.
            let words = example.split_whitespace().take_while(|word| *word != ">");
            assert_eq!(words.clone().nth(1), Some(name.as_str()), "{example}");
            parsed(words.map(OsString::from)).unwrap_or_else(|e| panic!("{example}: {e}"));
        }
    }
}
