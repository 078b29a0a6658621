//! Checkpoints that PyTorch wrote: DVGO's, and TensoRF's alpha mask. Their pickles are parsed, never executed.
//!
//! In: the zip archives of `torch.save` since PyTorch 1.6. `pickle` turns `data.pkl` into plain values, `checkpoint` reads the
//! numbers of tensors and arrays, `dvgo` and `tensorf` know what their authors called things.

mod checkpoint;
mod dvgo;
mod pickle;
mod tensorf;
#[cfg(test)]
mod tests;

use self::checkpoint::Checkpoint;
use super::archive::Archive;
use super::{Fault, Input, ReadOptions, Visitor};

/// How the stream of pickles begins that PyTorch wrote before 1.6: protocol 2 and its magic number.
const BEFORE_1_6: &[u8] = b"\x80\x02\x8a\x0al\xfc\x9cF\xf9 j\xa8P\x19.";
/// Where archives of `tar` say that they are: what PyTorch wrote before 0.1.10.
const TAR: (usize, &[u8]) = (257, b"ustar");

/// Reads `input`: DVGO's coarse or fine stage, voxels from [`ReadOptions::min_alpha`] on that its mask does not leave out; or
/// TensoRF's alpha mask.
///
/// # Errors
///
/// If it is not what the format says, and those of `visitor`.
pub fn read(input: &mut Input<'_>, options: &ReadOptions, visitor: &mut dyn Visitor) -> Result<(), Fault> {
    let start = input.peek(512)?;
    if start.starts_with(BEFORE_1_6) || start.get(TAR.0..).is_some_and(|at| at.starts_with(TAR.1)) {
        return Err(Fault::unsupported(
            "a checkpoint of PyTorch before 1.6",
            "load it and save it again with torch.save of PyTorch 1.6 or later",
        ));
    }
    if !Archive::begins(&start) {
        let found = format!("{:02x?}", &start[..start.len().min(8)]);
        return Err(Fault::malformed("byte 0", "a checkpoint of PyTorch 1.6 or later, a zip archive", found));
    }
    let mut checkpoint = Checkpoint::open(input)?;
    let has = |key: &str| checkpoint.pickle.get(checkpoint.pickle.root, key).is_some();
    if has("model_state_dict") && has("model_kwargs") {
        return dvgo::read(&mut checkpoint, options, visitor);
    }
    if has("alphaMask.mask") {
        return tensorf::read(&mut checkpoint, visitor);
    }
    if has("state_dict") && has("kwargs") {
        return Err(Fault::unsupported(
            "a TensoRF checkpoint without alphaMask",
            "train on until the first of `update_AlphaMask_list`, which makes it, and save then",
        ));
    }
    let expected = "DVGO's model_state_dict and model_kwargs, or TensoRF's alphaMask.mask";
    Err(Fault::malformed("the checkpoint", expected, checkpoint.pickle.keys(checkpoint.pickle.root)))
}
