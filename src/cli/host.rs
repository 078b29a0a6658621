//! Commands within another program, which gets their results, messages and progress instead of a console.

use std::fmt;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// The program that a command runs within.
pub trait Host: Send + Sync {
    /// Takes a message of one line, which has no character that moves a cursor or hides text.
    fn message(&self, text: &str);

    /// Learns that `done` of the `total` steps of `task` are done, several times a second at most; `detail` is a text such as
    /// "41000 rays/s, train 28.31 dB".
    fn progress(&self, task: &str, done: u64, total: u64, detail: &str);
}

/// A call of a command from its host.
#[derive(Clone)]
pub struct Call {
    /// The program that is told.
    pub host: Arc<dyn Host>,
    /// Set by the host to end the command as Ctrl-C does: long commands keep what is done, and fail.
    pub interrupted: Arc<AtomicBool>,
}

impl fmt::Debug for Call {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Call").field("interrupted", &self.interrupted).finish_non_exhaustive()
    }
}
