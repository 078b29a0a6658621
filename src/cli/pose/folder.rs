//! The folder of a capture: its files, and `pose.json`, which records finished stages with their inputs.
//!
//! The file makes a run resumable. It is written when pictures are first placed and after each stage.

use std::collections::BTreeMap;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use clap::ValueEnum;
use serde::{Deserialize, Serialize};

use super::super::output::make_folder;
use super::super::{Error, write_atomically};

/// COLMAP's database of features and matches.
pub(super) const DATABASE: &str = "database.db";
/// The pictures.
pub(super) const IMAGES: &str = "images";
/// The names of the pictures, one per line.
pub(super) const PICTURES: &str = "pictures.txt";
/// The models, the largest in `0`.
pub(super) const SPARSE: &str = "sparse";
/// The models as COLMAP writes them, until they are complete and sorted.
pub(super) const UNSORTED: &str = "sparse.partial";
/// The programs' outputs.
const LOGS: &str = "logs";
const STATE: &str = "pose.json";
const VERSION: u32 = 1;

/// Options by their flags, and what identifies the pictures.
pub(super) type Inputs = BTreeMap<String, String>;

/// The stages, in order.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, ValueEnum)]
#[serde(rename_all = "lowercase")]
pub(super) enum PoseStage {
    Pictures,
    Features,
    Matching,
    Mapping,
}

/// A finished stage.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct FinishedStage {
    pub(super) stage: PoseStage,
    /// Wall time of the run that finished the stage.
    pub(super) seconds: f64,
    pub(super) found: String,
}

/// The content of `pose.json`.
#[derive(Debug, Serialize, Deserialize)]
struct PoseState {
    version: u32,
    inputs: Inputs,
    /// Names of the pictures that were placed in `images`.
    placed: Vec<String>,
    stages: Vec<FinishedStage>,
}

/// The folder of a capture.
pub(super) struct CaptureFolder {
    folder: PathBuf,
    state: PoseState,
}

impl CaptureFolder {
    /// Opens or begins the capture in `folder`; `source` may be inside. With `force` a capture begins anew.
    ///
    /// # Errors
    ///
    /// If the folder holds anything but a capture and `source`, or a capture of other inputs.
    pub(super) fn open(folder: &Path, source: &Path, inputs: Inputs, force: bool) -> Result<Self, Error> {
        let file = folder.join(STATE);
        let empty = PoseState { version: VERSION, inputs: inputs.clone(), placed: Vec::new(), stages: Vec::new() };
        let bytes = match fs::read(&file) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => {
                check_is_free(folder, source)?;
                make_folder(folder)?;
                return Ok(Self { folder: folder.to_path_buf(), state: empty });
            }
            other => other.map_err(Error::io("read", &file))?,
        };
        let state: PoseState = serde_json::from_slice(&bytes).map_err(Error::malformed(&file))?;
        if state.version != VERSION {
            let message = format!("{}: state of version {}, not {VERSION}", file.display(), state.version);
            return Err(Error::Unsupported(message));
        }
        let mut capture = Self { folder: folder.to_path_buf(), state };
        if force {
            capture.clear(source)?;
            capture.state = empty;
        } else if let Some(difference) = difference(&capture.state.inputs, &inputs) {
            let folder = folder.display();
            let message =
                format!("{folder}: the capture was begun with other inputs: {difference}; --force begins anew");
            return Err(Error::Usage(message));
        }
        Ok(capture)
    }

    /// The path of the file or folder `name` of the capture.
    pub(super) fn path(&self, name: &str) -> PathBuf {
        self.folder.join(name)
    }

    pub(super) fn folder(&self) -> &Path {
        &self.folder
    }

    /// The log of `stage`; its folder is created if absent.
    pub(super) fn log(&self, name: &str) -> Result<PathBuf, Error> {
        let logs = self.folder.join(LOGS);
        make_folder(&logs)?;
        Ok(logs.join(format!("{name}.log")))
    }

    /// The record of `stage`, if it is finished.
    pub(super) fn finished(&self, stage: PoseStage) -> Option<&FinishedStage> {
        self.state.stages.iter().find(|finished| finished.stage == stage)
    }

    /// The finished stages, in order.
    pub(super) fn stages(&self) -> &[FinishedStage] {
        &self.state.stages
    }

    /// Records that pictures named `names` are about to be placed in `images`.
    pub(super) fn place(&mut self, names: impl IntoIterator<Item = String>) -> Result<(), Error> {
        self.state.placed = names.into_iter().collect();
        self.write()
    }

    /// Records a finished stage.
    pub(super) fn finish(&mut self, finished: FinishedStage) -> Result<(), Error> {
        self.state.stages.push(finished);
        self.write()
    }

    fn write(&self) -> Result<(), Error> {
        let file = self.folder.join(STATE);
        let json = serde_json::to_vec_pretty(&self.state).map_err(|e| Error::Runtime(format!("JSON: {e}")))?;
        write_atomically(&file, &json, true)
    }

    /// Removes what a run has written, and no other file; keeps the pictures if they are now the `source`.
    fn clear(&self, source: &Path) -> Result<(), Error> {
        let images = self.folder.join(IMAGES);
        let is_source = fs::canonicalize(&images).is_ok_and(|images| {
            let source = fs::canonicalize(source);
            source.is_ok_and(|source| source.starts_with(images))
        });
        for name in self.state.placed.iter().filter(|_| !is_source) {
            remove(&images.join(Path::new(name).file_name().unwrap_or_default()), |path| fs::remove_file(path))?;
        }
        for name in [DATABASE, "database.db-wal", "database.db-shm", PICTURES] {
            remove(&self.folder.join(name), |path| fs::remove_file(path))?;
        }
        for name in [SPARSE, UNSORTED, LOGS] {
            remove(&self.folder.join(name), |path| fs::remove_dir_all(path))?;
        }
        remove(&self.folder.join(STATE), |path| fs::remove_file(path))
    }
}

