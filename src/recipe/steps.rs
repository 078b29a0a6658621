//! The steps of a training, with progress, checkpoints and stopping.

use std::time::Instant;

use super::{CheckpointFile, Error, Observer, Progress};
use strivec_format::digits::plural;
use strivec_format::psnr::RunningMse;
use strivec_train::pack::steer_to_size;
use strivec_train::{StepReport, Trainer};

/// Does the remaining steps of `trainer`, with what a training for a file size changes after each of them. Their time is
/// added to the trainer's.
///
/// # Errors
///
/// [`Error::Train`] if the run diverges, [`Error::Interrupted`] if `observer` stops it before its last step, and the
/// errors of `observer` and of writing `checkpoint`.
pub fn run_steps(
    trainer: &mut Trainer<'_>,
    checkpoint: Option<&CheckpointFile>,
    observer: &mut dyn Observer,
) -> Result<(), Error> {
    let steps = trainer.config().schedule.steps;
    observer.begin(trainer).map_err(Error::Observer)?;
    let mut meter = Meter::start(trainer, observer);
    while trainer.steps_done() < steps {
        let begun = Instant::now();
        let report = trainer.step()?;
        steer_to_size(trainer)?;
        let seconds = begun.elapsed().as_secs_f64();
        trainer.add_seconds(seconds);
        meter.add(&report, seconds, trainer, observer);
        observer.step(trainer, &report).map_err(Error::Observer)?;
        let stops = observer.stop() && report.step < steps;
        if let Some(checkpoint) = checkpoint {
            checkpoint.follow(trainer, stops, observer)?;
        }
        if stops {
            let checkpoint = checkpoint.map(|checkpoint| checkpoint.path.clone());
            return Err(Error::Interrupted { step: report.step, checkpoint });
        }
    }
    observer.finished(&format!("train: {:.2} dB on the last rays", meter.error.psnr()));
    Ok(())
}

/// Progress of the steps.
struct Meter {
    /// Time of the steps, without other work.
    seconds: f64,
    first_step: u64,
    error: RunningMse,
    /// The exposures of photographs are fitted.
    maps_colors: bool,
}

impl Meter {
    fn start(trainer: &Trainer<'_>, observer: &mut dyn Observer) -> Self {
        let (done, total) = (trainer.steps_done(), trainer.config().schedule.steps);
        observer.progress(Progress { phase: "train", done, total, detail: "" });
        Self { seconds: 0.0, first_step: done, error: RunningMse::default(), maps_colors: false }
    }

    fn add(&mut self, report: &StepReport, seconds: f64, trainer: &Trainer<'_>, observer: &mut dyn Observer) {
        self.error.add(report.mean_squared_error);
        self.seconds += seconds;
        let config = trainer.config();
        let rays = (report.step - self.first_step) * config.sampling.batch_rays as u64;
        let detail = format!("{:.0} rays/s, train {:.2} dB", rays as f64 / self.seconds, self.error.psnr());
        observer.progress(Progress {
            phase: "train",
            done: report.step,
            total: config.schedule.steps,
            detail: &detail,
        });
        let photographs = trainer.checkpoint().exposures.maps().len();
        if photographs > 0 && !self.maps_colors {
            self.maps_colors = true;
            let count = plural(photographs, "photograph");
            observer.message(&format_args!("exposure: fitted for {count}; the scene has the colors of their mean"));
        }
    }
}
