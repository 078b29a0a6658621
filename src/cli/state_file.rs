//! The file with which an interrupted run resumes.

use std::path::{Path, PathBuf};

use super::output::remove_file;
use super::{Error, Session, check_output, write_atomically};
use crate::container::{self, EncodeOptions, Encoding};
use crate::model::Scene;
use crate::train::{Checkpoint, CheckpointError, GrowState, Trainer};

/// The state of an unfinished run that writes a scene file.
pub(super) struct StateFile(PathBuf);

impl StateFile {
    /// The file `named`, or OUTPUT.state, which a run that does not `resume` must not find, unless it overwrites.
    ///
    /// # Errors
    ///
    /// If there is one, or it could not be written.
    pub(super) fn new(named: Option<&Path>, output: &Path, resume: bool, session: &Session) -> Result<Self, Error> {
        let path = named.map_or_else(|| beside(output, ".state"), Path::to_path_buf);
        if !resume {
            if path.exists() && !session.force {
                let message = "the checkpoint of an interrupted run exists; --resume continues it, --force starts anew";
                return Err(Error::Usage(format!("{}: {message}", path.display())));
            }
            check_output(&path, session.force)?;
        }
        Ok(Self(path))
    }

    /// A training's checkpoint, and its scene.
    pub(super) fn read_training(&self) -> Result<(Checkpoint, Scene), Error> {
        read_state(&self.0)
    }

    /// A growing's state, and its scene.
    pub(super) fn read_growing(&self) -> Result<(GrowState, Scene), Error> {
        read(&self.0, GrowState::from_bytes)
    }

    /// Writes `bytes`, those of `scene`'s own file, as `state` packs them.
    pub(super) fn write(&self, scene: &Scene, state: impl FnOnce(&[u8]) -> Vec<u8>) -> Result<(), Error> {
        // 32-bit factors, so that the resumed run is byte-identical; weak compression, because it is fast.
        let options = EncodeOptions { zstd_level: Some(1), ..EncodeOptions::uniform(Encoding::F32) };
        let scene =
            container::encode(scene, &options).map_err(|e| Error::Runtime(format!("{}: {e}", self.0.display())))?;
        write_atomically(&self.0, &state(&scene), true)
    }

    /// Writes the checkpoint of `trainer`.
    pub(super) fn write_training(&self, trainer: &Trainer<'_>) -> Result<(), Error> {
        self.write(&trainer.unrounded_scene(), |scene| trainer.checkpoint().to_bytes(scene))
    }

    /// Removes the file of a finished run.
    pub(super) fn remove(&self) -> Result<(), Error> {
        remove_file(&self.0)
    }

    /// The error of a run that was interrupted after `what`.
    pub(super) fn interrupted(&self, what: &str) -> Error {
        Error::Runtime(format!("interrupted after {what}; --resume continues from {}", self.0.display()))
    }

    /// The error of a state that does not fit.
    pub(super) fn refused(&self, error: &CheckpointError) -> Error {
        Error::malformed(&self.0)(error)
    }
}

/// The checkpoint file `path` of an unfinished training, and its scene.
pub(super) fn read_state(path: &Path) -> Result<(Checkpoint, Scene), Error> {
    read(path, Checkpoint::from_bytes)
}

/// A state and its scene's own file from bytes.
type Parse<S> = fn(&[u8]) -> Result<(S, Vec<u8>), CheckpointError>;

/// The state in the file `path`, read by `parse`, and its scene.
fn read<S>(path: &Path, parse: Parse<S>) -> Result<(S, Scene), Error> {
    let bytes = std::fs::read(path).map_err(Error::io("read", path))?;
    let (state, scene) = parse(&bytes).map_err(Error::malformed(path))?;
    Ok((state, container::decode(&scene).map_err(Error::malformed(path))?))
}

/// The path of `output` with `ending` behind it.
pub(super) fn beside(output: &Path, ending: &str) -> PathBuf {
    let mut name = output.as_os_str().to_owned();
    name.push(ending);
    name.into()
}
