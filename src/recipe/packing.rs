//! What a packaged file holds beside its scene, and the training of a scene for a size.
//!
//! In: a scene and the cameras of its photographs. Out: the bytes of its file with thumbnail, viewpoints, probes, corrections
//! for its coarser scales, and measurements.

use super::viewpoints::{default_views, thumbnail};
use super::{Error, Observer, Progress};
use strivec_capture::dataset::Photograph;
use strivec_field::Field;
use strivec_field::render::Turntable;
use strivec_format::container;
use strivec_format::container::{Metadata, Quality, TrainingCamera};
use strivec_format::digits::grouped;
use strivec_format::model::{MemoryLimit, ReferenceField, Scene};
use strivec_format::psnr::psnr_of_mse;
use strivec_measure::make_probes;
use strivec_train::pack;
use strivec_train::pack::{Candidate, FileLayout, MAX_TRIED, ModelCameras, ReferencePictures, fit_prefix, probe_views};
use strivec_train::{FactorImportance, TrainError, Trainer};

/// Pictures that a scene is judged by, and their size, at the usual effort.
pub const JUDGED: (usize, u32) = (12, 320);
/// Cameras and, at the usual effort, batches of rays that importance is estimated from.
pub const PROBED: (usize, usize) = (64, 48);
/// Steps of fitting a prefix, at the usual effort.
const PREFIX_STEPS: usize = 150;
/// The least effort.
const LEAST_EFFORT: f64 = 1e-3;
/// Probe rays, if no other number is given, and those of a small file.
const PROBES: u32 = 64;
const FEW_PROBES: u32 = 16;
/// Bytes from which on a file is not small.
const SMALL: u64 = 1_000_000;
/// Bytes that are kept free, because padding and compression differ a little from one encoding of a scene to another.
const SLACK_BYTES: u64 = 1024;
/// A loss at which scenes lose about as much as in a small file.
const TYPICAL_LOSS: f64 = 1e-10;

/// Contents of a file beside its scene, and the effort of measuring.
#[derive(Clone, Debug, PartialEq)]
pub struct PackOptions {
    /// Compression and chunks.
    pub layout: FileLayout,
    /// Number of probe rays; 0 stores none. `None`: 64, or 16 in files below 1 MB.
    pub probes: Option<u32>,
    /// Fit corrections for scenes of which only the coarser scales are loaded.
    pub prefixes: bool,
    /// Write a thumbnail, the first camera and a turntable.
    pub views: bool,
    /// License text of the scene; `None` keeps the metadata's.
    pub license: Option<String>,
    /// Multiple of the usual number of rays for measuring and fitting, 0.001 to 100.
    pub effort: f64,
    /// Random seed.
    pub seed: u64,
}

impl Default for PackOptions {
    fn default() -> Self {
        Self {
            layout: FileLayout::default(),
            probes: None,
            prefixes: true,
            views: true,
            license: None,
            effort: 1.0,
            seed: 0,
        }
    }
}

impl PackOptions {
    /// The least [`PackOptions::effort`].
    pub const MIN_EFFORT: f64 = LEAST_EFFORT;

    /// The number of probe rays of a file whose scene has this many `bytes`.
    fn probes(&self, bytes: u64) -> u32 {
        self.probes.unwrap_or(if bytes < SMALL { FEW_PROBES } else { PROBES })
    }

    /// Width of the pictures that a scene is judged by.
    fn judged_width(&self) -> u32 {
        (f64::from(JUDGED.1) * self.effort.sqrt()).ceil() as u32
    }

    /// As many of `usual` as the effort allows.
    fn as_many(&self, usual: usize) -> usize {
        (usual as f64 * self.effort).ceil() as usize
    }
}

/// A scene to package, and what is known of it before anything is lost.
#[derive(Debug)]
pub struct Packing<'a> {
    /// The scene.
    pub scene: Scene,
    /// The metadata of its file, as far as they are kept.
    pub metadata: Metadata,
    /// The photographs' cameras, as far as measurements use them; the file need not have them.
    cameras: Vec<TrainingCamera>,
    views: ModelCameras,
    /// The scene's own pictures.
    pub own: ReferencePictures,
    /// Photographs, the scene's error to them, and what they are called.
    pub real: Option<(ReferencePictures, f64, &'a str)>,
    options: &'a PackOptions,
}

