//! TensoRF's alpha mask.
//!
//! `alphaMask.mask` has one bit per vertex, most significant first, in the order \[z\]\[y\]\[x\] of `alphaMask.shape`.
//! The first and last vertices lie on the faces of `alphaMask.aabb`. TensoRF interpolates the mask trilinearly and
//! samples where it is positive, up to one voxel from a set vertex. The boxes here reach half a voxel, as DVGO's do:
//! TensoRF has already grown the mask by one voxel (`max_pool3d` of 3), so the outer half is known to be empty.

use glam::DVec3;

use super::checkpoint::TorchFile;
use strivec_format::geometry::Aabb;
use strivec_import::grid::{At, Grid, Order, three_axes};
use strivec_import::npy::Number;
use strivec_import::{Fault, Visitor};

/// Passes the boxes around set vertices to `visitor`.
pub(super) fn read(checkpoint: &mut TorchFile<'_, '_>, visitor: &mut dyn Visitor) -> Result<(), Fault> {
    let part = |name: &'static str| {
        let pickle = &checkpoint.pickle;
        let missing = || Fault::malformed("the keys of the checkpoint", name, pickle.keys(pickle.root));
        pickle.get(pickle.root, name).ok_or_else(missing)
    };
    let (mask, shape, aabb) = (part("alphaMask.mask")?, part("alphaMask.shape")?, part("alphaMask.aabb")?);
    let corners: [f64; 6] = checkpoint.numbers(aabb, "alphaMask.aabb")?;
    let bounds = Aabb { min: DVec3::from_slice(&corners[..3]), max: DVec3::from_slice(&corners[3..]) };
    let shape = checkpoint.numbers::<5>(shape, "alphaMask.shape")?.map(|length| length as u64);
    let grid = Grid::new(three_axes(&shape)?, Order::Zyx, At::Vertices, &bounds)?;
    let (header, bytes) = checkpoint.pickle.array(mask, "alphaMask.mask")?;
    let count = grid.shape.iter().try_fold(1_u64, |all, n| all.checked_mul(*n));
    if header.number != Number::Unsigned(1) || count.map(|count| count.div_ceil(8)) != Some(bytes.len() as u64) {
        let expected = format!("one bit for each of {:?} vertices", grid.shape);
        return Err(Fault::malformed(
            "alphaMask.mask",
            expected,
            format!("{} bytes of type {:?}", bytes.len(), header.number),
        ));
    }
    for n in 0..count.unwrap_or(0) {
        let byte = n / 8;
        if n % 8 == 0 && byte % (1 << 17) == (1 << 17) - 1 {
            visitor.progress(byte, bytes.len() as u64)?;
        }
        if bytes[byte as usize] >> (7 - n % 8) & 1 == 1 {
            visitor.cell(&grid.cell(n), None)?;
        }
    }
    Ok(())
}
