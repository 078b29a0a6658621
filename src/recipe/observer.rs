//! Reports of a training while it runs, and the way to stop it.

use std::fmt::Display;
use std::path::Path;

use super::Cache;
use strivec_train::{StepReport, Trainer};

/// The error with which an observer ends a training.
pub type ObserverError = Box<dyn std::error::Error + Send + Sync>;

/// How far a phase of a training is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Progress<'a> {
    /// Name of the phase: "matching", "prior", "train", "encodings" or "prefixes".
    pub phase: &'a str,
    /// Finished units of `total`; 0 or, in a resumed run, the number of its finished steps as the phase begins.
    pub done: u64,
    /// Units of the phase: steps, or thousandths of the files of a prior.
    pub total: u64,
    /// A text such as "41000 rays/s, train 28.31 dB"; may be empty.
    pub detail: &'a str,
}

/// Receives the reports of a training, on the thread that trains. Every method has a default that does nothing; `()`
/// observes nothing.
///
/// ```
/// use strivec_recipe::{Observer, Progress};
///
/// struct Print;
///
/// impl Observer for Print {
///     fn message(&mut self, text: &dyn std::fmt::Display) {
///         println!("{text}");
///     }
///
///     fn progress(&mut self, Progress { phase, done, total, detail }: Progress<'_>) {
///         println!("{phase}: {done} of {total}, {detail}");
///     }
/// }
/// ```
pub trait Observer {
    /// A message of one line. Settings have the names of [`named_by`](strivec_format::named_by).
    fn message(&mut self, text: &dyn Display) {
        let _ = text;
    }

    /// A phase begins or advances.
    fn progress(&mut self, progress: Progress<'_>) {
        let _ = progress;
    }

    /// The current phase is finished. `summary` is a line about it; it may be empty.
    fn finished(&mut self, summary: &str) {
        let _ = summary;
    }

    /// The steps of `trainer` begin: once for the training, and once more if the scene is then trained for a file size.
    ///
    /// # Errors
    ///
    /// An error ends the training.
    fn begin(&mut self, trainer: &Trainer<'_>) -> Result<(), ObserverError> {
        let _ = trainer;
        Ok(())
    }

    /// A step of `trainer` is done. The time of this call does not count as time of training.
    ///
    /// # Errors
    ///
    /// An error ends the training.
    fn step(&mut self, trainer: &Trainer<'_>, report: &StepReport) -> Result<(), ObserverError> {
        let _ = (trainer, report);
        Ok(())
    }

    /// The checkpoint was written to `path`.
    fn checkpoint(&mut self, path: &Path) {
        let _ = path;
    }

    /// Where results are kept that take long to compute, such as points matched between photographs; `None` keeps nothing.
    fn cache(&self) -> Option<&Cache> {
        None
    }

    /// True to stop. A training then writes its checkpoint, if it has one, and ends with
    /// [`Error::Interrupted`](super::Error::Interrupted).
    fn stop(&self) -> bool {
        false
    }
}

impl Observer for () {}
