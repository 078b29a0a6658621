//! From photographs to the bytes of a scene file, as `strivec train` does it.

use std::path::Path;
use std::time::Instant;

use super::background::background_of;
use super::distances::{find_distances, is_opaque};
use super::photographs::cameras;
use super::{
    CheckpointFile, Error, Fitting, Observer, PackOptions, Packing, Photographs, Prior, RefinedPoses, Start, Trained,
    load, run_steps,
};
use strivec_capture::dataset::Dataset;
use strivec_field::render::Turntable;
use strivec_format::container;
use strivec_format::container::{EncodeOptions, Encoding, Metadata, TrainingCamera};
use strivec_format::model::{Frame, Scene};
use strivec_train::{Checkpoint, TrainConfig, Trainer};

/// Everything that decides a training besides its photographs. [`Recipe::new`] has the defaults of `strivec train`.
#[derive(Clone, Debug)]
pub struct Recipe {
    /// The settings.
    pub config: TrainConfig,
    /// The source of the occupied space.
    pub prior: Prior,
    /// Adjustments of the settings to the photographs and to a budget.
    pub fitting: Fitting,
    /// Keep dead components, those that no training ray uses, instead of clearing them after the last step.
    pub keep_dead: bool,
    /// Encoding of the factors, unless the scene is trained for a file size.
    pub encoding: Encoding,
    /// The file with which an interrupted run resumes; `None` keeps nothing of it.
    pub checkpoint: Option<CheckpointFile>,
    /// Resume from `checkpoint` with its settings; the result is byte-identical to an uninterrupted run.
    pub resume: bool,
}

/// A run of a recipe, new or resumed, before its photographs are loaded.
#[derive(Debug)]
pub struct Training<'a> {
    recipe: &'a Recipe,
    /// The checkpoint that it resumes from, and its scene.
    saved: Option<(Checkpoint, Scene)>,
}

impl Recipe {
    /// Training by `config` alone: the prior is from the photographs, the factors have 16 bits, there is no checkpoint.
    pub fn new(config: TrainConfig) -> Self {
        Self {
            config,
            prior: Prior::default(),
            fitting: Fitting::default(),
            keep_dead: false,
            encoding: Encoding::F16,
            checkpoint: None,
            resume: false,
        }
    }

    /// Trains on the photographs in `folder`. See [`Trained::write`] for the files of the result.
    ///
    /// # Errors
    ///
    /// [`Error`]; [`Error::Interrupted`] if `observer` stops the run.
    pub fn train_folder(
        &self,
        folder: &Path,
        photographs: &Photographs,
        observer: &mut dyn Observer,
    ) -> Result<Trained, Error> {
        let training = self.begin()?;
        let options = photographs.load_options(folder, training.max_photograph_side(), observer)?;
        let mut dataset = load(folder, &options, observer)?;
        training.run(&mut dataset, observer)
    }

    /// Trains on the views of `dataset`, whose bounds and distances are set.
    ///
    /// # Errors
    ///
    /// All errors of [`Recipe::train_folder`].
    pub fn train(&self, dataset: &mut Dataset, observer: &mut dyn Observer) -> Result<Trained, Error> {
        self.begin()?.run(dataset, observer)
    }

    /// Begins a run: reads the checkpoint if the run resumes.
    ///
    /// # Errors
    ///
    /// All errors of [`CheckpointFile::read`].
    pub fn begin(&self) -> Result<Training<'_>, Error> {
        let checkpoint = self.checkpoint.as_ref().filter(|_| self.resume);
        Ok(Training { recipe: self, saved: checkpoint.map(CheckpointFile::read).transpose()? })
    }

    /// The settings and the occupied space from which a new scene of `dataset` is trained. Sets the bounds of `dataset` and
    /// the distances of its views.
    ///
    /// # Errors
    ///
    /// [`Error::Prior`] and [`Error::Prepare`]; the latter, too, if the scene does not fit the budget.
    pub fn prepare(&self, dataset: &mut Dataset, observer: &mut dyn Observer) -> Result<Start, Error> {
        let mut config = self.config.clone();
        let cameras = cameras(dataset);
        let occupied = match self.prior.from_files(&mut config, &cameras, observer)? {
            Some(occupied) => {
                find_distances(&config, dataset, observer)?;
                occupied
            }
            None => self.prior.from_photographs(&mut config, dataset, observer)?,
        };
        let (config, occupied, reasons) = self.fitting.fit(config, &cameras, occupied)?;
        reasons.iter().for_each(|reason| observer.message(reason));
        Ok(Start { config, occupied })
    }
}

