//! `strivec completions` and `strivec man`: completion scripts and man pages, generated from the arguments.

use std::path::{Path, PathBuf};

use clap_complete::Shell;
use serde::Serialize;

use super::output::{check_outputs, make_folder};
use super::table::plural;
use super::{Context, Error, pack, write_atomically};
use strivec_format::escape::escaped_path;

const COMPLETIONS_EXAMPLES: &str = "\
Examples:
  strivec completions bash > ~/.local/share/bash-completion/completions/strivec
  strivec completions zsh --program strivec-pack > ~/.zfunc/_strivec-pack";
const MAN_EXAMPLES: &str = "\
Examples:
  strivec man ~/.local/share/man/man1";

/// Programs with completions.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
enum Program {
    Strivec,
    StrivecPack,
}

/// The arguments of `strivec completions`.
#[derive(Debug, clap::Args)]
#[command(after_help = COMPLETIONS_EXAMPLES)]
pub(super) struct CompletionsArgs {
    /// Shell that the script is for
    #[arg(value_enum)]
    shell: Shell,
    /// Program to complete
    #[arg(long, value_enum, default_value = "strivec")]
    program: Program,
}

/// Prints a completion script; `strivec` is this program's command.
pub(super) fn completions(args: &CompletionsArgs, strivec: clap::Command, session: &Context) -> Result<(), Error> {
    let mut command = match args.program {
        Program::Strivec => strivec,
        Program::StrivecPack => pack::command(),
    };
    let name = command.get_name().to_owned();
    let mut script = Vec::new();
    clap_complete::generate(args.shell, &mut command, name, &mut script);
    session.console.print(&String::from_utf8_lossy(&script))
}

/// The arguments of `strivec man`.
#[derive(Debug, clap::Args)]
#[command(after_help = MAN_EXAMPLES)]
pub(super) struct ManArgs {
    /// Folder for the pages, one per command; created if absent
    #[arg(value_name = "DIR")]
    folder: PathBuf,
}

/// The result, as `--json` prints it.
#[derive(Serialize)]
struct ManualPages<'a> {
    folder: &'a Path,
    files: Vec<PathBuf>,
}

/// Writes a man page for each of `programs` and each of their commands.
pub(super) fn man(args: &ManArgs, programs: [clap::Command; 2], session: &Context) -> Result<(), Error> {
    let mut pages = Vec::new();
    for mut program in programs {
        program.build();
        add_pages(&program, &mut pages)?;
    }
    make_folder(&args.folder)?;
    let files: Vec<PathBuf> = pages.iter().map(|(name, _)| args.folder.join(name)).collect();
    let _reserved = check_outputs(&files, session.force)?;
    for (file, (_, page)) in files.iter().zip(&pages) {
        write_atomically(file, page, session.force)?;
    }
    session.console.result(&ManualPages { folder: &args.folder, files }, |pages| {
        format!("{}: {}", escaped_path(pages.folder), plural(pages.files.len(), "man page"))
    })
}

/// The pages of `command` and, recursively, of its subcommands: file names and contents.
fn add_pages(command: &clap::Command, pages: &mut Vec<(String, Vec<u8>)>) -> Result<(), Error> {
    let man = clap_mangen::Man::new(command.clone().display_name(command_name(command)));
    let mut page = Vec::new();
    man.render(&mut page).map_err(|e| Error::Runtime(format!("man page: {e}")))?;
    pages.push((format!("{}.1", command_name(command)), page));
    let is_listed = |sub: &&clap::Command| !sub.is_hide_set() && sub.get_name() != "help";
    command.get_subcommands().filter(is_listed).try_for_each(|sub| add_pages(sub, pages))
}

/// The command's words with hyphens, such as `strivec-bench-render`.
fn command_name(command: &clap::Command) -> String {
    let name = command.get_bin_name().unwrap_or(command.get_name());
    name.replace(' ', "-")
}
