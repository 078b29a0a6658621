//! Arrays of NumPy.
#![expect(unsafe_code, reason = "NumPy takes views of memory with their owner")]

use std::io;
use std::sync::Arc;

use numpy::ndarray::{ArrayView, IxDyn};
use numpy::{PyArray1, PyArrayDyn, PyArrayMethods, PyReadonlyArrayDyn, PyUntypedArray, PyUntypedArrayMethods};
use pyo3::exceptions::PyOSError;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use strivec::export::{ArrayReader, ArrayWriter, write_arrays};
use strivec::model::Scene;
use strivec::npy::{Element, Number};

use crate::errors::Failure;

/// Keeps a scene alive while arrays show its numbers.
#[pyclass(frozen)]
struct Owner {
    _scene: Arc<Scene>,
}

/// The arrays of `scene`, by name; those of 32-bit floats show the scene's own memory and are not writable.
pub(crate) fn arrays_of<'py>(py: Python<'py>, scene: &Arc<Scene>) -> PyResult<Bound<'py, PyDict>> {
    let owner = Bound::new(py, Owner { _scene: Arc::clone(scene) })?.into_any();
    let mut writer = Views { owner, arrays: PyDict::new(py) };
    write_arrays(scene, &mut writer).map_err(|e| PyOSError::new_err(e.to_string()))?;
    Ok(writer.arrays)
}

struct Views<'py> {
    owner: Bound<'py, PyAny>,
    arrays: Bound<'py, PyDict>,
}

impl ArrayWriter for Views<'_> {
    fn add<T: Element>(&mut self, name: &str, shape: &[usize], values: impl IntoIterator<Item = T>) -> io::Result<()> {
        let mut bytes = Vec::new();
        values.into_iter().for_each(|value| value.put(&mut bytes));
        let array = PyArray1::from_vec(self.owner.py(), bytes).call_method1("view", (name_of(T::NUMBER),));
        let array = array.and_then(|array| array.call_method1("reshape", (shape,)));
        array.and_then(|array| self.arrays.set_item(name, array)).map_err(io::Error::other)
    }

    fn add_held(&mut self, name: &str, shape: &[usize], values: &[f32]) -> io::Result<()> {
        let view = ArrayView::from_shape(IxDyn(shape), values).map_err(io::Error::other)?;
        // SAFETY: The owner keeps the scene, which nothing changes, and so the numbers in their place.
        let array = unsafe { PyArrayDyn::borrow_from_array(&view, self.owner.clone()) };
        let array = array.readwrite().make_nonwriteable();
        self.arrays.set_item(name, &*array).map_err(io::Error::other)
    }
}

/// NumPy's name of a type of number.
fn name_of(number: Number) -> String {
    match number {
        Number::Bool => "?".into(),
        Number::Signed(bytes) => format!("<i{bytes}"),
        Number::Unsigned(bytes) => format!("<u{bytes}"),
        Number::Float(bytes) => format!("<f{bytes}"),
    }
}

/// `values` as an array of this shape.
pub(crate) fn shaped<'py, T: numpy::Element>(
    py: Python<'py>,
    values: Vec<T>,
    shape: &[usize],
) -> PyResult<Bound<'py, PyAny>> {
    Ok(PyArray1::from_vec(py, values).reshape(IxDyn(shape))?.into_any())
}

/// The points or directions in `array`, contiguous of shape \[n\]\[3\].
pub(crate) fn vectors<'a>(array: &'a PyReadonlyArrayDyn<'_, f64>, name: &str) -> Result<&'a [[f64; 3]], Failure> {
    let [_, 3] = array.shape() else {
        return Err(Failure::usage(format!("{name} must have the shape (n, 3); found {:?}", array.shape())));
    };
    Ok(array.as_slice().map_err(|e| Failure::usage(format!("{name}: {e}")))?.as_chunks().0)
}

/// The arrays of a dictionary of Python.
pub(crate) struct Dictionary<'a, 'py>(pub(crate) &'a Bound<'py, PyDict>);

impl ArrayReader for Dictionary<'_, '_> {
    type Error = Failure;

    fn has(&self, name: &str) -> bool {
        self.0.contains(name).unwrap_or(false)
    }

    fn refusal(&self, message: String) -> Failure {
        Failure::malformed(format!("description: {message}"))
    }

    fn read<T: Element, const N: usize>(
        &self,
        name: &str,
        expected: [Option<usize>; N],
    ) -> Result<([usize; N], Vec<T>), Failure> {
        let malformed = |message: String| Failure::malformed(format!("array {name}: {message}"));
        let array = self.0.get_item(name).ok().flatten().ok_or_else(|| malformed("it is missing".into()))?;
        let untyped = array.cast::<PyUntypedArray>().map_err(|e| malformed(e.to_string()))?;
        let shape = untyped.shape().to_vec();
        if shape.len() != N || !expected.iter().zip(&shape).all(|(e, &n)| e.is_none_or(|e| e == n)) {
            let lengths = expected.map(|e| e.map_or("any".into(), |n| n.to_string())).join(", ");
            return Err(malformed(format!("expected lengths {lengths}; found {shape:?}")));
        }
        let values = match T::NUMBER {
            Number::Bool => numbers::<bool, T>(&array, |v| f64::from(u8::from(v))),
            Number::Unsigned(4) => numbers::<u32, T>(&array, f64::from),
            Number::Float(4) => numbers::<f32, T>(&array, f64::from),
            _ => numbers::<f64, T>(&array, |v| v),
        };
        let values = values.ok_or_else(|| {
            malformed(format!("expected numbers of type {}; found {}", name_of(T::NUMBER), untyped.dtype()))
        })?;
        Ok((shape.try_into().expect("of this many dimensions"), values))
    }
}

/// The numbers of `array` in C order; `None` if they are of another type than `A`.
fn numbers<A: numpy::Element + Copy, T: Element>(
    array: &Bound<'_, PyAny>,
    number: impl Fn(A) -> f64,
) -> Option<Vec<T>> {
    let array: PyReadonlyArrayDyn<'_, A> = array.extract().ok()?;
    Some(array.as_array().iter().map(|&v| T::from_f64(number(v))).collect())
}