/// Removes `path` if it exists.
pub(super) fn remove(path: &Path, how: impl FnOnce(&Path) -> io::Result<()>) -> Result<(), Error> {
    match how(path) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(()),
        other => other.map_err(Error::io("remove", path)),
    }
}

/// Errors unless `folder` is absent, or holds nothing but hidden files and what contains `source`.
fn check_is_free(folder: &Path, source: &Path) -> Result<(), Error> {
    let entries = match fs::read_dir(folder) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(()),
        other => other.map_err(Error::io("read", folder))?,
    };
    let source = fs::canonicalize(source).map_err(Error::io("read", source))?;
    if fs::canonicalize(folder).map_err(Error::io("read", folder))? == source {
        let message = format!(
            "{}: the folder of the photographs cannot be the output; move them to its subfolder images",
            folder.display()
        );
        return Err(Error::Usage(message));
    }
    for entry in entries {
        let entry = entry.map_err(Error::io("read", folder))?;
        let holds_source = fs::canonicalize(entry.path()).is_ok_and(|path| source.starts_with(path));
        if !holds_source && !entry.file_name().as_encoded_bytes().starts_with(b".") {
            let message = format!(
                "{}: the output folder must be new, empty or a capture of this command, but holds {}",
                folder.display(),
                entry.file_name().display()
            );
            return Err(Error::Usage(message));
        }
    }
    Ok(())
}

/// The differences between the inputs of two runs; `None` if they are equal.
fn difference(before: &Inputs, now: &Inputs) -> Option<String> {
    let mut names: Vec<&String> = before.keys().chain(now.keys()).collect();
    names.sort();
    names.dedup();
    let value = |inputs: &Inputs, name: &String| inputs.get(name).map_or("absent".to_owned(), Clone::clone);
    let changed: Vec<String> = (names.into_iter())
        .filter(|name| before.get(*name) != now.get(*name))
        .map(|name| format!("{name} was {}, now {}", value(before, name), value(now, name)))
        .collect();
    if changed.is_empty() { None } else { Some(changed.join("; ")) }
}
