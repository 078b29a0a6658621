//! Sources of a file's bytes: memory, files, servers.

use std::borrow::Cow;
use std::io::{Read, Seek, SeekFrom};
use std::ops::Range;
use std::sync::Mutex;

use super::error::Error;

/// A file that can be read by ranges of bytes: in memory, on disk, on a server.
pub trait Source {
    /// The bytes of `range`; fewer, from its start, if the file ends within it.
    ///
    /// # Errors
    ///
    /// [`Error::Source`] if they cannot be read.
    fn read(&self, range: Range<u64>) -> Result<Cow<'_, [u8]>, Error>;
}

impl Source for &[u8] {
    fn read(&self, range: Range<u64>) -> Result<Cow<'_, [u8]>, Error> {
        let [start, end] = [range.start, range.end].map(|at| at.min(self.len() as u64) as usize);
        Ok(Cow::Borrowed(&self[start..end]))
    }
}

/// A file, or anything else that implements [`Read`] and [`Seek`].
#[derive(Debug)]
pub struct Seekable<R>(Mutex<R>);

impl<R> Seekable<R> {
    /// Reads from `inner`.
    pub fn new(inner: R) -> Self {
        Self(Mutex::new(inner))
    }
}

impl<R: Read + Seek> Source for Seekable<R> {
    fn read(&self, range: Range<u64>) -> Result<Cow<'_, [u8]>, Error> {
        let failed = |error: std::io::Error| Error::Source { range: range.clone(), message: error.to_string() };
        // After a panic while the lock was held, seeking anew is enough.
        let mut inner = self.0.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        inner.seek(SeekFrom::Start(range.start)).map_err(failed)?;
        // Grows as bytes arrive: the length is untrusted.
        let mut bytes = Vec::new();
        (&mut *inner).take(range.end - range.start).read_to_end(&mut bytes).map_err(failed)?;
        Ok(Cow::Owned(bytes))
    }
}

/// A function that returns the bytes of a range, for example from a server.
#[derive(Debug)]
pub struct Fetch<F>(pub F);

impl<F: Fn(Range<u64>) -> Result<Vec<u8>, String>> Source for Fetch<F> {
    fn read(&self, range: Range<u64>) -> Result<Cow<'_, [u8]>, Error> {
        let bytes = (self.0)(range.clone()).map_err(|message| Error::Source { range: range.clone(), message })?;
        let wanted = bytes.len().min((range.end - range.start) as usize);
        Ok(Cow::Owned(bytes[..wanted].to_vec()))
    }
}
