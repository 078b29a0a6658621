//! Inputs and outputs of commands: files by name or pattern, standard input and output.

use std::io::{self, IsTerminal, Write};
use std::path::{Path, PathBuf};

use crate::console::Console;
use crate::output::{check_scene_name, write_or_keep};
use crate::{Context, Error, check_output, scene_file};
use strivec_format::container;
use strivec_format::container::{Limits, SceneFile};
use strivec_recipe::Reservation;

/// The name of standard input and output.
pub(super) const STANDARD: &str = "-";

/// Files to read.
#[derive(Clone, Debug, clap::Args)]
pub(super) struct Inputs {
    /// Scene files, patterns, or - for standard input
    #[arg(required = true, value_name = "INPUT")]
    inputs: Vec<String>,
    #[command(flatten)]
    pub(super) limits: LimitArgs,
}

/// Resource limits for untrusted files.
#[derive(Clone, Copy, Debug, clap::Args)]
pub(super) struct LimitArgs {
    /// Memory limit for a decoded file, in MiB [default: 512, and 64 for each MiB of the file, at most 4096]
    #[arg(long, value_name = "MIB")]
    memory: Option<u64>,
}

impl LimitArgs {
    /// The limits for a file of `length` bytes.
    pub(super) fn of_file(self, length: usize) -> Limits {
        match self.memory {
            Some(mebibytes) => Limits { memory: mebibytes.saturating_mul(1 << 20) },
            None => Limits::of_file(length as u64),
        }
    }
}

impl Inputs {
    /// Results need a folder: there are several inputs, or a pattern, however many files match it.
    pub(super) fn are_several(&self) -> bool {
        self.inputs.len() > 1 || self.inputs.iter().any(|input| is_pattern(input))
    }

    /// The files' names, patterns resolved; a pattern without a match is an error.
    pub(super) fn paths(&self) -> Result<Vec<PathBuf>, Error> {
        let mut paths = Vec::new();
        for input in &self.inputs {
            if !is_pattern(input) {
                paths.push(input.into());
                continue;
            }
            let before = paths.len();
            let found = glob::glob(input).map_err(|e| Error::Usage(format!("{input}: not a pattern: {e}")))?;
            for path in found {
                paths.push(path.map_err(|e| Error::Io(e.to_string()))?);
            }
            if paths.len() == before {
                return Err(Error::Io(format!("{input}: no file matches this pattern")));
            }
        }
        Ok(paths)
    }
}

/// `input` is a pattern, unless a file has exactly this name.
fn is_pattern(input: &str) -> bool {
    input != STANDARD && !Path::new(input).exists() && input.contains(['*', '?', '['])
}

/// The content of a file, and its bytes. Warns of the sections that were skipped.
pub(super) fn read(path: &Path, limits: LimitArgs, console: &Console) -> Result<(SceneFile, Vec<u8>), Error> {
    let bytes = scene_file::read_bytes(path)?;
    let document =
        container::decode_scene_file(&bytes, limits.of_file(bytes.len())).map_err(|e| Error::container(path, e))?;
    scene_file::warn_of_skipped(path, &document.metadata, console);
    Ok((document, bytes))
}

/// The destination of results: a file for one input, a folder for several inputs or a pattern.
pub(super) struct Outputs {
    output: PathBuf,
    is_folder: bool,
    force: bool,
    dry_run: bool,
    /// The reservation of the first output, for all of them: a system limits the number of open files.
    reserved: Option<Reservation>,
}

impl Outputs {
    /// For `inputs` that are written to `output`, a folder if there are `several`. Checks early that they may be written.
    pub(super) fn new(
        inputs: &[PathBuf],
        several: bool,
        output: &Path,
        dry_run: bool,
        session: &Context,
    ) -> Result<Self, Error> {
        let has_slash = output.to_string_lossy().ends_with(std::path::is_separator);
        let is_folder = several || has_slash || output.is_dir();
        let is_standard = output == Path::new(STANDARD);
        if is_folder && is_standard {
            return Err(Error::Usage("-: standard output takes the result of one input only, not of several".into()));
        }
        if is_standard && !dry_run {
            refuse_terminal(io::stdout().is_terminal())?;
        }
        if is_folder && !output.is_dir() {
            let message = "no such folder; several inputs or a pattern need an existing folder";
            return Err(Error::Usage(format!("{}: {message}", output.display())));
        }
        if !is_folder && !is_standard {
            check_scene_name(output)?;
        }
        let mut outputs = Self { output: output.into(), is_folder, force: session.force, dry_run, reserved: None };
        if !dry_run {
            let mut seen = std::collections::HashSet::new();
            for input in inputs {
                let path = outputs.path_of(input);
                if !seen.insert(path.clone()) {
                    return Err(Error::Usage(format!("{}: two inputs would be written here", path.display())));
                }
                if path != Path::new(STANDARD) {
                    let first = check_output(&path, outputs.force)?;
                    outputs.reserved.get_or_insert(first);
                }
            }
        }
        Ok(outputs)
    }

    /// The file for the result for `input`.
    pub(super) fn path_of(&self, input: &Path) -> PathBuf {
        if !self.is_folder {
            return self.output.clone();
        }
        let stem = if input == Path::new(STANDARD) { "stdin".as_ref() } else { input.file_stem().unwrap_or_default() };
        let mut name = stem.to_owned();
        name.push(".strivec");
        self.output.join(name)
    }

    /// Writes the result for `input`, unless this is a dry run.
    pub(super) fn write(&self, input: &Path, bytes: &[u8]) -> Result<PathBuf, Error> {
        let path = self.path_of(input);
        if self.dry_run {
            return Ok(path);
        }
        if path == Path::new(STANDARD) {
            let mut stdout = io::stdout().lock();
            let written = stdout.write_all(bytes).and_then(|()| stdout.flush());
            match written {
                // The reader has closed the pipe and needs no more.
                Err(error) if error.kind() == io::ErrorKind::BrokenPipe => {}
                other => other.map_err(|e| Error::Io(format!("cannot write to standard output: {e}")))?,
            }
        } else {
            write_or_keep(&path, bytes, self.force)?;
        }
        Ok(path)
    }

    /// The result file goes to standard output.
    pub(super) fn takes_standard_output(&self) -> bool {
        self.output == Path::new(STANDARD) && !self.dry_run
    }
}

/// Errors if standard output is a terminal, which cannot show a binary file.
fn refuse_terminal(is_terminal: bool) -> Result<(), Error> {
    if is_terminal {
        let message = "-: a .strivec file is not written to a terminal; redirect standard output";
        return Err(Error::Usage(message.into()));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_terminal_is_refused_as_output() {
        let error = refuse_terminal(true).unwrap_err();
        assert_eq!(error.exit_code(), 1);
        assert!(error.to_string().contains("redirect standard output"), "{error}");
        assert!(refuse_terminal(false).is_ok());
    }
}
