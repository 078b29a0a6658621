//! The values that a pickle makes.

use std::ops::Range;

use super::globals::{Element, Global};

/// A value's number.
pub(in crate::import::torch) type Id = u32;

/// What a pickle holds.
#[derive(Clone, Debug)]
pub(in crate::import::torch) enum Value {
    /// Something of which nothing is needed.
    Opaque,
    Bool(bool),
    Int(i64),
    Float(f64),
    /// UTF-8, in the pickle.
    Text(Range<usize>),
    /// In the pickle.
    Bytes(Range<usize>),
    /// Bytes, one each of the characters of this text.
    Latin1(Range<usize>),
    /// A tuple or a list.
    Items(Vec<Id>),
    /// A dictionary, in its order.
    Dict(Vec<(Id, Id)>),
    Global(Global),
    Storage(Storage),
    Tensor(Tensor),
    /// NumPy's `dtype`: its name, and its order of bytes where it has one.
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
    /// Text: the file's name.
    pub(in crate::import::torch) key: Id,
    /// Numbers.
    pub(in crate::import::torch) count: u64,
}

/// A tensor: all of its numbers lie inside its storage.
#[derive(Clone, Debug)]
pub(in crate::import::torch) struct Tensor {
    pub(in crate::import::torch) storage: Storage,
    pub(in crate::import::torch) offset: u64,
    pub(in crate::import::torch) shape: Vec<u64>,
    pub(in crate::import::torch) strides: Vec<u64>,
}

/// A NumPy array, or one number of its kind.
#[derive(Clone, Debug)]
pub(in crate::import::torch) struct Array {
    pub(in crate::import::torch) shape: Vec<u64>,
    pub(in crate::import::torch) dtype: Id,
    pub(in crate::import::torch) fortran_order: bool,
    /// Bytes.
    pub(in crate::import::torch) data: Id,
}
