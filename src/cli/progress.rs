//! Progress of long tasks on standard error: a bar on a terminal, else a line every few seconds.

use std::io::IsTerminal;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use indicatif::{HumanDuration, ProgressBar, ProgressDrawTarget, ProgressStyle};

use super::console::Console;
use super::time_left::TimeLeft;
use strivec_format::escape::escaped;

/// The time between two lines if standard error is no terminal.
const LINE_EVERY: Duration = Duration::from_secs(10);
/// The time between two reports to a host.
const REPORT_EVERY: Duration = Duration::from_millis(200);
const BAR: &str = "{prefix} {wide_bar} {pos}/{len}{msg}";

/// The progress of one task.
pub(super) struct Progress<'a> {
    console: &'a Console,
    task: String,
    bar: ProgressBar,
    time_left: Mutex<TimeLeft>,
    /// The time of the last line, or report to the host; `None` if there is a bar or the console is quiet.
    last_line: Option<Mutex<Instant>>,
}

impl<'a> Progress<'a> {
    /// Starts to show `task` of `total` steps; shows nothing if the console is quiet.
    pub(super) fn start(console: &'a Console, task: &str, total: u64) -> Self {
        let terminal = console.host().is_none() && std::io::stderr().is_terminal();
        let shown = terminal && !console.is_quiet();
        let target = if shown { ProgressDrawTarget::stderr_with_hz(5) } else { ProgressDrawTarget::hidden() };
        let bar = ProgressBar::with_draw_target(Some(total), target);
        bar.set_style(ProgressStyle::with_template(BAR).expect("a valid template").progress_chars("=> "));
        bar.set_prefix(task.to_owned());
        let last_line = (!terminal && !console.is_quiet()).then(|| Mutex::new(Instant::now()));
        Self { console, task: task.to_owned(), bar, time_left: Mutex::default(), last_line }
    }

    /// The name of the task.
    pub(super) fn task(&self) -> &str {
        &self.task
    }

    /// Shows `done` steps and `detail`, such as "41000 rays/s, train 28.31 dB".
    pub(super) fn set(&self, done: u64, detail: impl Fn() -> String) {
        let total = self.bar.length().unwrap_or(done);
        self.time_left().note(Instant::now(), done);
        let text = || {
            let left = self.time_left().of(total.saturating_sub(done));
            let left = left.map_or_else(String::new, |left| format!(", {} left", HumanDuration(left)));
            format!("{}{left}", with_comma(&detail()))
        };
        if !self.bar.is_hidden() {
            self.bar.set_message(escaped(&text()));
        }
        self.bar.set_position(done);
        if let Some(last_line) = &self.last_line {
            let mut last = last_line.lock().unwrap_or_else(PoisonError::into_inner);
            let host = self.console.host();
            if last.elapsed() < if host.is_some() { REPORT_EVERY } else { LINE_EVERY } {
                return;
            }
            *last = Instant::now();
            match host {
                Some(host) => host.progress(&self.task, done, total, &escaped(&detail())),
                None => self.console.say(&format!("{}: {done}/{total}{}", self.task, text())),
            }
        }
    }

    fn time_left(&self) -> MutexGuard<'_, TimeLeft> {
        self.time_left.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Restarts the estimate of the remaining time, after other work.
    pub(super) fn reset_rate(&self) {
        self.time_left().reset();
    }

    /// Prints a message above the bar.
    pub(super) fn say(&self, message: &str) {
        self.suspend(|| self.console.say(message));
    }

    /// Calls `work`, which writes to standard error, while there is no bar.
    pub(super) fn suspend<R>(&self, work: impl FnOnce() -> R) -> R {
        self.bar.suspend(work)
    }

    /// Ends the task and removes the bar.
    pub(super) fn clear(self) {
        self.bar.finish_and_clear();
    }

    /// Ends the task, removes the bar, and prints a message.
    pub(super) fn finish(self, message: &str) {
        self.bar.finish_and_clear();
        self.say(message);
    }
}

fn with_comma(detail: &str) -> String {
    if detail.is_empty() { String::new() } else { format!(", {detail}") }
}
