//! What commands read and write: files by name or pattern, standard input and output.

use std::io::{Read, Write};
use std::path::{Path, PathBuf};
use std::{fs, io};

use crate::cli::{Error, Session, check_output, write_atomically};
use crate::container::{self, Limits, SceneFile};

/// The name of standard input and output.
pub(super) const STANDARD: &str = "-";

/// Files to read.
#[derive(Clone, Debug, clap::Args)]
pub(super) struct Inputs {
    /// Scene files, patterns of them, or - for standard input
    #[arg(required = true, value_name = "INPUT")]
    inputs: Vec<String>,
    #[command(flatten)]
    pub(super) limits: LimitArgs,
}

/// What a stranger's file may cost.
#[derive(Clone, Copy, Debug, clap::Args)]
pub(super) struct LimitArgs {
    /// Memory that decoding a file may take, in MiB
    #[arg(long, value_name = "MIB", default_value_t = Limits::default().memory >> 20)]
    memory: u64,
}

impl LimitArgs {
    pub(super) fn limits(self) -> Limits {
        Limits { memory: self.memory.saturating_mul(1 << 20) }
    }
}

impl Inputs {
    /// The files' names, patterns resolved; a pattern that fits nothing is an error.
    pub(super) fn paths(&self) -> Result<Vec<PathBuf>, Error> {
        let mut paths = Vec::new();
        for input in &self.inputs {
            // A file of that very name comes before what a pattern means.
            if input == STANDARD || Path::new(input).exists() || !input.contains(['*', '?', '[']) {
                paths.push(input.into());
                continue;
            }
            let before = paths.len();
            let found = glob::glob(input).map_err(|e| Error::Usage(format!("{input}: not a pattern: {e}")))?;
            for path in found {
                paths.push(path.map_err(|e| Error::Io(e.to_string()))?);
            }
            if paths.len() == before {
                return Err(Error::Io(format!("{input}: no file fits this pattern")));
            }
        }
        Ok(paths)
    }
}

/// The bytes of a file, or of standard input.
pub(super) fn read_bytes(path: &Path) -> Result<Vec<u8>, Error> {
    if path == Path::new(STANDARD) {
        let mut bytes = Vec::new();
        let read = io::stdin().lock().read_to_end(&mut bytes);
        return read.map(|_| bytes).map_err(|e| Error::Io(format!("standard input: cannot read it: {e}")));
    }
    fs::read(path).map_err(Error::io("read", path))
}

/// What a file holds, and its bytes.
pub(super) fn read(path: &Path, limits: Limits) -> Result<(SceneFile, Vec<u8>), Error> {
    let bytes = read_bytes(path)?;
    let document = container::decode_scene_file(&bytes, limits).map_err(|e| Error::container(path, e))?;
    Ok((document, bytes))
}

/// Where results go: a file for one input, a folder for several.
pub(super) struct Outputs {
    output: PathBuf,
    is_folder: bool,
    force: bool,
    dry_run: bool,
}

impl Outputs {
    /// For `inputs` that are written to `output`; checks early that they may be.
    pub(super) fn new(inputs: &[PathBuf], output: &Path, dry_run: bool, session: &Session) -> Result<Self, Error> {
        let is_folder = output.is_dir() || inputs.len() > 1;
        if is_folder && output == Path::new(STANDARD) {
            return Err(Error::Usage("-: expected one input for standard output, found several".into()));
        }
        if is_folder && !output.is_dir() {
            let message = format!("{}: expected a folder for several inputs, found none", output.display());
            return Err(Error::Usage(message));
        }
        let outputs = Self { output: output.into(), is_folder, force: session.force, dry_run };
        if !dry_run {
            let mut seen = std::collections::HashSet::new();
            for input in inputs {
                let path = outputs.path_of(input);
                if !seen.insert(path.clone()) {
                    return Err(Error::Usage(format!(
                        "{}: expected one input of this name, found two",
                        path.display()
                    )));
                }
                if path != Path::new(STANDARD) {
                    check_output(&path, outputs.force)?;
                }
            }
        }
        Ok(outputs)
    }

    /// Where the result for `input` goes.
    pub(super) fn path_of(&self, input: &Path) -> PathBuf {
        if !self.is_folder {
            return self.output.clone();
        }
        let stem = if input == Path::new(STANDARD) { "stdin".as_ref() } else { input.file_stem().unwrap_or_default() };
        let mut name = stem.to_owned();
        name.push(".strivec");
        self.output.join(name)
    }

    /// Writes the result for `input`, unless it is only to be said what would be.
    pub(super) fn write(&self, input: &Path, bytes: &[u8]) -> Result<PathBuf, Error> {
        let path = self.path_of(input);
        if self.dry_run {
            return Ok(path);
        }
        if path == Path::new(STANDARD) {
            let mut stdout = io::stdout().lock();
            let written = stdout.write_all(bytes).and_then(|()| stdout.flush());
            written.map_err(|e| Error::Io(format!("standard output: cannot write to it: {e}")))?;
        } else {
            write_atomically(&path, bytes, self.force)?;
        }
        Ok(path)
    }

    /// Whether standard output is taken by a file.
    pub(super) fn takes_standard_output(&self) -> bool {
        self.output == Path::new(STANDARD) && !self.dry_run
    }
}
