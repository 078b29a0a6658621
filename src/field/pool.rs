//! Buffers that tasks reuse.

use std::sync::Mutex;

/// Reused values: as many as threads have needed at once.
#[derive(Debug, Default)]
pub struct Pool<S>(Mutex<Vec<S>>);

impl<S: Default> Pool<S> {
    /// Calls `work` with a value that no other task uses meanwhile.
    pub fn with<R>(&self, work: impl FnOnce(&mut S) -> R) -> R {
        // The lock is held for a push or a pop alone, once a task.
        let taken = self.0.lock().expect("no task panics while it holds the lock").pop();
        let mut value = taken.unwrap_or_default();
        let result = work(&mut value);
        self.0.lock().expect("no task panics while it holds the lock").push(value);
        result
    }

    /// Calls `visit` with each value, while none is in use.
    pub fn for_each(&self, visit: impl FnMut(&mut S)) {
        self.0.lock().expect("no task panics while it holds the lock").iter_mut().for_each(visit);
    }
}
