//! The result of a training, and its files.

use std::path::{Path, PathBuf};

use super::atomic_file::{FileError, Reservation, beside, check_output, write_atomically, write_or_keep};
use super::{CheckpointFile, Error, Observer, RefinedPoses};
use strivec_format::model::Scene;
use strivec_train::DeadComponents;

/// A trained scene.
#[derive(Clone, Debug)]
pub struct Trained {
    /// The scene as the file has it, but for the rounding of factors with 16 bits.
    pub scene: Scene,
    /// The bytes of its `.strivec` file.
    pub bytes: Vec<u8>,
    /// Steps, with those of a training for the file's size.
    pub steps: u64,
    /// Wall time of prior and steps, in seconds, without loading, the observer's work and encoding.
    pub seconds: f64,
    /// Components cleared after the last step; `None` if they were kept or the run resumed after that.
    pub dead_components: Option<DeadComponents>,
    /// The refined camera poses, if the settings refine them.
    pub refined_poses: Option<RefinedPoses>,
    /// The run's checkpoint.
    pub checkpoint: Option<CheckpointFile>,
}

impl Trained {
    /// Checks, before a training, that [`Trained::write`] could write `output` and the poses beside it, and reserves them.
    ///
    /// # Errors
    ///
    /// All errors of [`check_output`].
    pub fn check_output(output: &Path, force: bool) -> Result<[Reservation; 2], FileError> {
        Ok([check_output(output, force)?, check_output(&poses_file(output), force)?])
    }

    /// Writes the scene file `output` and, if poses were refined, `OUTPUT.poses.json`; then removes the checkpoint. With
    /// `force`, overwrites files that exist. If the scene cannot be written, [`write_or_keep`] keeps it, and the checkpoint stays.
    ///
    /// # Errors
    ///
    /// [`Error::File`]; [`Error::KeptCheckpoint`] if only the checkpoint is kept.
    pub fn write(&self, output: &Path, force: bool, observer: &mut dyn Observer) -> Result<(), Error> {
        write_or_keep(output, &self.bytes, force).map_err(|source| match &self.checkpoint {
            Some(CheckpointFile { path, .. }) if !matches!(source, FileError::Kept { .. }) && path.is_file() => {
                Error::KeptCheckpoint { checkpoint: path.clone(), source }
            }
            _ => source.into(),
        })?;
        if let Some(poses) = &self.refined_poses {
            let path = poses_file(output);
            write_atomically(&path, poses.to_json().as_bytes(), force)?;
            observer.message(&format_args!("{}: {}", path.display(), poses.summary()));
        }
        if let Some(checkpoint) = &self.checkpoint {
            checkpoint.remove()?;
        }
        Ok(())
    }
}

/// The file of refined poses beside the scene file `output`.
fn poses_file(output: &Path) -> PathBuf {
    beside(output, ".poses.json")
}