impl<'a> Packing<'a> {
    /// Measures `scene` within the memory that it allows, which later steps may exceed. `cameras` are those of the photographs
    /// in the model's space, as far as they are known; `photographs` are those to compare with, and a text that names them.
    ///
    /// # Errors
    ///
    /// [`TrainError::Memory`].
    pub fn new(
        mut scene: Scene,
        metadata: Metadata,
        mut cameras: Vec<TrainingCamera>,
        photographs: Option<&'a (Vec<Photograph>, String)>,
        options: &'a PackOptions,
    ) -> Result<Self, TrainError> {
        Field::<f32>::check_memory(&scene)?;
        ReferenceField::check_memory(&scene)?;
        scene.memory = MemoryLimit::NONE;
        // Cameras around the bounds stand for those of the photographs, unless these are within.
        if !metadata.cameras.is_empty() || Turntable::of(&scene, None, &cameras).is_none() {
            cameras.clone_from(&metadata.cameras);
        }
        let width = options.judged_width();
        let probed = |count| probe_views(&scene, metadata.views.as_ref(), &cameras, count, width);
        let real = photographs.map(|(views, what)| {
            let distortion = ReferencePictures::from_photographs(&scene, views);
            let before = distortion.mse(&scene);
            (distortion, before, what.as_str())
        });
        let (views, own) = (probed(PROBED.0), ReferencePictures::from_own_pictures(&scene, probed(JUDGED.0)));
        Ok(Self { scene, metadata, cameras, views, own, real, options })
    }

    /// The importance of the factors of `scene`, seen as this one.
    pub fn importance(&self, scene: &Scene, observer: &mut dyn Observer) -> FactorImportance {
        observer.message(&"estimating importance");
        self.views.importance(scene, self.options.as_many(PROBED.1), self.options.seed)
    }

    /// Begins the last `steps` of `trainer`, in which the scene is trained for a file of at most `target` bytes. The trainer's
    /// photographs are those of the scene.
    pub fn begin_for_size(
        &self,
        trainer: &mut Trainer<'_>,
        target: u64,
        steps: u64,
        observer: &mut dyn Observer,
    ) -> Result<(), Error> {
        let importance = self.importance(&self.scene, observer);
        let beside = self.bytes_beside(&importance, target, observer)?;
        let total = MAX_TRIED as u64;
        observer.progress(Progress { phase: "encodings", done: 0, total, detail: "" });
        let (mut count, mut smallest) = (0, u64::MAX);
        let mut tried = |candidate: &Candidate| {
            count += 1;
            smallest = smallest.min(candidate.bytes);
            let detail = format!("{} bytes", grouped(candidate.bytes));
            observer.progress(Progress { phase: "encodings", done: count, total, detail: &detail });
        };
        let begun =
            pack::begin_for_size(trainer, &self.scene, &importance, target.saturating_sub(beside), steps, &mut tried);
        observer.finished("");
        if begun? {
            return Ok(());
        }
        Err(Error::TooSmall { limit: target, smallest: smallest.saturating_add(beside) })
    }

    /// Bytes to keep free in a file of at most `target` bytes, for what is beside the scene: the same for about every encoding
    /// with integers.
    ///
    /// # Errors
    ///
    /// All errors of [`Packing::finish`].
    pub fn bytes_beside(
        &self,
        importance: &FactorImportance,
        target: u64,
        observer: &mut dyn Observer,
    ) -> Result<u64, Error> {
        let pack::Lossy { scene, options, .. } = pack::lossy(&self.scene, importance, TYPICAL_LOSS, 1.0);
        let bare = pack::size(&scene, &options)?;
        let candidate = Candidate::unmeasured(scene.clone(), scene, options, target);
        // Bytes hardly depend on how well corrections fit.
        let quick = PackOptions { effort: LEAST_EFFORT, ..self.options.clone() };
        let (bytes, _) = self.finish_with(&quick, &candidate, observer)?;
        Ok((bytes.len() as u64).saturating_sub(bare) + SLACK_BYTES)
    }

