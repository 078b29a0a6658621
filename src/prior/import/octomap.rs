//! OctoMap's octrees.

use super::{Fault, Input, ReadOptions, Visitor};

/// Reads `input`.
///
/// # Errors
///
/// Where it is not what the format says, and those of `visitor`.
pub fn read(_input: &mut Input<'_>, _options: &ReadOptions, _visitor: &mut dyn Visitor) -> Result<(), Fault> {
    todo!()
}
