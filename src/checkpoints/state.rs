//! The settings and parameters of a checkpoint of TensoRF's family: `kwargs` and `state_dict`.

use crate::torch::{Id, TorchFile, Value};
use strivec_import::Fault;

/// A checkpoint with its settings and parameters.
pub(super) struct CheckpointState<'a, 'b> {
    checkpoint: TorchFile<'a, 'b>,
    settings: Id,
    parameters: Id,
}

/// An array of the checkpoint, in C order.
pub(super) struct CheckpointArray {
    pub(super) shape: Vec<usize>,
    pub(super) values: Vec<f32>,
}

impl<'a, 'b> CheckpointState<'a, 'b> {
    /// The parts of `checkpoint`.
    ///
    /// # Errors
    ///
    /// If it lacks one of them.
    pub(super) fn new(checkpoint: TorchFile<'a, 'b>) -> Result<Self, Fault> {
        let part = |name: &str| {
            let pickle = &checkpoint.pickle;
            let missing = || Fault::malformed("the keys of the checkpoint", name, pickle.keys(pickle.root));
            pickle.get(pickle.root, name).ok_or_else(missing)
        };
        let (settings, parameters) = (part("kwargs")?, part("state_dict")?);
        Ok(Self { checkpoint, settings, parameters })
    }

    /// The value of `key` at the root, if it is there.
    pub(super) fn at_root(&self, key: &str) -> Option<Id> {
        self.checkpoint.pickle.get(self.checkpoint.pickle.root, key)
    }

    /// True if there is a parameter of this name.
    pub(super) fn has(&self, name: &str) -> bool {
        self.checkpoint.pickle.get(self.parameters, name).is_some()
    }

    /// The names of the first parameters, for errors.
    pub(super) fn parameter_names(&self) -> String {
        self.checkpoint.pickle.keys(self.parameters)
    }

    /// N finite numbers of the setting `name`.
    pub(super) fn setting<const N: usize>(&mut self, name: &str) -> Result<[f64; N], Fault> {
        let pickle = &self.checkpoint.pickle;
        let missing = || Fault::malformed("the keys of kwargs", name, pickle.keys(self.settings));
        let id = pickle.get(self.settings, name).ok_or_else(missing)?;
        self.checkpoint.numbers(id, &format!("kwargs {name}"))
    }

    /// A whole number from 0 on.
    pub(super) fn count(&mut self, name: &str) -> Result<u32, Fault> {
        let [value] = self.setting(name)?;
        whole(&format!("kwargs {name}"), value)
    }

    /// The text of the setting `name`.
    pub(super) fn text(&self, name: &str) -> Result<String, Fault> {
        let pickle = &self.checkpoint.pickle;
        let text = pickle.get(self.settings, name).and_then(|id| pickle.text(id));
        text.map(str::to_owned).ok_or_else(|| Fault::malformed(format!("kwargs {name}"), "a text", "something else"))
    }

    /// N finite numbers of the value `id`.
    pub(super) fn numbers<const N: usize>(&mut self, id: Id, name: &str) -> Result<[f64; N], Fault> {
        self.checkpoint.numbers(id, name)
    }

    /// The bytes of an array of `u8` and its length, of the value `id`.
    pub(super) fn bytes(&self, id: Id, name: &str) -> Result<Vec<u8>, Fault> {
        let (header, bytes) = self.checkpoint.pickle.array(id, name)?;
        match header.number {
            strivec_import::npy::Number::Unsigned(1) => Ok(bytes),
            other => Err(Fault::malformed(name, "an array of bytes", format!("numbers of type {other:?}"))),
        }
    }

    /// The parameter `name`, finite numbers. `expected` are the lengths of its axes, where known.
    ///
    /// # Errors
    ///
    /// If it is missing or has another shape.
    pub(super) fn parameter(&mut self, name: &str, expected: &[Option<usize>]) -> Result<CheckpointArray, Fault> {
        let pickle = &self.checkpoint.pickle;
        let place = format!("state_dict {name}");
        let id = pickle.get(self.parameters, name);
        let tensor = match id.map(|id| pickle.value(id)) {
            Some(Value::Tensor(tensor)) => tensor.clone(),
            Some(_) => return Err(Fault::malformed(place, "a tensor", "something else")),
            None => {
                return Err(Fault::malformed("the keys of state_dict", name, pickle.keys(self.parameters)));
            }
        };
        let shape: Vec<usize> = tensor.shape.iter().map(|&n| n as usize).collect();
        let fits = shape.len() == expected.len() && shape.iter().zip(expected).all(|(&n, e)| e.is_none_or(|e| e == n));
        if !fits {
            let lengths: Vec<String> = expected.iter().map(|e| e.map_or("any".into(), |n| n.to_string())).collect();
            return Err(Fault::malformed(place, format!("an array of [{}]", lengths.join(", ")), format!("{shape:?}")));
        }
        let mut values = Vec::new();
        self.checkpoint.for_each(&tensor, |n, value| {
            let value = value as f32;
            if !value.is_finite() {
                return Err(Fault::malformed(format!("{place} entry {n}"), "a finite number", value));
            }
            values.push(value);
            Ok(())
        })?;
        Ok(CheckpointArray { shape, values })
    }
}

/// `value` as a whole number from 0 to 2³² − 1.
pub(super) fn whole(place: &str, value: f64) -> Result<u32, Fault> {
    if value.fract() == 0.0 && (0.0..=f64::from(u32::MAX)).contains(&value) {
        return Ok(value as u32);
    }
    Err(Fault::malformed(place, "a whole number from 0 on", value))
}
