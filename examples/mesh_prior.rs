//! Imports a mesh or a point cloud as a prior: voxels that are occupied, and tensors placed on them.
//!
//!     cargo run --release --example mesh_prior -- mesh.ply 0.25

use std::error::Error;
use std::ops::ControlFlow;
use std::path::PathBuf;

use strivec::prior::{self, BuildOptions, ScaleShape};

fn main() -> Result<(), Box<dyn Error>> {
    let usage = "usage: mesh_prior FILE PITCH";
    let mut arguments = std::env::args().skip(1);
    let file = PathBuf::from(arguments.next().ok_or(usage)?);
    let pitch: f64 = arguments.next().ok_or(usage)?.parse()?;

    let built = prior::build(&[file], &BuildOptions::default(), &mut |_| ControlFlow::Continue(()))?;
    println!(
        "{} occupied voxels of {} triangles, {} points",
        built.boxes.cells.len(),
        built.counts.triangles,
        built.counts.points
    );

    // The model's space: the largest extent is 2.4 units (paper, section "Implementation").
    let map = prior::canonical_map(&built.boxes.bounds(), prior::CANONICAL_HALF_EXTENT)?;
    let boxes = built.boxes.mapped(&map);
    let shape = ScaleShape { pitch: [pitch; 3], edge: [1.5 * pitch; 3], resolution: [15; 3] };
    let cloud = prior::place_on_boxes(&boxes, &shape)?;
    println!("{} tensors with edges of {} model units", cloud.len(), 1.5 * pitch);
    Ok(())
}
