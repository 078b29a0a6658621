//! The file with which an interrupted run resumes.

use std::path::{Path, PathBuf};

use super::output::remove_file;
use super::{Error, Session, check_output, write_atomically};
use crate::container::{self, EncodeOptions, Encoding};
use crate::model::Scene;
use crate::train::{Checkpoint, Trainer};

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

    /// Writes the checkpoint of `trainer`, with the scene's own file in it.
    pub(super) fn write_training(&self, trainer: &Trainer<'_>) -> Result<(), Error> {
        // 32-bit factors, so that the resumed run is byte-identical; weak compression, because it is fast.
        let options = EncodeOptions { zstd_level: Some(1), ..EncodeOptions::uniform(Encoding::F32) };
        let scene = container::encode(&trainer.unrounded_scene(), &options)
            .map_err(|e| Error::Runtime(format!("{}: {e}", self.0.display())))?;
        write_atomically(&self.0, &trainer.checkpoint().to_bytes(&scene), true)
    }

    /// Removes the file of a finished run.
    pub(super) fn remove(&self) -> Result<(), Error> {
        remove_file(&self.0)
    }

    /// The error of a run that was interrupted after `what`.
    pub(super) fn interrupted(&self, what: &str) -> Error {
        Error::Runtime(format!("interrupted after {what}; --resume continues from {}", self.0.display()))
    }
}

/// The checkpoint file `path` of an unfinished training, and its scene.
pub(super) fn read_state(path: &Path) -> Result<(Checkpoint, Scene), Error> {
    let bytes = std::fs::read(path).map_err(Error::io("read", path))?;
    let (checkpoint, scene) = Checkpoint::from_bytes(&bytes).map_err(Error::malformed(path))?;
    Ok((checkpoint, container::decode(&scene).map_err(Error::malformed(path))?))
}

/// The path of `output` with `ending` behind it.
pub(super) fn beside(output: &Path, ending: &str) -> PathBuf {
    let mut name = output.as_os_str().to_owned();
    name.push(ending);
    name.into()
}
