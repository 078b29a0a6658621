//! A prior as an NPZ file.

use std::io::{self, Cursor};

use super::Built;
use strivec_import::npy::NpzWriter;

/// `prior` as an NPZ file: `cells` (N, 3), uint32, as x, y, z, ascending by (z, y, x); `origin` and `pitch` (3,),
/// float64; and, if the prior has colors, `colors` (N, 3), uint8, sRGB. Cell (i, j, k) spans origin + (i, j, k)·pitch
/// to origin + (i+1, j+1, k+1)·pitch in the dataset's space. The same prior gives the same bytes. [`strivec_import`]
/// reads the file.
///
/// # Errors
///
/// If the archive cannot be written. It is in memory, so only its size can cause this.
pub fn to_npz(prior: &Built) -> io::Result<Vec<u8>> {
    let mut archive = NpzWriter::new(Cursor::new(Vec::new()), true);
    let cells = &prior.boxes.cells;
    archive.add("cells", &[cells.len(), 3], cells.iter().flat_map(|cell| cell.to_array()))?;
    for (name, vector) in [("origin", prior.boxes.lattice.origin), ("pitch", prior.boxes.lattice.pitch)] {
        archive.add(name, &[3], vector.to_array())?;
    }
    if let Some(colors) = &prior.colors {
        archive.add("colors", &[cells.len(), 3], colors.iter().flatten().copied())?;
    }
    Ok(archive.finish()?.into_inner())
}
