//! COLMAP's sparse points.

use super::{Fault, Input, ReadOptions, Visitor};

/// Reads `points3D.bin`.
///
/// # Errors
///
/// Where it is not what the format says, and those of `visitor`.
pub fn read_binary(_input: &mut Input<'_>, _options: &ReadOptions, _visitor: &mut dyn Visitor) -> Result<(), Fault> {
    todo!()
}

/// Reads `points3D.txt`.
///
/// # Errors
///
/// Where it is not what the format says, and those of `visitor`.
pub fn read_text(_input: &mut Input<'_>, _options: &ReadOptions, _visitor: &mut dyn Visitor) -> Result<(), Fault> {
    todo!()
}
