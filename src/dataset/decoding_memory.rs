//! Memory for decoding pictures, shared by the threads that decode: each waits until there is enough for its picture.

use std::path::Path;
use std::sync::{Condvar, Mutex, PoisonError};

use super::Error;

/// A number of bytes for decoding.
#[derive(Debug)]
pub(super) struct DecodingMemory {
    limit: u64,
    used: Mutex<u64>,
    freed: Condvar,
}

/// Bytes for one picture, given back when they are dropped.
#[derive(Debug)]
pub(super) struct HeldMemory<'a> {
    memory: &'a DecodingMemory,
    bytes: u64,
}

impl DecodingMemory {
    pub(super) fn new(limit: u64) -> Self {
        Self { limit, used: Mutex::new(0), freed: Condvar::new() }
    }

    /// Checks that `bytes` are at most the limit. They are for decoding the picture at `path`.
    pub(super) fn check(&self, path: &Path, bytes: u64) -> Result<(), Error> {
        if bytes > self.limit {
            return Err(Error::DecodingMemory { path: path.to_path_buf(), limit: self.limit, found: bytes });
        }
        Ok(())
    }

    /// Takes `bytes` to decode the picture at `path`, once enough are free.
    pub(super) fn take(&self, path: &Path, bytes: u64) -> Result<HeldMemory<'_>, Error> {
        self.check(path, bytes)?;
        let used = self.used.lock().unwrap_or_else(PoisonError::into_inner);
        // No picture waits for another while it holds memory, so that some thread always goes on.
        let is_full = |used: &mut u64| bytes > self.limit - *used;
        let mut used = self.freed.wait_while(used, is_full).unwrap_or_else(PoisonError::into_inner);
        *used += bytes;
        Ok(HeldMemory { memory: self, bytes })
    }
}

impl Drop for HeldMemory<'_> {
    fn drop(&mut self) {
        *self.memory.used.lock().unwrap_or_else(PoisonError::into_inner) -= self.bytes;
        self.memory.freed.notify_all();
    }
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicU64, Ordering};

    use super::*;

    #[test]
    fn threads_together_hold_at_most_the_limit() {
        let memory = DecodingMemory::new(10);
        let [held, most] = [AtomicU64::new(0), AtomicU64::new(0)];
        std::thread::scope(|scope| {
            for bytes in [1, 4, 5, 6, 10, 3, 7, 2] {
                let (memory, held, most) = (&memory, &held, &most);
                scope.spawn(move || {
                    for _ in 0..100 {
                        let taken = memory.take(Path::new("a.png"), bytes).unwrap();
                        most.fetch_max(held.fetch_add(bytes, Ordering::SeqCst) + bytes, Ordering::SeqCst);
                        held.fetch_sub(bytes, Ordering::SeqCst);
                        drop(taken);
                    }
                });
            }
        });
        assert!((1..=10).contains(&most.into_inner()));
        let error = memory.take(Path::new("a.png"), 11).unwrap_err();
        assert!(error.to_string().starts_with("a.png: decoding the picture takes"), "{error}");
    }
}