impl Training<'_> {
    /// The largest side of the photographs that the settings ask for, those of the checkpoint in a resumed run.
    pub fn max_photograph_side(&self) -> Option<u32> {
        self.saved.as_ref().map_or(&self.recipe.config, |(checkpoint, _)| &checkpoint.config).photographs.max_side
    }

    /// Trains on the views of `dataset`, whose bounds and distances are set. In a resumed run they must be those that the
    /// run began with.
    ///
    /// # Errors
    ///
    /// All errors of [`Recipe::train_folder`].
    pub fn run(self, dataset: &mut Dataset, observer: &mut dyn Observer) -> Result<Trained, Error> {
        let Self { recipe, saved } = self;
        let start = Instant::now();
        let mut trainer = match saved {
            Some((checkpoint, scene)) => {
                find_distances(&checkpoint.config, dataset, observer)?;
                Trainer::resume(checkpoint, scene, &dataset.views)?
            }
            None => recipe.prepare(dataset, observer)?.trainer(dataset, observer)?,
        };
        trainer.add_seconds(start.elapsed().as_secs_f64());
        run_steps(&mut trainer, recipe.checkpoint.as_ref(), observer)?;
        recipe.finish(&mut trainer, dataset, observer)
    }
}

impl Recipe {
    /// The file of the scene that `trainer` has trained on `dataset`: if it is larger than the settings allow, the scene is
    /// first trained for that size.
    fn finish(
        &self,
        trainer: &mut Trainer<'_>,
        dataset: &Dataset,
        observer: &mut dyn Observer,
    ) -> Result<Trained, Error> {
        let mut scene = trainer.unrounded_scene();
        let cameras = model_cameras(dataset, &scene.frame);
        let pack_options = PackOptions { seed: trainer.config().seed, ..PackOptions::default() };
        let packing = |scene| Packing::new(scene, Metadata::default(), cameras.clone(), None, &pack_options);
        let max_bytes = trainer.config().schedule.max_file_bytes;
        let is_free = trainer.config().photographs.background == TrainConfig::default().photographs.background;
        let with_background = |mut scene: Scene| {
            if is_free && scene.rules.sky.is_none() && is_opaque(dataset) {
                // Where no tensor is, training had a color for which no wall passes.
                scene.frame.background = background_of(&scene, &dataset.views);
            }
            scene
        };
        let mut dead_components = None;
        let mut finished = None;
        if trainer.rounding().is_none() {
            dead_components = (!self.keep_dead).then(|| trainer.prune_dead_components(&mut scene)).transpose()?;
            let seen = with_background(scene.clone());
            let bytes = encode_with_views(&seen, &cameras, self.encoding)?;
            match max_bytes.filter(|&most| bytes.len() as u64 > most) {
                None => finished = Some((seen, bytes)),
                Some(most) => {
                    let steps = trainer.config().steps_for_size();
                    packing(scene)?.begin_for_size(trainer, most, steps, observer)?;
                }
            }
        }
        let (scene, bytes) = match finished {
            Some(finished) => finished,
            None => {
                run_steps(trainer, self.checkpoint.as_ref(), observer)?;
                let scene = with_background(trainer.unrounded_scene());
                let most = max_bytes.unwrap_or(u64::MAX);
                let (scene, bytes, _) = packing(scene)?.finish_for_size(trainer, most, observer)?;
                (scene, bytes)
            }
        };
        Ok(Trained {
            scene,
            bytes,
            steps: trainer.steps_in_all(),
            seconds: trainer.checkpoint().seconds,
            dead_components,
            refined_poses: trainer.refined_cameras().map(|refined| RefinedPoses::new(&dataset.views, &refined)),
            checkpoint: self.checkpoint.clone(),
        })
    }
}

/// The cameras of `dataset` in the space of the model of `frame`.
fn model_cameras(dataset: &Dataset, frame: &Frame) -> Vec<TrainingCamera> {
    let map = frame.model_from_dataset;
    cameras(dataset).iter().map(|camera| TrainingCamera::from(&camera.mapped(&map))).collect()
}

/// The bytes of `scene`'s file: with viewpoints by the photographs' `cameras`, unless these are all around the scene.
fn encode_with_views(
    scene: &Scene,
    cameras: &[TrainingCamera],
    factors: Encoding,
) -> Result<Vec<u8>, container::Error> {
    let turn = Turntable::of(scene, None, cameras);
    let views = turn.map(|turn| turn.views(Turntable::POSES, Turntable::SECONDS));
    let metadata = Metadata { views, ..Metadata::default() };
    container::encode_scene_file(scene, &metadata, &EncodeOptions::uniform(factors))
}
