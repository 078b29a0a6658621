//! What a packaged file holds beside its scene, and the training of a scene for a size.

use std::path::Path;

use super::encoding::LayoutArgs;
use super::showing::{default_views, thumbnail};
use crate::cli::Error;
use crate::cli::console::Console;
use crate::cli::progress::Progress;
use crate::container::{self, Metadata, Quality, TrainingCamera};
use crate::dataset::View;
use crate::digits::grouped;
use crate::measure::make_probes;
use crate::model::Scene;
use crate::pack::{self, Candidate, Distortion, MAX_TRIED, Views, fit_prefix, probe_views};
use crate::psnr::psnr_of_mse;
use crate::render::Turntable;
use crate::train::{FactorImportance, Trainer};

/// Pictures that a scene is judged by, and their size, at the usual effort.
pub(in crate::cli) const JUDGED: (usize, u32) = (12, 320);
/// Cameras and, at the usual effort, batches of rays that importance is estimated from.
pub(in crate::cli) const PROBED: (usize, usize) = (64, 48);
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

/// What a file holds beside its scene, and the effort of measuring.
#[derive(Clone, Debug, clap::Args)]
pub(in crate::cli) struct Extras {
    #[command(flatten)]
    pub(super) layout: LayoutArgs,
    /// Number of probe rays stored for `verify --render`; 0 stores none [default: 64; 16 in files below 1 MB]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(0..=65_536))]
    probes: Option<u32>,
    /// Fit no corrections for scenes of which only the coarser scales are loaded
    #[arg(long)]
    no_prefixes: bool,
    /// Write no thumbnail, first camera or turntable
    #[arg(long)]
    no_views: bool,
    /// License text of the scene
    #[arg(long, value_name = "TEXT")]
    license: Option<String>,
    /// Multiple of the usual number of rays for measuring and fitting, 0.001 to 100: 0.1 is quick, 4 is thorough
    #[arg(long, value_name = "F", default_value_t = 1.0, value_parser = effort)]
    effort: f64,
    /// Random seed
    #[arg(long, default_value_t = 0)]
    pub(super) seed: u64,
}

fn effort(text: &str) -> Result<f64, String> {
    match text.parse() {
        Ok(value) if (LEAST_EFFORT..=100.0).contains(&value) => Ok(value),
        _ => Err("not a number from 0.001 to 100".into()),
    }
}

impl Extras {
    /// The usual ones.
    pub(in crate::cli) fn usual(seed: u64) -> Self {
        Self {
            layout: LayoutArgs::default(),
            probes: None,
            no_prefixes: false,
            no_views: false,
            license: None,
            effort: 1.0,
            seed,
        }
    }

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
pub(in crate::cli) struct Packing<'a> {
    pub(super) scene: Scene,
    pub(super) metadata: Metadata,
    /// The photographs' cameras, as far as measurements use them; the file need not have them.
    cameras: Vec<TrainingCamera>,
    views: Views,
    /// The scene's own pictures.
    pub(super) own: Distortion,
    /// Photographs, the scene's error to them, and what they are called.
    pub(super) real: Option<(Distortion, f64, &'a str)>,
    extras: &'a Extras,
    pub(super) console: &'a Console,
}

impl<'a> Packing<'a> {
    /// Measures `scene`. `cameras` are those of the photographs in the model's space, as far as they are known.
    pub(in crate::cli) fn new(
        scene: Scene,
        metadata: Metadata,
        mut cameras: Vec<TrainingCamera>,
        photographs: Option<&'a (Vec<View>, String)>,
        extras: &'a Extras,
        console: &'a Console,
    ) -> Self {
        // Cameras around the bounds stand for those of the photographs, unless these are within.
        if !metadata.cameras.is_empty() || Turntable::of(&scene, None, &cameras).is_none() {
            cameras.clone_from(&metadata.cameras);
        }
        let width = extras.judged_width();
        let probed = |count| probe_views(&scene, metadata.views.as_ref(), &cameras, count, width);
        let real = photographs.map(|(views, what)| {
            let distortion = Distortion::from_photographs(&scene, views);
            let before = distortion.mse(&scene);
            (distortion, before, what.as_str())
        });
        let (views, own) = (probed(PROBED.0), Distortion::from_own_pictures(&scene, probed(JUDGED.0)));
        Self { scene, metadata, cameras, views, own, real, extras, console }
    }

    /// The importance of the factors of `scene`, seen as this one.
    pub(super) fn importance(&self, scene: &Scene) -> FactorImportance {
        self.console.say("estimating importance");
        self.views.importance(scene, self.extras.as_many(PROBED.1), self.extras.seed)
    }

