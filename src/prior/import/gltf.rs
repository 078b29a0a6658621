//! glTF 2 and GLB, through `gltf`.

use std::path::Path;

use super::{Fault, Input, ReadOptions, Visitor};

/// Reads `input`; `beside` finds the files that it names.
///
/// # Errors
///
/// Where it is not what the format says, and those of `visitor`.
pub fn read(
    _input: &mut Input<'_>,
    _beside: &dyn Fn(&str) -> Result<Vec<u8>, Fault>,
    _options: &ReadOptions,
    _visitor: &mut dyn Visitor,
) -> Result<(), Fault> {
    todo!()
}

/// The bytes of the file that the glTF file `path` calls `name`.
///
/// # Errors
///
/// Where it cannot be read, or lies outside the folder of `path`.
pub fn beside(_path: &Path, _name: &str) -> Result<Vec<u8>, Fault> {
    todo!()
}
