//! Geometry of any file or folder that a prior is made from.

use std::path::Path;

use strivec_checkpoints::torch;
use strivec_import::{Fault, Format, ImportError, Input, ReadOptions, Visitor};

use crate::{depth_points, scan_mesh};

/// Reads the geometry of the file or folder `path`: a ScanNet scene, whose aligned mesh is read; a `transforms.json`, whose
/// depth maps are; a checkpoint of PyTorch with a grid; or what [`strivec_import::read`] reads.
///
/// # Errors
///
/// If the format is unknown, the file breaks its format, and those of `visitor`.
pub fn read(path: &Path, options: &ReadOptions, visitor: &mut dyn Visitor) -> Result<(), ImportError> {
    if let Some(scan) = scan_mesh::scan_of(path)? {
        return read_file(&scan.mesh, options, &mut scan.aligned(visitor));
    }
    read_file(path, options, visitor)
}

fn read_file(path: &Path, options: &ReadOptions, visitor: &mut dyn Visitor) -> Result<(), ImportError> {
    if path.is_dir() {
        return strivec_import::read(path, options, visitor);
    }
    let of = |fault: Fault| fault.of(path);
    match Format::from_path(path).map_err(of)? {
        Format::Torch => torch::read(&mut Input::open(path).map_err(of)?, options, visitor).map_err(of),
        Format::DepthMaps => depth_points::read(path, visitor),
        _ => strivec_import::read(path, options, visitor),
    }
}
