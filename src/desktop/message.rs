//! Messages over the picture.

use std::time::{Duration, Instant};

/// Display time of a note.
const NOTE_TIME: Duration = Duration::from_secs(6);
/// Display time of an error.
const ERROR_TIME: Duration = Duration::from_secs(20);

/// A message.
pub(super) struct Message {
    pub(super) text: String,
    pub(super) is_error: bool,
    ends_at: Instant,
}

impl Message {
    /// A note about a finished action.
    pub(super) fn note(text: String) -> Self {
        Self { text, is_error: false, ends_at: Instant::now() + NOTE_TIME }
    }

    /// An error.
    pub(super) fn error(text: String) -> Self {
        Self { text, is_error: true, ends_at: Instant::now() + ERROR_TIME }
    }

    /// Remaining display time; `None` if it is over.
    pub(super) fn time_left(&self) -> Option<Duration> {
        self.ends_at.checked_duration_since(Instant::now()).filter(|left| !left.is_zero())
    }
}
