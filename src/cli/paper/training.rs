//! One training of one scene, and the measuring of its pictures. Each stage is recorded, so that a stopped table goes on where it
//! was.

use std::ffi::OsString;
use std::fs;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering;

use clap::Parser as _;
use serde::{Deserialize, Serialize};

use super::figures::Figures;
use super::tables::Training;
use crate::cli::approximations::Approximations;
use crate::cli::backend::{Backend, BackendOptions};
use crate::cli::dataset::DatasetOptions;
use crate::cli::evaluation::{Evaluator, SceneToEvaluate};
use crate::cli::output::{make_folder, remove_file};
use crate::cli::state_file::beside;
use crate::cli::view_selection::evenly_spaced;
use crate::cli::{Error, Session, train, write_atomically};
use crate::dataset::{self, LoadOptions};
use crate::measure::PictureMeasure;

/// Steps between two checkpoints.
const CHECKPOINT_EVERY: &str = "1000";

/// The options of all trainings of a table.
pub(super) struct Trainings<'a> {
    /// The folder of all results.
    pub(super) out: &'a Path,
    pub(super) downscale: u32,
    pub(super) dataset: &'a DatasetOptions,
    pub(super) split: &'a str,
    /// Number of views to measure, evenly spaced; `None`: all.
    pub(super) views: Option<usize>,
    pub(super) measures: &'a [PictureMeasure],
    pub(super) session: &'a Session,
}

/// A dataset.
pub(super) struct Scene {
    pub(super) name: String,
    pub(super) folder: PathBuf,
}

/// The file of a training's stages.
#[derive(Serialize, Deserialize)]
struct Record {
    identity: Identity,
    trained: Option<Trained>,
    measured: Option<Measured>,
}

/// The inputs of a training. A record is of these alone.
#[derive(PartialEq, Serialize, Deserialize)]
struct Identity {
    folder: PathBuf,
    /// How its photographs are loaded.
    photographs: String,
    bootstraps: bool,
    settings: String,
}

/// The result of a training.
#[derive(Clone, Copy, Serialize, Deserialize)]
struct Trained {
    bytes: u64,
    parameters: u64,
    /// Time of prior and training.
    seconds: f64,
}

/// The result of measuring the pictures.
#[derive(Clone, Serialize, Deserialize)]
struct Measured {
    how: How,
    views: usize,
    psnr: f64,
    ssim: Option<f64>,
    lpips_vgg: Option<f64>,
    lpips_alex: Option<f64>,
    seconds_per_view: f64,
}

/// The views and measures of an evaluation.
#[derive(Clone, PartialEq, Serialize, Deserialize)]
struct How {
    /// The split, and how its photographs are loaded.
    views: String,
    measures: Vec<String>,
}

/// A row of results.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Outcome {
    pub(super) file: PathBuf,
    pub(super) bytes: u64,
    pub(super) views: usize,
    #[serde(flatten)]
    pub(super) figures: Figures,
}

/// The command line of a training.
#[derive(clap::Parser)]
struct CommandLine {
    #[command(flatten)]
    args: train::Args,
}

