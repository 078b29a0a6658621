//! The values of a checkpoint, and the numbers of its tensors and arrays.

use std::io::Read;

use super::pickle::{Element, Id, Pickle, Tensor, Value};
use strivec_import::archive::{Archive, check_end_of, reading};
use strivec_import::npy::{Header, Number, number_of};
use strivec_import::{Fault, Input};

/// Bytes of a pickle. It includes TensoRF's alpha mask, at one and a half bits per voxel.
const MAX_PICKLE: u64 = 1 << 26;
/// Numbers of a tensor that is not contiguous in the file, held in memory (128 MiB).
const MAX_HELD: u64 = 1 << 24;

/// A checkpoint.
pub(crate) struct TorchFile<'a, 'b> {
    archive: Archive<'a, 'b>,
    /// Folder in the archive, with a slash.
    folder: String,
    /// All values but the numbers of tensors.
    pub(crate) pickle: Pickle,
}

impl<'a, 'b> TorchFile<'a, 'b> {
    /// Reads the pickle of `input`.
    ///
    /// # Errors
    ///
    /// If it is not an archive with one pickle, or the pickle is invalid.
    pub(crate) fn open(input: &'a mut Input<'b>) -> Result<Self, Fault> {
        const PICKLE: &str = "data.pkl";
        let mut archive = Archive::open(input)?;
        let names = archive.names();
        let is_pickle = |name: &&String| name.as_str() == PICKLE || name.ends_with("/data.pkl");
        let pickles: Vec<&String> = names.iter().filter(is_pickle).collect();
        let [name] = pickles[..] else {
            return Err(Fault::malformed("the archive", "one entry data.pkl", pickles.len()));
        };
        let folder = name[..name.len() - PICKLE.len()].to_owned();
        let order = format!("{folder}byteorder");
        if names.contains(&order) && archive.bytes(&order, 16)? != b"little" {
            return Err(Fault::unsupported("a checkpoint of big-endian numbers", "save it again on another machine"));
        }
        let bytes = archive.bytes(name, MAX_PICKLE)?;
        Ok(Self { archive, folder, pickle: Pickle::parse(bytes, name)? })
    }

    /// The value `id`, if it is a tensor.
    pub(crate) fn tensor(&self, id: Id) -> Option<&Tensor> {
        match self.pickle.value(id) {
            Value::Tensor(tensor) => Some(tensor),
            _ => None,
        }
    }

    /// Visits a tensor's numbers in the order of its axes, the last one fastest.
    ///
    /// # Errors
    ///
    /// If the storage is missing or of another length than declared, and those of `visit`.
    pub(crate) fn for_each(
        &mut self,
        tensor: &Tensor,
        mut visit: impl FnMut(u64, f64) -> Result<(), Fault>,
    ) -> Result<(), Fault> {
        let storage = tensor.storage;
        let element = storage.element;
        let number = if let Element::Number(number) = element { number } else { Number::Unsigned(2) };
        let name = format!("{}data/{}", self.folder, self.pickle.text(storage.key).unwrap_or_default());
        let width = number.width() as u64;
        let mut bytes = self.archive.entry(&name)?;
        if storage.count.checked_mul(width) != Some(bytes.size()) {
            let expected = format!("{} numbers of {width} bytes", storage.count);
            return Err(Fault::malformed(name, expected, format!("{} bytes", bytes.size())));
        }
        let value_of = |value: f64| match element {
            Element::Number(_) => value,
            Element::Bfloat16 => f32::from_bits((value as u32) << 16).into(),
        };
        let header = |count| Header { number, big_endian: false, fortran_order: false, shape: vec![count], count };
        let count = tensor.shape.iter().product();
        if count == 0 {
            return Ok(());
        }
        if is_contiguous(tensor) {
            let skipped = tensor.offset * width;
            let passed = std::io::copy(&mut bytes.by_ref().take(skipped), &mut std::io::sink());
            if passed.map_err(|e| reading(&name, e))? != skipped {
                return Err(Fault::broken(name, "it ends early"));
            }
            header(count).for_each(&mut bytes, |n, value| visit(n, value_of(value)))?;
            return if tensor.offset + count == storage.count { check_end_of(&mut bytes, &name) } else { Ok(()) };
        }
        Fault::unless_within("numbers of a tensor that is not contiguous", MAX_HELD, storage.count.max(count))?;
        let numbers = header(storage.count).numbers(&mut bytes)?;
        let mut index = vec![0; tensor.shape.len()];
        for n in 0..count {
            let steps: u64 = index.iter().zip(&tensor.strides).map(|(i, stride)| i * stride).sum();
            visit(n, value_of(numbers[(tensor.offset + steps) as usize]))?;
            for axis in (0..index.len()).rev() {
                index[axis] += 1;
                if index[axis] < tensor.shape[axis] {
                    break;
                }
                index[axis] = 0;
            }
        }
        Ok(())
    }

