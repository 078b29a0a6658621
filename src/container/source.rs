//! Where a file's bytes come from.

use std::borrow::Cow;
use std::io::{Read, Seek, SeekFrom};
use std::ops::Range;
use std::sync::Mutex;

use super::Error;

/// Anything that answers ranges of bytes: memory, a file, a server.
pub trait Source {
    /// The bytes of `range`, or those of them that there are, from its start.
    ///
    /// # Errors
    ///
    /// [`Error::Source`] where they cannot be had.
    fn read(&self, range: Range<u64>) -> Result<Cow<'_, [u8]>, Error>;
}

impl Source for &[u8] {
    fn read(&self, range: Range<u64>) -> Result<Cow<'_, [u8]>, Error> {
        let [start, end] = [range.start, range.end].map(|at| at.min(self.len() as u64) as usize);
        Ok(Cow::Borrowed(&self[start..end]))
    }
}

/// A file, or whatever else can be read and sought.
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
        // A reader that panicked half-way is only sought anew.
        let mut inner = self.0.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        inner.seek(SeekFrom::Start(range.start)).map_err(failed)?;
        // Grows as bytes come: the length may be a lie.
        let mut bytes = Vec::new();
        (&mut *inner).take(range.end - range.start).read_to_end(&mut bytes).map_err(failed)?;
        Ok(Cow::Owned(bytes))
    }
}

/// A function that answers ranges, such as one that asks a server.
#[derive(Debug)]
pub struct Fetch<F>(pub F);

impl<F: Fn(Range<u64>) -> Result<Vec<u8>, String>> Source for Fetch<F> {
    fn read(&self, range: Range<u64>) -> Result<Cow<'_, [u8]>, Error> {
        let bytes = (self.0)(range.clone()).map_err(|message| Error::Source { range: range.clone(), message })?;
        let wanted = bytes.len().min((range.end - range.start) as usize);
        Ok(Cow::Owned(bytes[..wanted].to_vec()))
    }
}
