//! The file with which an interrupted run resumes.

use std::path::Path;
use std::sync::atomic::AtomicBool;

use super::observer::ConsoleObserver;
use super::{Context, Error};
use strivec_format::model::Scene;
use strivec_recipe as recipe;
use strivec_recipe::CheckpointFile;
pub(super) use strivec_recipe::beside;
use strivec_train::{Checkpoint, Trainer};

/// The state of an unfinished run that writes a scene file.
pub(super) struct StateFile(CheckpointFile);

impl StateFile {
    /// The file `named`, or OUTPUT.state, which a run that does not `resume` must not find, unless it overwrites.
    ///
    /// # Errors
    ///
    /// If there is one, or it could not be written.
    pub(super) fn new(named: Option<&Path>, output: &Path, resume: bool, session: &Context) -> Result<Self, Error> {
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

    /// Removes the file of a finished run.
    pub(super) fn remove(&self) -> Result<(), Error> {
        Ok(self.0.remove()?)
    }
}

/// The checkpoint file `path` of an unfinished training, and its scene.
pub(super) fn read_state(path: &Path) -> Result<(Checkpoint, Scene), Error> {
    Ok(CheckpointFile::new(path).read()?)
}

/// The steps of `trainer` that are left, with progress on the console. The checkpoint is written to `state` every so many
/// steps, and when the run is interrupted.
pub(super) fn run_steps(
    trainer: &mut Trainer<'_>,
    state: &StateFile,
    checkpoint_every: Option<u64>,
    interrupted: &AtomicBool,
    session: &Context,
) -> Result<(), Error> {
    let checkpoint = CheckpointFile { every: checkpoint_every, ..state.0.clone() };
    let mut observer = ConsoleObserver::new(&session.console, interrupted);
    Ok(recipe::run_steps(trainer, Some(&checkpoint), &mut observer)?)
}
