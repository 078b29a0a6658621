//! Messages over the picture.

use std::time::{Duration, Instant};

/// How long a note is shown.
const NOTE_TIME: Duration = Duration::from_secs(6);
/// How long an error is shown.
const ERROR_TIME: Duration = Duration::from_secs(20);

/// A message.
pub(super) struct Message {
    pub(super) text: String,
    pub(super) is_error: bool,
    ends_at: Instant,
}

impl Message {
    /// Something was done.
    pub(super) fn note(text: String) -> Self {
        Self { text, is_error: false, ends_at: Instant::now() + NOTE_TIME }
    }

    /// Something failed.
    pub(super) fn error(text: String) -> Self {
        Self { text, is_error: true, ends_at: Instant::now() + ERROR_TIME }
    }

    /// For how long it is still shown; `None` if its time is over.
    pub(super) fn time_left(&self) -> Option<Duration> {
        self.ends_at.checked_duration_since(Instant::now()).filter(|left| !left.is_zero())
    }
}
