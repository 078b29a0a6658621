//! Messages and progress of a training on the console.

use std::fmt::Display;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};

use super::console::Console;
use super::error::with_flags;
use super::progress::Progress;
use strivec_recipe as recipe;
use strivec_recipe::{Cache, Observer};

/// Shows a training on the console, and stops it when a flag is set.
pub(super) struct ConsoleObserver<'a> {
    console: &'a Console,
    interrupted: &'a AtomicBool,
    /// Where results are kept between runs.
    cache: Option<Cache>,
    /// The current phase.
    progress: Option<Progress<'a>>,
}

impl<'a> ConsoleObserver<'a> {
    /// Stops if `interrupted` becomes true.
    pub(super) fn new(console: &'a Console, interrupted: &'a AtomicBool) -> Self {
        Self { console, interrupted, cache: Cache::of_user(), progress: None }
    }

    /// For commands that Ctrl-C ends at once because they have nothing to save.
    pub(super) fn unstoppable(console: &'a Console) -> Self {
        static NEVER: AtomicBool = AtomicBool::new(false);
        Self::new(console, &NEVER)
    }

    /// Calls `work`, which writes to standard error, and leaves its time out of the estimate of the remaining time.
    pub(super) fn suspend<R>(&self, work: impl FnOnce() -> R) -> R {
        let Some(progress) = &self.progress else { return work() };
        let result = progress.suspend(work);
        progress.reset_rate();
        result
    }
}

impl Observer for ConsoleObserver<'_> {
    fn message(&mut self, text: &dyn Display) {
        self.suspend(|| self.console.say(&with_flags(text)));
    }

    fn progress(&mut self, progress: recipe::Progress<'_>) {
        let recipe::Progress { phase, done, total, detail } = progress;
        let shown = match self.progress.take() {
            Some(shown) if shown.task() == phase => shown,
            _ => Progress::start(self.console, phase, total),
        };
        shown.set(done, || detail.to_owned());
        self.progress = Some(shown);
    }

    fn finished(&mut self, summary: &str) {
        match self.progress.take() {
            Some(progress) if summary.is_empty() => progress.clear(),
            Some(progress) => progress.finish(summary),
            None if summary.is_empty() => (),
            None => self.console.say(summary),
        }
    }

    fn checkpoint(&mut self, _: &Path) {
        self.suspend(|| ());
    }

    fn cache(&self) -> Option<&Cache> {
        self.cache.as_ref()
    }

    fn stop(&self) -> bool {
        self.interrupted.load(Ordering::SeqCst)
    }
}