    /// The N finite numbers of the tensor, array or list `id`, or, if N is 1, of a number.
    ///
    /// # Errors
    ///
    /// If it is something else; `name` names it in errors.
    pub(crate) fn numbers<const N: usize>(&mut self, id: Id, name: &str) -> Result<[f64; N], Fault> {
        let mut found = Vec::new();
        match self.pickle.value(id) {
            Value::Tensor(tensor) => {
                let tensor = tensor.clone();
                let count: u64 = tensor.shape.iter().product();
                if count == N as u64 {
                    self.for_each(&tensor, |_, value| {
                        found.push(value);
                        Ok(())
                    })?;
                }
            }
            Value::Array(_) => {
                let (header, bytes) = self.pickle.array(id, name)?;
                if header.count == N as u64 {
                    found = header.numbers(&mut bytes.as_slice())?;
                }
            }
            Value::Items(items) if items.len() == N => {
                found = items.iter().filter_map(|&item| self.number(item)).collect();
            }
            _ => found.extend(self.number(id)),
        }
        let wrong = format!("{found:?}");
        let numbers: Option<[f64; N]> = found.try_into().ok().filter(|f: &[f64; N]| f.iter().all(|n| n.is_finite()));
        numbers.ok_or_else(|| Fault::malformed(name, format!("{N} finite numbers"), wrong))
    }

    fn number(&self, id: Id) -> Option<f64> {
        match *self.pickle.value(id) {
            Value::Int(value) => Some(value as f64),
            Value::Float(value) => Some(value),
            _ => None,
        }
    }
}

impl Pickle {
    /// Header and bytes of the NumPy array `id`; the length of the bytes is that of the header.
    ///
    /// # Errors
    ///
    /// If it is something else.
    pub(crate) fn array(&self, id: Id, name: &str) -> Result<(Header, Vec<u8>), Fault> {
        let none = || Fault::malformed(name, "an array of numbers", "something else");
        let Value::Array(array) = self.value(id) else { return Err(none()) };
        let &Value::Dtype { name: kind, order } = self.value(array.dtype) else { return Err(none()) };
        let order = order.and_then(|order| self.text(order)).unwrap_or("|");
        let (number, big_endian) = number_of(&format!("{order}{}", self.text(kind).unwrap_or_default()))?;
        let bytes = self.bytes(array.data).ok_or_else(none)?;
        let count = array.shape.iter().try_fold(1_u64, |all, n| all.checked_mul(*n));
        match count {
            Some(count) if count.checked_mul(number.width() as u64) == Some(bytes.len() as u64) => {
                let (fortran_order, shape) = (array.fortran_order, array.shape.clone());
                Ok((Header { number, big_endian, fortran_order, shape, count }, bytes))
            }
            _ => Err(Fault::malformed(name, format!("the bytes of {:?} numbers", array.shape), bytes.len())),
        }
    }
}

/// True if numbers follow one another in the file as in the tensor. The stride of an axis of length 1 is ignored.
fn is_contiguous(tensor: &Tensor) -> bool {
    let mut step = 1_u64;
    for (&length, &stride) in tensor.shape.iter().zip(&tensor.strides).rev() {
        if length != 1 && stride != step {
            return false;
        }
        step = step.saturating_mul(length);
    }
    true
}