    /// Begins the last `steps` of `trainer`, in which the scene is trained for a file of at most `target` bytes. The trainer's
    /// photographs are those of the scene.
    pub(in crate::cli) fn begin_for_size(
        &self,
        trainer: &mut Trainer<'_>,
        target: u64,
        steps: u64,
        path: &Path,
    ) -> Result<(), Error> {
        let importance = self.importance(&self.scene);
        let beside = self.bytes_beside(&importance, target, path)?;
        let progress = Progress::start(self.console, "encodings", MAX_TRIED as u64);
        let (mut count, mut smallest) = (0, u64::MAX);
        let mut tried = |candidate: &Candidate| {
            count += 1;
            smallest = smallest.min(candidate.bytes);
            progress.set(count, || format!("{} bytes", grouped(candidate.bytes)));
        };
        let begun =
            pack::begin_for_size(trainer, &self.scene, &importance, target.saturating_sub(beside), steps, &mut tried);
        if begun.map_err(|e| Error::container(path, e))? {
            return Ok(());
        }
        let (target, smallest) = (grouped(target), grouped(smallest.saturating_add(beside)));
        let message = format!("a file of {target} bytes is too small; the smallest has about {smallest} bytes");
        Err(Error::Runtime(format!("{}: {message}", path.display())))
    }

    /// Bytes to keep free in a file of at most `target` bytes, for what is beside the scene: the same for about every encoding
    /// with integers.
    pub(super) fn bytes_beside(&self, importance: &FactorImportance, target: u64, path: &Path) -> Result<u64, Error> {
        let pack::Lossy { scene, options, .. } = pack::lossy(&self.scene, importance, TYPICAL_LOSS, 1.0);
        let bare = pack::size(&scene, &options).map_err(|e| Error::container(path, e))?;
        let candidate = Candidate::unmeasured(scene.clone(), scene, options, target);
        // Bytes hardly depend on how well corrections fit.
        let quick = Extras { effort: LEAST_EFFORT, ..self.extras.clone() };
        let (bytes, _) = self.finish_with(&quick, &candidate, path)?;
        Ok((bytes.len() as u64).saturating_sub(bare) + SLACK_BYTES)
    }

    /// The file of the scene that `trainer` has trained for `target` bytes, and what was measured of it.
    pub(in crate::cli) fn finish_for_size(
        &self,
        trainer: &Trainer<'_>,
        target: u64,
        path: &Path,
    ) -> Result<(Scene, Vec<u8>, Quality), Error> {
        let mut most = trainer.rounding().map_or(target, |rounding| rounding.goal + SLACK_BYTES);
        loop {
            let found = pack::rounded_to_size(trainer, |scene| self.importance(scene), most);
            let Some((mut scene, options)) = found.map_err(|e| Error::container(path, e))? else {
                let target = grouped(target);
                return Err(Error::Runtime(format!("{}: {target} bytes cannot be reached", path.display())));
            };
            // A training may have another background than its file.
            scene.frame.background = self.scene.frame.background;
            let candidate = Candidate::new(scene, options, &Distortion::of_nothing());
            let candidate = candidate.map_err(|e| Error::container(path, e))?;
            let (bytes, quality) = self.finish(&candidate, path)?;
            match (bytes.len() as u64).saturating_sub(target) {
                0 => return Ok((candidate.decoded, bytes, quality)),
                excess => most = candidate.bytes - (excess + SLACK_BYTES).min(candidate.bytes),
            }
        }
    }

    /// The file of `candidate` with everything that belongs to it.
    pub(super) fn finish(&self, candidate: &Candidate, path: &Path) -> Result<(Vec<u8>, Quality), Error> {
        self.finish_with(self.extras, candidate, path)
    }

    fn finish_with(&self, extras: &Extras, candidate: &Candidate, path: &Path) -> Result<(Vec<u8>, Quality), Error> {
        let Candidate { scene, decoded, options, bytes, .. } = candidate;
        let Extras { layout, seed, .. } = extras;
        let options = layout.for_new(options.clone())?;
        let mut metadata = self.metadata.clone();
        let prefix_psnrs = self.fit_prefixes(extras, decoded, &mut metadata);
        let probes = extras.probes(*bytes);
        metadata.probes = (probes > 0).then(|| make_probes(decoded, probes as usize, *seed));
        metadata.license = extras.license.clone().or(metadata.license);
        if !extras.no_views {
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
        let bytes = container::encode_scene_file(scene, &metadata, &options).map_err(|e| Error::container(path, e))?;
        Ok((bytes, quality))
    }

    /// Fits the corrections of prefixes of `decoded` into `metadata`; \[scale\] the PSNR of their pictures, nothing for
    /// the last.
    fn fit_prefixes(&self, extras: &Extras, decoded: &Scene, metadata: &mut Metadata) -> Vec<Option<f64>> {
        metadata.prefixes.clear();
        let scales = decoded.scales.len();
        if extras.no_prefixes || scales == 1 {
            return Vec::new();
        }
        let width = extras.judged_width();
        let views = probe_views(decoded, metadata.views.as_ref(), &self.cameras, 4, width);
        let distortion = Distortion::from_own_pictures(decoded, views);
        let progress = Progress::start(self.console, "prefixes", scales as u64 - 1);
        let mut psnrs = Vec::new();
        for count in 1..scales {
            let steps = extras.as_many(PREFIX_STEPS);
            let prefix = fit_prefix(decoded, count, &self.views, steps, extras.seed);
            let mut part = container::first_scales(decoded.clone(), &[], Some(count as u32));
            prefix.apply(&mut part);
            let psnr = psnr_of_mse(distortion.mse(&part));
            psnrs.push(Some(psnr));
            metadata.prefixes.push(Some(prefix));
            progress.set(count as u64, || format!("{psnr:.1} dB"));
        }
        metadata.prefixes.push(None);
        psnrs.push(None);
        psnrs
    }
}
