//! NSVF's text files, and LLFF's `poses_bounds.npy`.

use std::fs;
use std::io::{self, Write};
use std::path::Path;

use glam::DVec3;

use super::layout::PlannedPicture;
use super::options::write;
use super::points::SurfacePoint;
use crate::Error;
use strivec_dataset::OPENGL_FROM_OPENCV;
use strivec_format::geometry::Camera;
use strivec_import::npy;

/// The edge of NSVF's voxels that `bbox.txt` states, in the scene's units.
const VOXEL: f64 = 0.2;

/// Writes `intrinsics.txt`, `pose/NAME.txt` and `bbox.txt`, the box of the scene: [−1, 1]³.
pub(super) fn write_nsvf(out: &Path, photographs: &[PlannedPicture]) -> Result<(), Error> {
    let ([fx, fy], [cx, cy]) = (photographs[0].camera.focal, photographs[0].camera.principal);
    let intrinsics = [[fx, 0.0, cx, 0.0], [0.0, fy, cy, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]];
    write(&out.join("intrinsics.txt"), |file| file.write_all(lines(&intrinsics).as_bytes()))?;
    write(&out.join("bbox.txt"), |file| writeln!(file, "-1 -1 -1 1 1 1 {VOXEL}"))?;
    let poses = out.join("pose");
    fs::create_dir_all(&poses).map_err(Error::write(&poses))?;
    for photograph in photographs {
        let camera = &photograph.camera;
        let in_opencv = Camera { world_from_camera: camera.world_from_camera * OPENGL_FROM_OPENCV, ..*camera };
        let path = poses.join(format!("{}.txt", photograph.stem()));
        write(&path, |file| file.write_all(lines(in_opencv.pose().as_chunks().0).as_bytes()))?;
    }
    Ok(())
}

/// The rows of a matrix as text, all digits.
fn lines(rows: &[[f64; 4]]) -> String {
    rows.iter().map(|row| row.map(|value| value.to_string()).join(" ") + "\n").collect()
}

/// Writes `poses_bounds.npy` with the least and the greatest depth of `points` as bounds.
pub(super) fn write_llff(out: &Path, photographs: &[PlannedPicture], points: &[SurfacePoint]) -> Result<(), Error> {
    let rows = photographs.iter().flat_map(|photograph| row(&photograph.camera, points));
    write(&out.join("poses_bounds.npy"), |file| {
        npy::write(&mut *file, &[photographs.len(), 17], rows).map_err(io::Error::other)
    })
}

/// A matrix \[3\]\[5\], its columns the axes down, right and back, the position, and height, width and focal length;
/// near and far.
fn row(camera: &Camera, points: &[SurfacePoint]) -> Vec<f64> {
    let [right, up, back] =
        [camera.world_from_camera.x_axis, camera.world_from_camera.y_axis, camera.world_from_camera.z_axis];
    let last = DVec3::new(f64::from(camera.height), f64::from(camera.width), camera.focal[0]);
    let matrix = (0..3).flat_map(|r| [-up, right, back, camera.position, last].map(|column| column[r]));
    let depths = points.iter().map(|point| (camera.position - point.position).dot(back));
    let (near, far) = depths.fold((f64::INFINITY, 0.0), |(near, far), depth: f64| (near.min(depth), depth.max(far)));
    matrix.chain([near, far]).collect()
}
