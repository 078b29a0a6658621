//! Checkpoints of PyTorch: DVGO's densities, and TensoRF's alpha mask. Pickles are parsed, never executed.
//!
//! In: the zip archives of `torch.save` since PyTorch 1.6. `pickle` turns `data.pkl` into plain values, `checkpoint`
//! reads the numbers of tensors and arrays, `dvgo` and `tensorf` find the parts of the two kinds of checkpoints.

mod checkpoint;
mod dvgo;
mod pickle;
mod tensorf;
#[cfg(test)]
mod tests;

pub(crate) use self::checkpoint::TorchFile;
pub(crate) use self::pickle::{Id, Pickle, Value};
use strivec_import::archive::Archive;
use strivec_import::{Fault, Input, ReadOptions, Visitor};

/// Beginning of the files of PyTorch before 1.6: protocol 2 and a magic number.
const BEFORE_1_6: &[u8] = b"\x80\x02\x8a\x0al\xfc\x9cF\xf9 j\xa8P\x19.";
/// Offset and signature of tar archives, the files of PyTorch before 0.1.10.
const TAR: (usize, &[u8]) = (257, b"ustar");

/// Reads `input`: of DVGO's coarse or fine stage, the voxels of at least [`ReadOptions::min_alpha`] inside its mask; or
/// TensoRF's alpha mask.
///
/// # Errors
///
/// If the file breaks the format, and those of `visitor`.
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
    let mut checkpoint = TorchFile::open(input)?;
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
            "save it after the first step of `update_AlphaMask_list`, which creates the mask",
        ));
    }
    let expected = "DVGO's model_state_dict and model_kwargs, or TensoRF's alphaMask.mask";
    Err(Fault::malformed("the keys of the checkpoint", expected, checkpoint.pickle.keys(checkpoint.pickle.root)))
}
