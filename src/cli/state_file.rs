//! The file with which an interrupted run resumes.

use std::path::Path;
use std::sync::atomic::AtomicBool;

use super::observer::ConsoleObserver;
use super::{Error, Session, write_atomically};
use crate::container::{self, EncodeOptions, Encoding};
use crate::model::Scene;
pub(super) use crate::recipe::beside;
use crate::recipe::{self, CheckpointFile};
use crate::train::{Checkpoint, CheckpointError, GrowState, Trainer};

/// The state of an unfinished run that writes a scene file.
pub(super) struct StateFile(CheckpointFile);

impl StateFile {
    /// The file `named`, or OUTPUT.state, which a run that does not `resume` must not find, unless it overwrites.
    ///
    /// # Errors
    ///
    /// If there is one, or it could not be written.
    pub(super) fn new(named: Option<&Path>, output: &Path, resume: bool, session: &Session) -> Result<Self, Error> {
        let file = named.map_or_else(|| CheckpointFile::beside(output), CheckpointFile::new);
        if !resume {
            file.check_new(session.force)?;
        }
        Ok(Self(file))
    }

    /// A training's checkpoint, and its scene.
    pub(super) fn read_training(&self) -> Result<(Checkpoint, Scene), Error> {
        Ok(self.0.read()?)
    }

    /// A growing's state, and its scene.
    pub(super) fn read_growing(&self) -> Result<(GrowState, Scene), Error> {
        read(&self.0.path, GrowState::from_bytes)
    }

    /// Writes `bytes`, those of `scene`'s own file, as `state` packs them.
    pub(super) fn write(&self, scene: &Scene, state: impl FnOnce(&[u8]) -> Vec<u8>) -> Result<(), Error> {
        // 32-bit factors, so that the resumed run is byte-identical; weak compression, because it is fast.
        let options = EncodeOptions { zstd_level: Some(1), ..EncodeOptions::uniform(Encoding::F32) };
        let scene = container::encode(scene, &options)
            .map_err(|e| Error::Runtime(format!("{}: {e}", self.0.path.display())))?;
        write_atomically(&self.0.path, &state(&scene), true)
    }

    /// Removes the file of a finished run.
    pub(super) fn remove(&self) -> Result<(), Error> {
        Ok(self.0.remove()?)
    }

    /// The error of a run that was interrupted after `what`.
    pub(super) fn interrupted(&self, what: &str) -> Error {
        Error::Runtime(format!("interrupted after {what}; --resume continues from {}", self.0.path.display()))
    }

    /// The error of a state that does not fit.
    pub(super) fn refused(&self, error: &CheckpointError) -> Error {
        Error::malformed(&self.0.path)(error)
    }
}

/// The checkpoint file `path` of an unfinished training, and its scene.
pub(super) fn read_state(path: &Path) -> Result<(Checkpoint, Scene), Error> {
    Ok(CheckpointFile::new(path).read()?)
}

/// A state and its scene's own file from bytes.
type Parse<S> = fn(&[u8]) -> Result<(S, Vec<u8>), CheckpointError>;

/// The state in the file `path`, read by `parse`, and its scene.
fn read<S>(path: &Path, parse: Parse<S>) -> Result<(S, Scene), Error> {
    let bytes = std::fs::read(path).map_err(Error::io("read", path))?;
    let (state, scene) = parse(&bytes).map_err(Error::malformed(path))?;
    Ok((state, container::decode(&scene).map_err(Error::malformed(path))?))
}

/// The steps of `trainer` that are left, with progress on the console. The checkpoint is written to `state` every so many
/// steps, and when the run is interrupted.
pub(super) fn run_steps(
    trainer: &mut Trainer<'_>,
    state: &StateFile,
    checkpoint_every: Option<u64>,
    interrupted: &AtomicBool,
    session: &Session,
) -> Result<(), Error> {
    let checkpoint = CheckpointFile { every: checkpoint_every, ..state.0.clone() };
    let mut observer = ConsoleObserver::new(&session.console, interrupted);
    Ok(recipe::run_steps(trainer, Some(&checkpoint), &mut observer)?)
}