impl Trainings<'_> {
    /// The outcome of `training` on `scene`, as far as it is not recorded yet.
    pub(super) fn outcome(&self, training: &Training, scene: &Scene) -> Result<Outcome, Error> {
        let folder = self.out.join(&training.name);
        let file = folder.join(format!("{}.strivec", scene.name));
        let path = folder.join(format!("{}.json", scene.name));
        let dataset = self.dataset.turned(training.degrees);
        let photographs = dataset.load_options(self.downscale);
        let identity = Identity {
            folder: scene.folder.clone(),
            photographs: format!("{photographs:?}"),
            bootstraps: training.bootstraps,
            settings: training.config.to_toml(),
        };
        let mut record = match read(&path)?.filter(|_| !self.session.force) {
            None => Record { identity, trained: None, measured: None },
            Some(record) if record.identity == identity => record,
            Some(_) => {
                let message =
                    "belongs to another training; choose another folder with --out, or overwrite it with --force";
                return Err(Error::Usage(format!("{}: {message}", path.display())));
            }
        };
        let trained = match record.trained {
            Some(trained) if file.is_file() => trained,
            _ => {
                make_folder(&folder)?;
                (record.trained, record.measured) = (None, None);
                self.write(&path, &record)?;
                let trained = self.train(training, scene, &file, dataset)?;
                record.trained = Some(trained);
                self.write(&path, &record)?;
                trained
            }
        };
        let views = self.views(scene, photographs)?;
        let how = How { views: format!("{} {views:?}", self.split), measures: self.measure_names() };
        let measured = match record.measured {
            Some(measured) if measured.how == how => measured,
            _ => {
                let measured = self.measure(scene, &file, &views, how)?;
                record.measured = Some(measured.clone());
                self.write(&path, &record)?;
                measured
            }
        };
        Ok(Outcome {
            file,
            bytes: trained.bytes,
            views: measured.views,
            figures: Figures {
                psnr: Some(measured.psnr),
                ssim: measured.ssim,
                lpips_vgg: measured.lpips_vgg,
                lpips_alex: measured.lpips_alex,
                millions: Some(trained.parameters as f64 / 1e6),
                minutes: Some(trained.seconds / 60.0),
                seconds: Some(measured.seconds_per_view),
            },
        })
    }

    fn write(&self, path: &Path, record: &Record) -> Result<(), Error> {
        let text = serde_json::to_string_pretty(record).expect("plain data");
        write_atomically(path, text.as_bytes(), true)
    }

    /// As `strivec train` does it. The settings are a file beside the scenes.
    fn train(
        &self,
        training: &Training,
        scene: &Scene,
        file: &Path,
        dataset: DatasetOptions,
    ) -> Result<Trained, Error> {
        let settings = file.with_file_name("settings.toml");
        write_atomically(&settings, training.config.to_toml().as_bytes(), true)?;
        let downscale = self.downscale.to_string();
        let mut words: Vec<OsString> = vec!["train".into(), scene.folder.clone().into(), "-o".into(), file.into()];
        words.extend(["--downscale", &downscale, "--checkpoint-every", CHECKPOINT_EVERY].map(OsString::from));
        let state = beside(file, ".state");
        if self.session.force {
            remove_file(&state)?;
        }
        if state.is_file() {
            words.push("--resume".into());
        } else {
            words.extend(["--config".into(), settings.into()]);
            words.extend(training.bootstraps.then(|| "--bootstrap".into()));
        }
        let mut args = CommandLine::try_parse_from(words).map_err(|e| Error::Runtime(e.to_string()))?.args;
        args.settings.basics.dataset = dataset;
        let config = args.settings.configuration()?;
        // A scene without a record is of a run that ended before it wrote one.
        remove_file(file)?;
        let trained = train::trained(&args, config, self.session).map_err(|error| {
            let is_stopped = self.session.interrupts().is_ok_and(|stopped| stopped.load(Ordering::SeqCst));
            if is_stopped { Error::Runtime("interrupted; the same command goes on from here".into()) } else { error }
        })?;
        Ok(Trained { bytes: trained.bytes, parameters: trained.parameters, seconds: trained.seconds })
    }

    fn measure_names(&self) -> Vec<String> {
        self.measures.iter().map(|measure| measure.name().to_owned()).collect()
    }

    /// The views to measure.
    fn views(&self, scene: &Scene, photographs: LoadOptions) -> Result<LoadOptions, Error> {
        let Some(views) = self.views else { return Ok(photographs) };
        evenly_spaced(&scene.folder, self.split, views, &photographs)
    }

    /// As `strivec eval` does it.
    fn measure(&self, scene: &Scene, file: &Path, options: &LoadOptions, how: How) -> Result<Measured, Error> {
        let views = dataset::load(&scene.folder, self.split, options)?.views;
        let evaluator = Evaluator {
            session: self.session,
            backend: &BackendOptions::new(Backend::Cpu, false),
            approximations: &Approximations::default(),
            measures: self.measures,
            parity: false,
        };
        let evaluated = evaluator.evaluate(SceneToEvaluate::read(file, self.session)?, &views, |_| Ok(()))?;
        let report = &evaluated.report;
        let other = |name: &str| report.others.get(name).copied();
        Ok(Measured {
            how,
            views: report.views.len(),
            psnr: report.psnr,
            ssim: report.ssim,
            lpips_vgg: other("lpips_vgg"),
            lpips_alex: other("lpips_alex"),
            seconds_per_view: evaluated.seconds_per_view,
        })
    }
}

/// The record in the file `path`, if there is one.
fn read(path: &Path) -> Result<Option<Record>, Error> {
    match fs::read(path) {
        Ok(bytes) => serde_json::from_slice(&bytes).map(Some).map_err(Error::malformed(path)),
        Err(e) if e.kind() == ErrorKind::NotFound => Ok(None),
        Err(e) => Err(Error::io("read", path)(e)),
    }
}
