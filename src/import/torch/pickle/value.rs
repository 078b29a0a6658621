//! The values of a pickle.

use std::ops::Range;

use super::globals::{Element, Global};

/// Index of a value.
pub(in crate::import::torch) type Id = u32;

/// A value of a pickle.
#[derive(Clone, Debug)]
pub(in crate::import::torch) enum Value {
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
pub(in crate::import::torch) struct Storage {
    pub(in crate::import::torch) element: Element,
    /// Text: name of the file.
    pub(in crate::import::torch) key: Id,
    /// Number of numbers.
    pub(in crate::import::torch) count: u64,
}

/// A tensor, whose numbers all lie inside its storage.
#[derive(Clone, Debug)]
pub(in crate::import::torch) struct Tensor {
    pub(in crate::import::torch) storage: Storage,
    pub(in crate::import::torch) offset: u64,
    pub(in crate::import::torch) shape: Vec<u64>,
    pub(in crate::import::torch) strides: Vec<u64>,
}

/// A NumPy array or scalar.
#[derive(Clone, Debug)]
pub(in crate::import::torch) struct Array {
    pub(in crate::import::torch) shape: Vec<u64>,
    pub(in crate::import::torch) dtype: Id,
    pub(in crate::import::torch) fortran_order: bool,
    /// Value of the bytes.
    pub(in crate::import::torch) data: Id,
}
