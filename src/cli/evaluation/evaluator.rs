//! Rendering the views of a dataset and measuring the pictures.

use std::path::{Path, PathBuf};
use std::time::Instant;

use serde::Serialize;

use crate::approximations::Approximations;
use crate::backend::{BackendOptions, Drawn};
use crate::progress::Progress;
use crate::render::colors;
use crate::{Context, Error, scene_file};
use strivec_capture::dataset::Photograph;
use strivec_field::render::{RenderSettings, upsample_bilinear};
use strivec_format::container::SceneFile;
use strivec_measure as measure;
use strivec_measure::{Region, RegionErrors, RegionReport, SsimConvention, ViewReport, counted};

/// A scene file that was read.
pub(crate) struct SceneToEvaluate {
    path: PathBuf,
    bytes: u64,
    scene_file: SceneFile,
}

/// The result for a file, as `--json` prints it.
#[derive(Serialize)]
pub(crate) struct Evaluated {
    pub(crate) file: PathBuf,
    pub(crate) bytes: u64,
    #[serde(flatten)]
    drawn: Drawn,
    #[serde(flatten)]
    settings: RenderSettings,
    /// Preparation of the renderer.
    seconds_preparing: f64,
    /// Mean time of rendering a view.
    pub(crate) seconds_per_view: f64,
    #[serde(flatten)]
    pub(crate) report: measure::Report,
    /// Errors by region of the photographs.
    pub(crate) regions: Vec<RegionReport>,
    /// Comparison of the renderer with the reference.
    pub(crate) parity: Option<measure::Parity>,
}

/// The pictures of a view.
pub(crate) struct Shown<'a> {
    /// The view's number among the evaluated ones.
    pub(crate) index: usize,
    pub(crate) report: &'a ViewReport,
    /// Columns and rows.
    pub(crate) size: [u32; 2],
    pub(crate) photograph: &'a [[f32; 3]],
    pub(crate) rendered: &'a [[f32; 3]],
}

/// How scenes are rendered and measured.
pub(crate) struct Evaluator<'a> {
    pub(crate) session: &'a Context,
    pub(crate) backend: &'a BackendOptions,
    pub(crate) approximations: &'a Approximations,
    pub(crate) ssim: &'a [SsimConvention],
    /// Compare the renderer with the reference, too.
    pub(crate) parity: bool,
}

impl SceneToEvaluate {
    /// Reads the file `path`.
    pub(crate) fn read(path: &Path, session: &Context) -> Result<Self, Error> {
        let (scene_file, bytes) = scene_file::read(path, &session.console)?;
        Ok(Self { path: path.to_path_buf(), bytes: bytes.len() as u64, scene_file })
    }

    /// The file's name.
    pub(crate) fn path(&self) -> &Path {
        &self.path
    }

    /// The color that transparent photographs are composited on.
    pub(crate) fn background(&self) -> [f32; 3] {
        self.scene_file.scene.frame.background
    }
}

impl Evaluator<'_> {
    /// Renders `views` and compares them; `on_view` gets each view's pictures.
    ///
    /// # Errors
    ///
    /// If there are no views, an approximation is not the scene's, a picture is too small to measure, or `on_view` fails.
    pub(crate) fn evaluate(
        &self,
        scene: SceneToEvaluate,
        views: &[Photograph],
        mut on_view: impl FnMut(&Shown<'_>) -> Result<(), Error>,
    ) -> Result<Evaluated, Error> {
        let SceneToEvaluate { path, bytes, scene_file } = scene;
        let console = &self.session.console;
        let size = views.first().map_or([0, 0], |view| [view.camera.width, view.camera.height]);
        let settings = self.approximations.settings(&scene_file, &path, size)?;
        let scene = scene_file.scene;
        let frame = scene.frame.clone();
        let whole = self.parity.then(|| scene.clone());
        let start = Instant::now();
        let mut renderer =
            self.backend.prepare(scene, &settings.approximation, console).map_err(Error::of_scene(&path))?;
        let seconds_preparing = start.elapsed().as_secs_f64();
        let progress = Progress::start(console, "eval", views.len() as u64);
        let mut reports: Vec<ViewReport> = Vec::new();
        let mut errors = RegionErrors::default();
        let mut seconds = 0.0;
        for (index, view) in views.iter().enumerate() {
            let start = Instant::now();
            let camera = view.camera.mapped(&frame.model_from_dataset);
            let size = [camera.width, camera.height];
            let picture = upsample_bilinear(&renderer.render(&camera.downscaled(settings.divisor))?, size);
            seconds += start.elapsed().as_secs_f64();
            let (photograph, rendered) = (view.pixels.colors(frame.background), colors(&picture));
            let mask = view.mask.as_deref();
            let mut report = ViewReport::new(&view.name, size, &rendered, &photograph, mask)?;
            let unmeasured = |error| Error::Usage(format!("view {}: {error}", view.name));
            report.add(self.ssim, size, &rendered, &photograph, mask).map_err(unmeasured)?;
            let regions = Region::from_photograph(size, &photograph, &view.pixels.opacities())?;
            match mask {
                None => errors.add(&regions, &rendered, &photograph)?,
                Some(mask) => {
                    errors.add(&counted(&regions, mask), &counted(&rendered, mask), &counted(&photograph, mask))?;
                }
            }
            on_view(&Shown { index, report: &report, size, photograph: &photograph, rendered: &rendered })?;
            reports.push(report);
            progress.set(reports.len() as u64, || {
                let mean = reports.iter().map(|r| r.psnr).sum::<f64>() / reports.len() as f64;
                format!("mean {mean:.2} dB")
            });
        }
        let seconds_per_view = seconds / views.len() as f64;
        progress.finish(&format!("{seconds_per_view:.2} s per view"));
        let report =
            measure::Report::new(reports).ok_or_else(|| Error::Malformed("the selected split has no views".into()))?;
        let parity = match whole {
            None => None,
            Some(scene) => {
                console.say("comparing with the reference");
                let cameras: Vec<_> = views.iter().map(|v| v.camera.mapped(&frame.model_from_dataset)).collect();
                Some(renderer.parity(&scene, &cameras)?)
            }
        };
        Ok(Evaluated {
            file: path,
            bytes,
            drawn: renderer.drawn(),
            settings,
            seconds_preparing,
            seconds_per_view,
            report,
            regions: errors.report(),
            parity,
        })
    }
}
