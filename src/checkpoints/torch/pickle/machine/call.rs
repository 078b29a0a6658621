//! The values that calls of known functions create.

use std::ops::Range;

use super::super::globals::{Global, known};
use super::super::{Array, Id, Storage, Tensor, Value};
use super::{MAX_NAME, Machine};
use strivec_import::Fault;

/// Axes of a tensor or an array (NumPy's own limit).
const MAX_AXES: usize = 64;

impl Machine<'_> {
    /// Pushes the value that a call of `function` creates.
    pub(super) fn call(&mut self, function: Id, arguments: Id) -> Result<(), Fault> {
        let Value::Global(global) = *self.value(function) else {
            return Err(self.malformed("a function to call", "something else"));
        };
        let arguments = self.items(arguments)?;
        let made = match (global, arguments.as_slice()) {
            (Global::Dict, []) => Value::Dict(Vec::new()),
            (Global::Same, &[same, ..]) => {
                self.stack.push(same);
                return Ok(());
            }
            (Global::Ignored, _) => Value::Opaque,
            (Global::Tensor, &[storage, offset, shape, strides, ..]) => self.tensor(storage, offset, shape, strides)?,
            (Global::Reconstruct, [..]) => {
                let nothing = self.add(Value::Opaque)?;
                Value::Array(Array { shape: vec![0], dtype: nothing, fortran_order: false, data: nothing })
            }
            (Global::FromBuffer, &[data, dtype, shape, order]) => {
                let shape = self.lengths(shape)?;
                let order = self.range_of_text(order)?;
                Value::Array(Array { shape, dtype, fortran_order: &self.bytes[order] == b"F", data })
            }
            (Global::Dtype, &[name, ..]) => Value::Dtype { name, order: None },
            (Global::Scalar, &[dtype, data]) => {
                Value::Array(Array { shape: Vec::new(), dtype, fortran_order: false, data })
            }
            (Global::Encode, &[text, encoding]) => {
                let encoding = self.range_of_text(encoding)?;
                if !matches!(&self.bytes[encoding], b"latin1" | b"latin-1") {
                    return Err(self.malformed("the encoding latin1", "another one"));
                }
                Value::Latin1(self.range_of_text(text)?)
            }
            (Global::Bytes, []) => Value::Bytes(0..0),
            (global, arguments) => {
                let found = format!("{} arguments of {global:?}", arguments.len());
                return Err(self.malformed("the arguments that torch passes", found));
            }
        };
        self.push(made)
    }

    /// Sets the state of the value on top of the stack.
    pub(super) fn build(&mut self, state: Id) -> Result<(), Fault> {
        let on = self.top()?;
        // No value is cloned: one of them may be a list of a million items.
        match self.value(on) {
            // (version, shape, type, order, bytes)
            Value::Array(_) => {
                let state = self.items(state)?;
                let &[_, shape, dtype, order, data] = state.as_slice() else {
                    return Err(self.malformed("an array's five parts", state.len()));
                };
                let fortran_order = match self.value(order) {
                    Value::Bool(order) => *order,
                    Value::Int(order) => *order != 0,
                    _ => return Err(self.malformed("an array's order", "something else")),
                };
                let shape = self.lengths(shape)?;
                self.values[on as usize] = Value::Array(Array { shape, dtype, fortran_order, data });
            }
            // (version, order of bytes, …)
            &Value::Dtype { name, .. } => {
                let state = self.items(state)?;
                let order = state.get(1).copied();
                self.values[on as usize] = Value::Dtype { name, order };
            }
            // Attributes of dictionaries: `_metadata`.
            _ => {}
        }
        Ok(())
    }

    /// The storage of the tuple `id`: ("storage", class, key, device, length).
    pub(super) fn storage(&mut self, id: Id) -> Result<Value, Fault> {
        let parts = self.items(id)?;
        if let &[_, class, key, _, count, ..] = parts.as_slice()
            && let (Value::Global(Global::Storage(element)), &Value::Int(count)) =
                (self.value(class), self.value(count))
            && let (Ok(count), Value::Text(_)) = (u64::try_from(count), self.value(key))
        {
            return Ok(Value::Storage(Storage { element: *element, key, count }));
        }
        Err(self.malformed("a storage of a known type, its key and its length", "something else"))
    }

    fn tensor(&self, storage: Id, offset: Id, shape: Id, strides: Id) -> Result<Value, Fault> {
        let (&Value::Storage(storage), &Value::Int(offset)) = (self.value(storage), self.value(offset)) else {
            return Err(self.malformed("a tensor's storage and offset", "something else"));
        };
        let (shape, strides) = (self.lengths(shape)?, self.lengths(strides)?);
        let count = storage.count;
        // One past the last number.
        let end = || {
            let steps = shape.iter().zip(&strides).map(|(n, stride)| (n - 1).checked_mul(*stride));
            let last = steps.into_iter().try_fold(0_u64, |sum, step| sum.checked_add(step?))?;
            last.checked_add(u64::try_from(offset).ok()?)?.checked_add(1)
        };
        let inside = shape.contains(&0) || end().is_some_and(|end| end <= count);
        let countable = shape.iter().try_fold(1_u64, |all, n| all.checked_mul(*n)).is_some();
        if shape.len() != strides.len() || offset < 0 || !inside || !countable {
            let found = format!("offset {offset}, shape {shape:?}, strides {strides:?}");
            return Err(self.malformed(&format!("a tensor inside its storage of {count} numbers"), found));
        }
        Ok(Value::Tensor(Tensor { storage, offset: offset as u64, shape, strides }))
    }

    pub(super) fn global(&mut self, module: Range<usize>, name: Range<usize>) -> Result<(), Fault> {
        let text = |range: Range<usize>| String::from_utf8_lossy(&self.bytes[range]).into_owned();
        let (module, name) = (text(module), text(name));
        match known(&module, &name) {
            Some(global) => self.push(Value::Global(global)),
            None => Err(Fault::unsupported(
                format!("byte {} of {}: the global {:?}", self.instruction, self.name, format!("{module}.{name}")),
                "pickles are parsed, never executed; save dictionaries of tensors, arrays, texts and numbers",
            )),
        }
    }

    pub(super) fn range_of_text(&self, id: Id) -> Result<Range<usize>, Fault> {
        match self.value(id) {
            Value::Text(range) => Ok(range.clone()),
            _ => Err(self.malformed("a text", "something else")),
        }
    }

    fn items(&self, id: Id) -> Result<Vec<Id>, Fault> {
        match self.value(id) {
            Value::Items(items) if items.len() <= MAX_NAME => Ok(items.clone()),
            Value::Items(items) => Err(self.malformed("a tuple of at most 256", items.len())),
            _ => Err(self.malformed("a tuple", "something else")),
        }
    }

    /// A shape or strides.
    fn lengths(&self, id: Id) -> Result<Vec<u64>, Fault> {
        let items = self.items(id)?;
        let length = |&id: &Id| match self.value(id) {
            &Value::Int(n) => u64::try_from(n).ok(),
            _ => None,
        };
        let lengths: Option<Vec<u64>> = items.iter().map(length).collect();
        match lengths {
            Some(lengths) if lengths.len() <= MAX_AXES => Ok(lengths),
            _ => Err(self.malformed("at most 64 lengths", "something else")),
        }
    }
}
