//! Long work, outside of the interpreter's lock, that Ctrl-C ends.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::process;
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::thread;
use std::time::Duration;

use pyo3::prelude::*;

use crate::errors::Failure;

/// How often the interpreter looks for Ctrl-C.
const CHECK_EVERY: Duration = Duration::from_millis(50);

/// The process that did the first work, and so has the threads of the pool; 0 before.
static OWNER: AtomicU32 = AtomicU32::new(0);

/// Does `work` on a thread of its own while other threads of Python run. Ctrl-C raises at once; the work, which holds nothing
/// but memory, then ends unseen.
pub(crate) fn detached<T: Send + 'static>(
    py: Python<'_>,
    work: impl FnOnce() -> Result<T, Failure> + Send + 'static,
) -> PyResult<T> {
    let (sender, mut receiver) = channel();
    spawn(move || {
        // Nobody receives after Ctrl-C.
        let _ = sender.send(caught(work));
    })?;
    loop {
        if let Some(result) = next(py, &mut receiver)? {
            return Ok(result?);
        }
        py.check_signals()?;
    }
}

/// Calls `work`, and turns a panic into a failure. All work that may use the pool of threads is done here, or fails at once in a
/// forked process.
pub(crate) fn caught<T>(work: impl FnOnce() -> Result<T, Failure>) -> Result<T, Failure> {
    check_process()?;
    catch_unwind(AssertUnwindSafe(work)).unwrap_or_else(|payload| Err(Failure::of_panic(payload.as_ref())))
}

/// Fails in a process that was forked after the first work: a fork copies no threads, so work would wait for the pool forever.
fn check_process() -> Result<(), Failure> {
    let here = process::id();
    match OWNER.compare_exchange(0, here, Ordering::Relaxed, Ordering::Relaxed) {
        Err(owner) if owner != here => Err(Failure::runtime(format!(
            "this process was forked from process {owner} after strivec had started threads there, and a fork copies no threads; \
             use the start method \"spawn\" or \"forkserver\" of multiprocessing, or use strivec only in the forked processes"
        ))),
        _ => Ok(()),
    }
}

/// Starts a thread.
pub(crate) fn spawn(work: impl FnOnce() + Send + 'static) -> Result<(), Failure> {
    let started = thread::Builder::new().name("strivec".into()).spawn(work);
    started.map(drop).map_err(|e| Failure::runtime(format!("cannot start a thread: {e}")))
}

/// The next message from a thread of work; `None` if there is none for a while.
pub(crate) fn next<T: Send>(py: Python<'_>, receiver: &mut Receiver<T>) -> Result<Option<T>, Failure> {
    match py.detach(move || receiver.recv_timeout(CHECK_EVERY)) {
        Ok(message) => Ok(Some(message)),
        Err(RecvTimeoutError::Timeout) => Ok(None),
        Err(RecvTimeoutError::Disconnected) => Err(Failure::runtime("the work's thread ended without a result")),
    }
}
