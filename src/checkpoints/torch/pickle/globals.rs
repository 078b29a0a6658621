//! The functions and classes that pickles may name.

use strivec_import::npy::Number;

/// Type of a tensor's numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Element {
    Number(Number),
    /// The upper half of an f32.
    Bfloat16,
}

/// A known function or class, by the value it creates.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Global {
    /// A dictionary, from no arguments.
    Dict,
    /// The first argument of the call, unchanged.
    Same,
    /// An unused value.
    Ignored,
    /// A tensor from a storage, its offset, shape and strides.
    Tensor,
    /// A class of storages.
    Storage(Element),
    /// NumPy's empty array, filled later by BUILD.
    Reconstruct,
    /// An array from bytes, type, shape and memory order.
    FromBuffer,
    /// The class of arrays.
    Ndarray,
    /// A type of numbers, from its name.
    Dtype,
    /// One number, from type and bytes.
    Scalar,
    /// Bytes, from a text and "latin1".
    Encode,
    /// No bytes, from no arguments.
    Bytes,
}

/// The function or class `name` of `module`, if it is known.
pub(super) fn known(module: &str, name: &str) -> Option<Global> {
    use Global::{
        Bytes, Dict, Dtype, Encode, FromBuffer, Ignored, Ndarray, Reconstruct, Same, Scalar, Storage, Tensor,
    };
    let number = |number| Some(Storage(Element::Number(number)));
    match (module, name) {
        ("torch._utils", "_rebuild_tensor_v2") => Some(Tensor),
        ("torch._utils", "_rebuild_parameter") | ("torch", "Size") => Some(Same),
        ("torch", "device") => Some(Ignored),
        // Settings read from a file have a dictionary class of their own.
        ("collections", "OrderedDict")
        | ("mmcv.utils.config" | "mmengine.config.config", "ConfigDict")
        | ("addict.addict", "Dict") => Some(Dict),
        ("torch" | "torch.cuda", "DoubleStorage") => number(Number::Float(8)),
        ("torch" | "torch.cuda", "FloatStorage") => number(Number::Float(4)),
        ("torch" | "torch.cuda", "HalfStorage") => number(Number::Float(2)),
        ("torch" | "torch.cuda", "BFloat16Storage") => Some(Storage(Element::Bfloat16)),
        ("torch" | "torch.cuda", "LongStorage") => number(Number::Signed(8)),
        ("torch" | "torch.cuda", "IntStorage") => number(Number::Signed(4)),
        ("torch" | "torch.cuda", "ShortStorage") => number(Number::Signed(2)),
        ("torch" | "torch.cuda", "CharStorage") => number(Number::Signed(1)),
        ("torch" | "torch.cuda", "ByteStorage") => number(Number::Unsigned(1)),
        ("torch" | "torch.cuda", "BoolStorage") => number(Number::Bool),
        ("torch", "float16" | "float32" | "float64" | "bfloat16" | "int32" | "int64" | "uint8" | "bool") => {
            Some(Ignored)
        }
        ("numpy.core.multiarray" | "numpy._core.multiarray", "_reconstruct") => Some(Reconstruct),
        ("numpy.core.multiarray" | "numpy._core.multiarray", "scalar") => Some(Scalar),
        ("numpy.core.numeric" | "numpy._core.numeric", "_frombuffer") => Some(FromBuffer),
        ("numpy", "ndarray") => Some(Ndarray),
        ("numpy", "dtype") => Some(Dtype),
        ("_codecs", "encode") => Some(Encode),
        ("__builtin__" | "builtins", "bytes") => Some(Bytes),
        _ => None,
    }
}
