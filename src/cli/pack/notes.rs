//! `strivec-pack notes`.

use std::collections::BTreeMap;
use std::path::PathBuf;

use super::input::{self, LimitArgs, Outputs};
use crate::{Context, Error};
use strivec_format::container;
use strivec_format::escape::escaped;

/// Arguments of `strivec-pack notes`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n  strivec-pack notes lego.strivec --set author=me -o noted.strivec")]
pub(super) struct Args {
    /// Scene file, or - for standard input
    input: PathBuf,
    /// Set this note; can be repeated
    #[arg(long, value_name = "KEY=VALUE", value_parser = note, requires = "output")]
    set: Vec<(String, String)>,
    /// Remove the note of this key; can be repeated
    #[arg(long, value_name = "KEY", requires = "output")]
    remove: Vec<String>,
    /// File to write, or - for standard output
    #[arg(long, short)]
    output: Option<PathBuf>,
    #[command(flatten)]
    limits: LimitArgs,
}

fn note(text: &str) -> Result<(String, String), String> {
    let (key, value) = text.split_once('=').ok_or("expected KEY=VALUE")?;
    if key.is_empty() { Err("expected a key before =".into()) } else { Ok((key.into(), value.into())) }
}

/// Prints notes, or writes a file with others; no other byte of it changes but offsets and checksums.
pub(super) fn run(args: &Args, session: &Context) -> Result<(), Error> {
    let (document, bytes) = input::read(&args.input, args.limits, &session.console)?;
    let mut notes = document.metadata.notes;
    let Some(output) = &args.output else {
        let text = |notes: &BTreeMap<String, String>| {
            notes.iter().map(|(k, v)| format!("{}: {}\n", escaped(k), escaped(v))).collect()
        };
        return session.console.result(&notes, text);
    };
    let outputs = Outputs::new(std::slice::from_ref(&args.input), false, output, false, session)?;
    notes.extend(args.set.iter().cloned());
    args.remove.iter().for_each(|key| drop(notes.remove(key)));
    let changed = container::with_notes(&bytes, &notes).map_err(|e| Error::container(&args.input, e))?;
    outputs.write(&args.input, &changed).map(drop)
}
