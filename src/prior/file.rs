//! A prior as a file that NumPy opens.

use std::io::{self, Cursor};

use npyz::WriterBuilder;
use npyz::npz::NpzWriter;
use zip::write::FileOptions;

use super::Built;

/// `prior` as an NPZ file: `cells` (N, 3), uint32, as x, y, z, ascending by (z, y, x); `origin` and `pitch` (3,), float64: cell
/// (i, j, k) spans origin + (i, j, k)·pitch to origin + (i+1, j+1, k+1)·pitch in the dataset's space; where there are
/// colors, `colors` (N, 3), uint8, sRGB. The same prior gives the same bytes. [`super::import`] reads it back.
///
/// # Errors
///
/// Never for want of anything but memory.
pub fn to_npz(prior: &Built) -> io::Result<Vec<u8>> {
    let mut bytes = Cursor::new(Vec::new());
    let mut archive = NpzWriter::new(&mut bytes);
    // The default is the time of day.
    let options = FileOptions::default().last_modified_time(zip::DateTime::default()).large_file(true);
    let count = prior.boxes.cells.len() as u64;
    let mut cells = archive.array("cells", options)?.default_dtype().shape(&[count, 3]).begin_nd()?;
    cells.extend(prior.boxes.cells.iter().flat_map(|cell| cell.to_array()))?;
    cells.finish()?;
    for (name, vector) in [("origin", prior.boxes.lattice.origin), ("pitch", prior.boxes.lattice.pitch)] {
        let mut array = archive.array(name, options)?.default_dtype().shape(&[3]).begin_nd()?;
        array.extend(vector.to_array())?;
        array.finish()?;
    }
    if let Some(colors) = &prior.colors {
        let mut array = archive.array("colors", options)?.default_dtype().shape(&[count, 3]).begin_nd()?;
        array.extend(colors.iter().flatten().copied())?;
        array.finish()?;
    }
    archive.zip_writer().finish()?;
    drop(archive);
    Ok(bytes.into_inner())
}
