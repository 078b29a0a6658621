//! NumPy's `.npy` arrays and `.npz` archives: a reader for untrusted input and a writer.
//!
//! The format is that of NumPy's NEP 1: a magic number, a version, a header, and the numbers one after another.

mod read;
mod write;

use std::io;

use strivec_format::Invalid;

pub use read::number_of;
pub use write::{Element, NpzWriter, write};

/// An array's type and shape.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Header {
    /// Type of each number.
    pub number: Number,
    /// True if the bytes of a number come most significant first.
    pub big_endian: bool,
    /// True if the first axis varies fastest, false if the last does.
    pub fortran_order: bool,
    /// Length of each axis; empty for a single number.
    pub shape: Vec<u64>,
    /// Product of the lengths.
    pub count: u64,
}

/// The type of an array's numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Number {
    /// `?`
    Bool,
    /// `i` of this number of bytes.
    Signed(u8),
    /// `u` of this number of bytes.
    Unsigned(u8),
    /// `f` of this number of bytes.
    Float(u8),
}

/// An error of reading an array.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum NpyError {
    /// The input failed or ended.
    #[error("cannot read the array: {0}")]
    Io(#[from] io::Error),
    /// NumPy does not write such a file.
    #[error("the array's {0}; save the array with `numpy.save`")]
    Malformed(Invalid),
}
