//! The curve of a training: its log, evaluations during the run, and the watched view.

use std::fmt::Display;
use std::path::Path;

use serde::Serialize;

use super::observer::ConsoleObserver;
use super::render::colors;
use super::train::Args;
use super::watch::Watch;
use super::{Error, write_atomically};
use strivec_capture::dataset::Photograph;
use strivec_field::render::{CpuRenderer, Renderer};
use strivec_format::model::Scene;
use strivec_format::psnr::psnr_of_mse;
use strivec_measure::ViewReport;
use strivec_recipe::{Cache, Observer, ObserverError, Progress};
use strivec_train::{StepReport, Trainer};

/// Maximum rows of the log, besides those of evaluations.
const ROWS: u64 = 500;

/// A row of the log.
#[derive(Clone, Copy, Serialize)]
pub(super) struct CurvePoint {
    step: u64,
    seconds: f64,
    /// PSNR over the steps since the previous row.
    train_psnr: f64,
    test_psnr: Option<f64>,
}

/// Shows a training on the console, and keeps its curve.
pub(super) struct CurveObserver<'a> {
    console: ConsoleObserver<'a>,
    args: &'a Args,
    /// The views of evaluations.
    held_out: &'a [Photograph],
    watch: Option<Watch>,
    curve: Vec<CurvePoint>,
    /// Sum of the steps' mean squared errors since the last row, and their number.
    error: [f64; 2],
}

impl<'a> CurveObserver<'a> {
    /// An observer that reports on `console`.
    pub(super) fn new(
        console: ConsoleObserver<'a>,
        args: &'a Args,
        held_out: &'a [Photograph],
        watch: Option<Watch>,
    ) -> Self {
        Self { console, args, held_out, watch, curve: Vec::new(), error: [0.0; 2] }
    }

    /// The rows.
    pub(super) fn into_curve(self) -> Vec<CurvePoint> {
        self.curve
    }

    fn follow(&mut self, trainer: &Trainer<'_>, report: &StepReport) -> Result<(), Error> {
        self.error[0] += report.mean_squared_error;
        self.error[1] += 1.0;
        let (step, steps) = (report.step, trainer.config().schedule.steps);
        let due = |every: u64| step.is_multiple_of(every) || step == steps;
        let evaluates = self.args.eval_every.is_some_and(due);
        if evaluates || due((steps / ROWS).max(1)) {
            let test_psnr = evaluates.then(|| self.console.suspend(|| evaluate(&trainer.scene(), self.held_out)));
            self.curve.push(CurvePoint {
                step: trainer.steps_in_all(),
                seconds: trainer.checkpoint().seconds,
                train_psnr: psnr_of_mse(self.error[0] / self.error[1]),
                test_psnr,
            });
            self.error = [0.0; 2];
            self.write_log()?;
        }
        if let Some(watch) = self.watch.as_mut().filter(|watch| step == steps || watch.is_due()) {
            self.console.suspend(|| watch.show(trainer))?;
        }
        Ok(())
    }

    fn write_log(&self) -> Result<(), Error> {
        let Some(path) = &self.args.log else { return Ok(()) };
        let mut text = String::from("step,seconds,train_psnr,test_psnr\n");
        for row in &self.curve {
            let test = row.test_psnr.map_or_else(String::new, |p| format!("{p:.3}"));
            text += &format!("{},{:.1},{:.3},{test}\n", row.step, row.seconds, row.train_psnr);
        }
        // The start of the run checked that the file may be written.
        write_atomically(path, text.as_bytes(), true)
    }
}

impl Observer for CurveObserver<'_> {
    fn message(&mut self, text: &dyn Display) {
        self.console.message(text);
    }

    fn progress(&mut self, progress: Progress<'_>) {
        self.console.progress(progress);
    }

    fn finished(&mut self, summary: &str) {
        self.console.finished(summary);
    }

    fn begin(&mut self, _: &Trainer<'_>) -> Result<(), ObserverError> {
        self.error = [0.0; 2];
        Ok(self.write_log()?)
    }

    fn step(&mut self, trainer: &Trainer<'_>, report: &StepReport) -> Result<(), ObserverError> {
        Ok(self.follow(trainer, report)?)
    }

    fn checkpoint(&mut self, path: &Path) {
        self.console.checkpoint(path);
    }

    fn cache(&self) -> Option<&Cache> {
        self.console.cache()
    }

    fn stop(&self) -> bool {
        self.console.stop()
    }
}

/// The mean PSNR of `scene` over `views`.
fn evaluate(scene: &Scene, views: &[Photograph]) -> f64 {
    let renderer = CpuRenderer::unlimited(scene);
    let background = scene.frame.background;
    let psnr = |view: &Photograph| {
        let picture = renderer.render(&view.camera.mapped(&scene.frame.model_from_dataset));
        let size = [picture.width, picture.height];
        let (photograph, mask) = (view.pixels.colors(background), view.mask.as_deref());
        ViewReport::new(&view.name, size, &colors(&picture), &photograph, mask).map_or(f64::NAN, |r| r.psnr)
    };
    let psnrs: Vec<f64> = views.iter().map(psnr).collect();
    psnrs.iter().sum::<f64>() / psnrs.len() as f64
}
