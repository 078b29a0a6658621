//! The values of a pickle.

use std::ops::Range;

use super::globals::{Element, Global};

/// Index of a value.
pub(crate) type Id = u32;

/// A value of a pickle.
#[derive(Clone, Debug)]
pub(crate) enum Value {
    /// An unused value.
    Opaque,
    Bool(bool),
    Int(i64),
    Float(f64),
    /// Range of UTF-8 text in the pickle.
    Text(Range<usize>),
    /// Range of bytes in the pickle.
    Bytes(Range<usize>),
    /// Bytes stored as a text, one character each.
    Latin1(Range<usize>),
    /// A tuple or a list.
    Items(Vec<Id>),
    /// Pairs of a dictionary, in order.
    Dict(Vec<(Id, Id)>),
    Global(Global),
    Storage(Storage),
    Tensor(Tensor),
    /// NumPy's `dtype`: its name, and its byte order if it has one.
    Dtype {
        name: Id,
        order: Option<Id>,
    },
    Array(Array),
}

/// Numbers in a file of the archive.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Storage {
    pub(crate) element: Element,
    /// Text: name of the file.
    pub(crate) key: Id,
    /// Number of numbers.
    pub(crate) count: u64,
}

/// A tensor, whose numbers all lie inside its storage.
#[derive(Clone, Debug)]
pub(crate) struct Tensor {
    pub(crate) storage: Storage,
    pub(crate) offset: u64,
    pub(crate) shape: Vec<u64>,
    pub(crate) strides: Vec<u64>,
}

/// A NumPy array or scalar.
#[derive(Clone, Debug)]
pub(crate) struct Array {
    pub(crate) shape: Vec<u64>,
    pub(crate) dtype: Id,
    pub(crate) fortran_order: bool,
    /// Value of the bytes.
    pub(crate) data: Id,
}
