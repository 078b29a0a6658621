//! The bytes of a file or of memory, with the current offset.

use std::fmt;
use std::fs::File;
use std::io::{BufRead, BufReader, Read, Seek, SeekFrom};
use std::path::Path;

use super::{Fault, Visitor};

/// A source of bytes.
trait ByteSource: Read + Seek + Send {}
impl<T: Read + Seek + Send> ByteSource for T {}

/// Bytes between two reports of progress.
const REPORT_EVERY: u64 = 1 << 22;

/// The bytes of a file or of memory.
pub struct Input<'a> {
    source: BufReader<Box<dyn ByteSource + 'a>>,
    offset: u64,
    len: u64,
    reported: u64,
}

impl fmt::Debug for Input<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Input").field("offset", &self.offset).field("len", &self.len).finish_non_exhaustive()
    }
}

impl<'a> Input<'a> {
    /// Opens the file `path`.
    ///
    /// # Errors
    ///
    /// If it cannot be opened or is not a regular file.
    pub fn open(path: &Path) -> Result<Self, Fault> {
        // Before it is opened: a pipe without a writer would block.
        if !std::fs::metadata(path)?.is_file() {
            return Err(Fault::broken("the path", "it is not a regular file"));
        }
        let file = File::open(path)?;
        let length = file.metadata()?.len();
        Ok(Self::new(Box::new(file), length))
    }

    /// Reads from memory.
    pub fn from_bytes(bytes: &'a [u8]) -> Self {
        Self::new(Box::new(std::io::Cursor::new(bytes)), bytes.len() as u64)
    }

    fn new(source: Box<dyn ByteSource + 'a>, len: u64) -> Self {
        Self { source: BufReader::with_capacity(1 << 18, source), offset: 0, len, reported: 0 }
    }

    /// Bytes read so far.
    pub fn offset(&self) -> u64 {
        self.offset
    }

    /// Total number of bytes.
    pub fn len(&self) -> u64 {
        self.len
    }

    /// True if there are no bytes.
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// Bytes after the offset.
    pub fn left(&self) -> u64 {
        self.len.saturating_sub(self.offset)
    }

    /// The offset for errors: "byte N".
    pub fn place(&self) -> String {
        format!("byte {}", self.offset)
    }

    /// Reports progress to the visitor, once every 4 MiB.
    ///
    /// # Errors
    ///
    /// If the visitor returns an error.
    pub fn report(&mut self, visitor: &mut dyn Visitor) -> Result<(), Fault> {
        if self.offset < self.reported + REPORT_EVERY {
            return Ok(());
        }
        self.reported = self.offset;
        visitor.progress(self.offset, self.len)
    }

    /// Fills `bytes` with the next bytes; `what` names them in errors.
    ///
    /// # Errors
    ///
    /// If fewer bytes are left.
    pub fn fill(&mut self, bytes: &mut [u8], what: &str) -> Result<(), Fault> {
        self.expect_left(bytes.len() as u64, what)?;
        self.source.read_exact(bytes)?;
        self.offset += bytes.len() as u64;
        Ok(())
    }

    /// Checks that `bytes` bytes are left. Called before memory is allocated for them.
    ///
    /// # Errors
    ///
    /// If fewer are left.
    pub fn expect_left(&self, bytes: u64, what: &str) -> Result<(), Fault> {
        if bytes <= self.left() {
            return Ok(());
        }
        Err(Fault::malformed(self.place(), format!("{bytes} bytes of {what}"), format!("{} bytes", self.left())))
    }

    /// The next bytes as an array.
    ///
    /// # Errors
    ///
    /// If fewer are left.
    pub fn array<const N: usize>(&mut self, what: &str) -> Result<[u8; N], Fault> {
        let mut bytes = [0; N];
        self.fill(&mut bytes, what)?;
        Ok(bytes)
    }

    /// Reads the next line without its end, LF or CRLF. Returns false at the end of the input. The limit of `most`
    /// bytes keeps a file without line ends from filling the memory.
    ///
    /// # Errors
    ///
    /// If a line is too long.
    pub fn line(&mut self, line: &mut Vec<u8>, most: usize) -> Result<bool, Fault> {
        self.line_until(line, most, b'\n')
    }

    /// [`Input::line`] for lines that end in the byte `end`.
    ///
    /// # Errors
    ///
    /// If a line is too long.
    pub fn line_until(&mut self, line: &mut Vec<u8>, most: usize, end: u8) -> Result<bool, Fault> {
        line.clear();
        let place = self.offset;
        let read = (&mut self.source).take(most as u64 + 1).read_until(end, line)?;
        self.offset += read as u64;
        if read == 0 {
            return Ok(false);
        }
        if line.last() == Some(&end) {
            line.pop();
        } else if line.len() > most {
            return Err(Fault::broken(format!("byte {place}"), format!("the line is longer than {most} bytes")));
        }
        if line.last() == Some(&b'\r') {
            line.pop();
        }
        Ok(true)
    }

    /// The next bytes, at most `most`, without moving the offset.
    ///
    /// # Errors
    ///
    /// If the operating system cannot read the file.
    pub fn peek(&mut self, most: usize) -> Result<Vec<u8>, Fault> {
        let most = (most as u64).min(self.left()) as usize;
        let mut bytes = vec![0; most];
        self.source.read_exact(&mut bytes)?;
        self.source.seek_relative(-(most as i64))?;
        Ok(bytes)
    }

    /// Moves to `offset`.
    ///
    /// # Errors
    ///
    /// If it lies beyond the end.
    pub fn go_to(&mut self, offset: u64) -> Result<(), Fault> {
        if offset > self.len {
            return Err(Fault::malformed(
                format!("byte {offset}"),
                "an offset inside the file",
                format!("a file of {} bytes", self.len),
            ));
        }
        self.source.seek_relative(offset as i64 - self.offset as i64)?;
        self.offset = offset;
        Ok(())
    }
}

/// The `N` bytes from `at` on of a record, which must be long enough.
pub(super) fn bytes_at<const N: usize>(record: &[u8], at: usize) -> [u8; N] {
    std::array::from_fn(|n| record[at + n])
}

/// For libraries that take a reader.
impl Read for Input<'_> {
    fn read(&mut self, bytes: &mut [u8]) -> std::io::Result<usize> {
        let read = self.source.read(bytes)?;
        self.offset += read as u64;
        Ok(read)
    }
}

/// For readers that search the buffer for ends of words and lines.
impl BufRead for Input<'_> {
    fn fill_buf(&mut self) -> std::io::Result<&[u8]> {
        self.source.fill_buf()
    }

    fn consume(&mut self, amount: usize) {
        self.source.consume(amount);
        self.offset += amount as u64;
    }
}

impl Seek for Input<'_> {
    /// Keeps the buffer if the target lies in it: readers of archives seek every few bytes.
    fn seek(&mut self, to: SeekFrom) -> std::io::Result<u64> {
        let to = match to {
            SeekFrom::Start(to) => i128::from(to),
            SeekFrom::Current(by) => i128::from(self.offset) + i128::from(by),
            SeekFrom::End(by) => i128::from(self.len) + i128::from(by),
        };
        let outside = || std::io::Error::new(std::io::ErrorKind::InvalidInput, "an offset outside the file");
        let to = i64::try_from(to).ok().filter(|&to| to >= 0).ok_or_else(outside)?;
        self.source.seek_relative(to - self.offset as i64)?;
        self.offset = to as u64;
        Ok(self.offset)
    }
}
