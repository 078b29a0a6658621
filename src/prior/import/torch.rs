//! Checkpoints that PyTorch wrote: DVGO's coarse stage, TensoRF's alpha mask. Their pickles are parsed, never executed.

use super::{Fault, Input, ReadOptions, Visitor};

/// Reads `input`.
///
/// # Errors
///
/// Where it is not what the format says, and those of `visitor`.
pub fn read(_input: &mut Input<'_>, _options: &ReadOptions, _visitor: &mut dyn Visitor) -> Result<(), Fault> {
    todo!()
}