    /// The file of the scene that `trainer` has trained for `target` bytes, and what was measured of it.
    pub fn finish_for_size(
        &self,
        trainer: &Trainer<'_>,
        target: u64,
        observer: &mut dyn Observer,
    ) -> Result<(Scene, Vec<u8>, Quality), Error> {
        let mut most = trainer.rounding().map_or(target, |rounding| rounding.goal + SLACK_BYTES);
        loop {
            let found = pack::rounded_to_size(trainer, |scene| self.importance(scene, observer), most)?;
            let Some((mut scene, options)) = found else {
                return Err(Error::OutOfReach { limit: target });
            };
            // A training may have another background than its file.
            scene.frame.background = self.scene.frame.background;
            let candidate = Candidate::new(scene, options, &ReferencePictures::of_nothing())?;
            let (bytes, quality) = self.finish(&candidate, observer)?;
            match (bytes.len() as u64).saturating_sub(target) {
                0 => return Ok((candidate.decoded, bytes, quality)),
                excess => most = candidate.bytes - (excess + SLACK_BYTES).min(candidate.bytes),
            }
        }
    }

    /// The file of `candidate` with everything that belongs to it, and what was measured of it.
    ///
    /// # Errors
    ///
    /// [`Error::Encode`], also if the compression level is out of range, and [`Error::Thumbnail`].
    pub fn finish(&self, candidate: &Candidate, observer: &mut dyn Observer) -> Result<(Vec<u8>, Quality), Error> {
        self.finish_with(self.options, candidate, observer)
    }

    fn finish_with(
        &self,
        pack_options: &PackOptions,
        candidate: &Candidate,
        observer: &mut dyn Observer,
    ) -> Result<(Vec<u8>, Quality), Error> {
        let Candidate { scene, decoded, options, bytes, .. } = candidate;
        let PackOptions { layout, seed, .. } = pack_options;
        let options = layout.for_new(options.clone());
        let mut metadata = self.metadata.clone();
        let prefix_psnrs = self.fit_prefixes(pack_options, decoded, &mut metadata, observer);
        let probes = pack_options.probes(*bytes);
        metadata.probes = (probes > 0).then(|| make_probes(decoded, probes as usize, *seed));
        metadata.license = pack_options.license.clone().or(metadata.license);
        if pack_options.views {
            let views = metadata.views.take().unwrap_or_else(|| default_views(decoded, &self.cameras));
            metadata.thumbnail = Some(thumbnail(decoded, &views)?);
            metadata.views = Some(views);
        }
        let mut quality = metadata.quality.take().unwrap_or_default();
        let error = self.own.mse(decoded);
        quality.encoded = (error > 0.0).then(|| psnr_of_mse(error));
        quality.prefixes = prefix_psnrs;
        if let Some((distortion, before, what)) = &self.real {
            quality.test_before = Some(psnr_of_mse(*before));
            quality.test = Some(psnr_of_mse(distortion.mse(decoded)));
            quality.dataset = (*what).to_owned();
        }
        metadata.quality = Some(quality.clone());
        let bytes = container::encode_scene_file(scene, &metadata, &options)?;
        Ok((bytes, quality))
    }

    /// Fits the corrections of prefixes of `decoded` into `metadata`; \[scale\] the PSNR of their pictures, nothing for
    /// the last.
    fn fit_prefixes(
        &self,
        options: &PackOptions,
        decoded: &Scene,
        metadata: &mut Metadata,
        observer: &mut dyn Observer,
    ) -> Vec<Option<f64>> {
        metadata.prefixes.clear();
        let scales = decoded.scales.len();
        if !options.prefixes || scales == 1 {
            return Vec::new();
        }
        let width = options.judged_width();
        let views = probe_views(decoded, metadata.views.as_ref(), &self.cameras, 4, width);
        let distortion = ReferencePictures::from_own_pictures(decoded, views);
        let total = scales as u64 - 1;
        observer.progress(Progress { phase: "prefixes", done: 0, total, detail: "" });
        let mut psnrs = Vec::new();
        for count in 1..scales {
            let steps = options.as_many(PREFIX_STEPS);
            let prefix = fit_prefix(decoded, count, &self.views, steps, options.seed);
            let mut part = container::first_scales(decoded.clone(), &[], Some(count as u32));
            prefix.apply(&mut part);
            let psnr = psnr_of_mse(distortion.mse(&part));
            psnrs.push(Some(psnr));
            metadata.prefixes.push(Some(prefix));
            let detail = format!("{psnr:.1} dB");
            observer.progress(Progress { phase: "prefixes", done: count as u64, total, detail: &detail });
        }
        observer.finished("");
        metadata.prefixes.push(None);
        psnrs.push(None);
        psnrs
    }
}
