//! Pickles as PyTorch and NumPy write them, as plain values.
//!
//! Nothing is imported or called: a pickle names its functions, and those few that stand for tensors, arrays and dictionaries are
//! known here as what they make. Values refer to each other by number, so that neither depth nor circles matter, and texts and bytes
//! stay where they are in the pickle, so that repeating them costs nothing.

mod globals;
mod machine;
mod value;

use crate::import::Fault;

pub(super) use globals::Element;
pub(super) use value::{Array, Id, Storage, Tensor, Value};

/// A pickle, parsed.
pub(super) struct Pickle {
    bytes: Vec<u8>,
    values: Vec<Value>,
    /// What it is of.
    pub(super) root: Id,
}

impl Pickle {
    /// Parses `bytes`, all of them; `name` is what they are called in errors.
    ///
    /// # Errors
    ///
    /// If they are no pickle, or one that names a function that is not known here.
    pub(super) fn parse(bytes: Vec<u8>, name: &str) -> Result<Self, Fault> {
        let (values, root) = machine::run(&bytes, name)?;
        Ok(Self { bytes, values, root })
    }

    pub(super) fn value(&self, id: Id) -> &Value {
        &self.values[id as usize]
    }

    /// The value of `key` in a dictionary, if there are both; the last one, as Python has it.
    pub(super) fn get(&self, dict: Id, key: &str) -> Option<Id> {
        let Value::Dict(pairs) = self.value(dict) else { return None };
        pairs.iter().rev().find(|&&(k, _)| self.text(k) == Some(key)).map(|&(_, value)| value)
    }

    /// The first keys of a dictionary, for people.
    pub(super) fn keys(&self, dict: Id) -> String {
        let Value::Dict(pairs) = self.value(dict) else { return "no dictionary".into() };
        let keys = pairs.iter().filter_map(|&(k, _)| self.text(k)).take(20);
        let keys: Vec<_> = keys.map(|key| key.chars().take(40).collect::<String>()).collect();
        if keys.is_empty() { "no names".into() } else { keys.join(", ") }
    }

    pub(super) fn text(&self, id: Id) -> Option<&str> {
        let Value::Text(range) = self.value(id) else { return None };
        std::str::from_utf8(&self.bytes[range.clone()]).ok()
    }

    /// The bytes of a value that has any, decoded where need be.
    pub(super) fn bytes(&self, id: Id) -> Option<Vec<u8>> {
        match self.value(id) {
            Value::Bytes(range) => Some(self.bytes[range.clone()].to_vec()),
            Value::Latin1(range) => {
                let text = std::str::from_utf8(&self.bytes[range.clone()]).ok()?;
                text.chars().map(|c| u8::try_from(u32::from(c)).ok()).collect()
            }
            _ => None,
        }
    }
}
