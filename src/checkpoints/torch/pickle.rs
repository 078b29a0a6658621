//! Pickles as PyTorch and NumPy write them, as plain values.
//!
//! Nothing is imported or called. A pickle names functions; the few that create tensors, arrays and dictionaries are
//! mapped to values (`globals`), all others are errors. Values refer to each other by index, so that neither depth nor
//! cycles matter. Texts and bytes stay in the pickle, so that repeating them takes no memory.

mod globals;
mod machine;
mod value;

use strivec_import::Fault;

pub(crate) use globals::Element;
pub(crate) use value::{Array, Id, Storage, Tensor, Value};

/// A pickle, parsed.
pub(crate) struct Pickle {
    bytes: Vec<u8>,
    values: Vec<Value>,
    /// The value that the pickle stores.
    pub(crate) root: Id,
}

impl Pickle {
    /// Parses all of `bytes`; `name` names them in errors.
    ///
    /// # Errors
    ///
    /// If they are not a pickle of supported instructions and functions.
    pub(crate) fn parse(bytes: Vec<u8>, name: &str) -> Result<Self, Fault> {
        let (values, root) = machine::run(&bytes, name)?;
        Ok(Self { bytes, values, root })
    }

    pub(crate) fn value(&self, id: Id) -> &Value {
        &self.values[id as usize]
    }

    /// The value of `key`, if `dict` is a dictionary with this key; the last one, as in Python.
    pub(crate) fn get(&self, dict: Id, key: &str) -> Option<Id> {
        let Value::Dict(pairs) = self.value(dict) else { return None };
        // Compared as bytes, by their length first: a pickle may have a million keys that share one long text.
        let is_key = |id| matches!(self.value(id), Value::Text(range) if self.bytes[range.clone()] == *key.as_bytes());
        pairs.iter().rev().find(|&&(k, _)| is_key(k)).map(|&(_, value)| value)
    }

    /// The first keys of a dictionary, for errors.
    pub(crate) fn keys(&self, dict: Id) -> String {
        let Value::Dict(pairs) = self.value(dict) else { return "no dictionary".into() };
        let keys = pairs.iter().filter_map(|&(k, _)| self.text(k)).take(20);
        let keys: Vec<_> = keys.map(|key| key.chars().take(40).collect::<String>()).collect();
        if keys.is_empty() { "no keys".into() } else { keys.join(", ") }
    }

    pub(crate) fn text(&self, id: Id) -> Option<&str> {
        let Value::Text(range) = self.value(id) else { return None };
        std::str::from_utf8(&self.bytes[range.clone()]).ok()
    }

    /// The decoded bytes of a value, if it has bytes.
    pub(crate) fn bytes(&self, id: Id) -> Option<Vec<u8>> {
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
