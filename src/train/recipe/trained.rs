//! The result of a training, and its files.

use std::path::{Path, PathBuf};

use super::atomic_file::{FileError, beside, check_output, free_name, write_atomically};
use super::{CheckpointFile, Error, Observer, RefinedPoses};
use crate::DeadComponents;
use strivec_format::model::Scene;

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
    /// Checks, before a training, that [`Trained::write`] could write `output` and the poses beside it.
    ///
    /// # Errors
    ///
    /// All errors of [`check_output`].
    pub fn check_output(output: &Path, force: bool) -> Result<(), FileError> {
        check_output(output, force)?;
        check_output(&poses_file(output), force)
    }

    /// Writes the scene file `output` and, if poses were refined, `OUTPUT.poses.json`; then removes the checkpoint. With
    /// `force`, overwrites files that exist. If `output` cannot be written, the scene is written under a free name beside it or in
    /// the system's folder of temporary files, and the checkpoint stays.
    ///
    /// # Errors
    ///
    /// [`Error::Kept`] or [`Error::KeptCheckpoint`], which say what was kept; [`Error::File`].
    pub fn write(&self, output: &Path, force: bool, observer: &mut dyn Observer) -> Result<(), Error> {
        write_atomically(output, &self.bytes, force).map_err(|error| self.keep(output, error))?;
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

impl Trained {
    /// Writes the scene elsewhere, as `source` forbids `output`. Returns where it is.
    fn keep(&self, output: &Path, source: FileError) -> Error {
        let in_temporary = output.file_name().map(|name| free_name(&std::env::temp_dir().join(name)));
        for kept in [Some(free_name(output)), in_temporary].into_iter().flatten() {
            if write_atomically(&kept, &self.bytes, false).is_ok() {
                return Error::Kept { kept, source };
            }
        }
        match &self.checkpoint {
            Some(checkpoint) if checkpoint.path.is_file() => {
                Error::KeptCheckpoint { checkpoint: checkpoint.path.clone(), source }
            }
            _ => source.into(),
        }
    }
}

/// The file of refined poses beside the scene file `output`.
fn poses_file(output: &Path) -> PathBuf {
    beside(output, ".poses.json")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_scene_that_cannot_be_written_is_kept_beside_and_named() {
        let folder = tempfile::tempdir().unwrap();
        let output = folder.path().join("a.strivec");
        let bytes = include_bytes!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../fixtures/v1/smallest.strivec")).to_vec();
        let trained = Trained {
            scene: strivec_format::container::decode(&bytes).unwrap(),
            bytes,
            steps: 1,
            seconds: 0.0,
            dead_components: None,
            refined_poses: None,
            checkpoint: Some(CheckpointFile::beside(&output)),
        };
        let checkpoint = folder.path().join("a.strivec.state");
        std::fs::write(&checkpoint, "").unwrap();
        // Another run was faster.
        std::fs::write(&output, "other").unwrap();
        let error = trained.write(&output, false, &mut ()).unwrap_err();
        let kept = folder.path().join("a-2.strivec");
        assert!(error.to_string().ends_with(&format!("the trained scene is kept in {}", kept.display())), "{error}");
        assert_eq!(std::fs::read(kept).unwrap(), trained.bytes);
        assert_eq!(std::fs::read(&output).unwrap(), b"other");
        assert!(checkpoint.is_file());
        // The folder is gone: in that of temporary files.
        let gone = folder.path().join("absent/b.strivec");
        let Err(Error::Kept { kept, .. }) = trained.write(&gone, false, &mut ()) else { panic!("it is not kept") };
        assert_eq!(std::fs::read(&kept).unwrap(), trained.bytes);
        std::fs::remove_file(kept).unwrap();
    }
}
