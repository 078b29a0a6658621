//! Captures: posed photographs as datasets, and occupied space from geometry or from the photographs themselves.
//!
//! [`dataset`]: photographs with their cameras, one reader per layout. [`prior`]: occupied voxels, their check against the
//! cameras, and tensors placed in them. [`survey`]: where the scene of a capture is. [`geometry`]: any file or folder of
//! geometry as a stream of triangles, points and cells, ScanNet's scans, depth maps and checkpoints of PyTorch included.
#![forbid(unsafe_code)]

mod depth_points;
pub mod geometry;
pub mod prior;
mod scan_mesh;
pub mod survey;

pub use strivec_dataset as dataset;
