//! The start of a training: settings that fit the photographs, and the occupied space.

use super::{Error, Observer};
use strivec_capture::dataset::Dataset;
use strivec_capture::prior::VoxelBoxes;
use strivec_format::digits::grouped;
use strivec_train::{PrepareError, TrainConfig, Trainer};

/// The settings and the occupied space from which a scene is trained.
#[derive(Clone, Debug, PartialEq)]
pub struct Start {
    /// The settings, with the range of rays and, of an unbounded scene, its inner box.
    pub config: TrainConfig,
    /// The occupied cells, in the dataset's space or, for an unbounded scene, in contracted space.
    pub occupied: VoxelBoxes,
}

impl Start {
    /// Places tensors on the occupied cells; returns a trainer at its first step. `dataset` is the one that this was made
    /// of.
    ///
    /// # Errors
    ///
    /// [`Error::Prepare`] and [`Error::Train`].
    pub fn trainer<'a>(self, dataset: &'a Dataset, observer: &mut dyn Observer) -> Result<Trainer<'a>, Error> {
        let Self { config, occupied } = self;
        let config = config.fitted(&occupied).map_err(PrepareError::from)?;
        let mut scene = strivec_train::place_scene(&config, dataset, &occupied)?;
        scene.occupancy = strivec_train::carved(&scene, &dataset.views);
        let trainer = Trainer::new(config, scene, &dataset.views)?;
        observer.message(&format_args!(
            "{} parameters, {} rays meet the model",
            grouped(trainer.scene().parameter_count()),
            grouped(trainer.ray_count() as u64)
        ));
        Ok(trainer)
    }
}
