//! The file with which an interrupted training resumes.

use std::path::{Path, PathBuf};

use super::atomic_file::{FileError, beside, check_output, read_file, remove_file, write_atomically};
use super::{Error, Observer};
use strivec_format::container;
use strivec_format::container::{EncodeOptions, Encoding};
use strivec_format::model::Scene;
use strivec_train::{Checkpoint, Trainer};

/// The checkpoint file of a training. It is written when the training is interrupted, and removed when its scene is
/// written.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CheckpointFile {
    /// The file.
    pub path: PathBuf,
    /// Steps between two checkpoints; `None` writes one only when the training is interrupted.
    pub every: Option<u64>,
}

impl CheckpointFile {
    /// The file `path`, written only when the training is interrupted.
    pub fn new(path: impl Into<PathBuf>) -> Self {
        Self { path: path.into(), every: None }
    }

    /// The file `OUTPUT.state` beside the scene file `output`.
    pub fn beside(output: &Path) -> Self {
        Self::new(beside(output, ".state"))
    }

    /// Checks, before any work is done, that a new training may use this file.
    ///
    /// # Errors
    ///
    /// [`FileError::CheckpointExists`] if an interrupted run left one, unless `force`; else as [`check_output`].
    pub fn check_new(&self, force: bool) -> Result<(), FileError> {
        if self.path.exists() && !force {
            return Err(FileError::CheckpointExists { path: self.path.clone() });
        }
        check_output(&self.path, force).map(drop)
    }

    /// The checkpoint and its scene.
    ///
    /// # Errors
    ///
    /// [`Error::File`] if it cannot be read, [`Error::Checkpoint`] and [`Error::CheckpointScene`] if it is damaged.
    pub fn read(&self) -> Result<(Checkpoint, Scene), Error> {
        let path = &self.path;
        let bytes = read_file(path)?;
        let (checkpoint, scene) =
            Checkpoint::from_bytes(&bytes).map_err(|source| Error::Checkpoint { path: path.clone(), source })?;
        let scene = container::decode(&scene)
            .map_err(|source| Error::CheckpointScene { path: path.clone(), source: Box::new(source) })?;
        Ok((checkpoint, scene))
    }

    /// Writes the checkpoint of `trainer`, atomically.
    ///
    /// # Errors
    ///
    /// [`Error::Encode`] and [`Error::File`].
    pub fn write(&self, trainer: &Trainer<'_>) -> Result<(), Error> {
        // 32-bit factors, so that the resumed run is byte-identical; weak compression, because it is fast.
        let options = EncodeOptions { zstd_level: Some(1), ..EncodeOptions::uniform(Encoding::F32) };
        let scene = container::encode(&trainer.unrounded_scene(), &options)?;
        Ok(write_atomically(&self.path, &trainer.checkpoint().to_bytes(&scene), true)?)
    }

    /// Removes the file of a finished run.
    ///
    /// # Errors
    ///
    /// [`FileError::Io`].
    pub fn remove(&self) -> Result<(), FileError> {
        remove_file(&self.path)
    }

    /// Writes the checkpoint of `trainer` after a step if it is due, or if the run `stops`. A run that goes on does so without
    /// a checkpoint that cannot be written, such as on a full disk; the one before stays.
    pub(super) fn follow(&self, trainer: &Trainer<'_>, stops: bool, observer: &mut dyn Observer) -> Result<(), Error> {
        if stops || self.every.is_some_and(|every| trainer.steps_done().is_multiple_of(every)) {
            match self.write(trainer) {
                Err(Error::File(error)) if !stops => {
                    let step = trainer.steps_done();
                    observer.message(&format_args!("warning: no checkpoint after step {step}: {error}"));
                }
                written => {
                    written?;
                    observer.checkpoint(&self.path);
                }
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Photographs, Prior, Recipe};
    use strivec_synth::{SynthOptions, synthesize};
    use strivec_train::TrainConfig;

    #[derive(Default)]
    struct Warnings {
        texts: Vec<String>,
        stops: bool,
    }

    impl Observer for Warnings {
        fn message(&mut self, text: &dyn std::fmt::Display) {
            self.texts.extend(Some(text.to_string()).filter(|text| text.starts_with("warning: no checkpoint")));
        }

        fn stop(&self) -> bool {
            self.stops
        }
    }

    #[test]
    fn a_checkpoint_that_cannot_be_written_does_not_end_the_run() {
        let folder = tempfile::tempdir().unwrap();
        let data = folder.path().join("spheres");
        synthesize(&data, &SynthOptions { views: 6, test_views: 1, size: [16, 16], ..SynthOptions::default() })
            .unwrap();
        let mut config = TrainConfig::preset("fast").unwrap().with_steps(10);
        config.sampling.batch_rays = 64;
        config.schedule.occupancy_at.clear();
        let absent = folder.path().join("absent/a.state");
        let recipe = Recipe {
            prior: Prior::Files { files: vec![data.join("mesh.ply")], options: Default::default() },
            keep_dead: true,
            checkpoint: Some(CheckpointFile { every: Some(5), ..CheckpointFile::new(absent) }),
            ..Recipe::new(config)
        };
        let train = |observer: &mut Warnings| recipe.train_folder(&data, &Photographs::default(), observer);

        let mut warnings = Warnings::default();
        assert_eq!(train(&mut warnings).unwrap().steps, 10);
        assert_eq!(warnings.texts.len(), 2, "{:?}", warnings.texts);
        assert!(warnings.texts[0].starts_with("warning: no checkpoint after step 5: "), "{:?}", warnings.texts);
        // Without a checkpoint, what an interrupted run has done is lost.
        let interrupted = train(&mut Warnings { stops: true, ..Warnings::default() });
        assert!(matches!(interrupted, Err(Error::File(_))), "{interrupted:?}");
    }
}
