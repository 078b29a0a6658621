//! Synthetic photographs of a scene with exact geometry: the project's demo and the ground truth of its tests.
//!
//! In: the number and size of views, and a seed. Out: a folder in the Blender layout with the scene's exact mesh,
//! points on its surface and an occupancy grid; or a folder in ScanNet's layout with a mesh that has holes. The same
//! seed gives the same bytes on any number of threads.

mod mesh;
mod occupancy;
mod options;
mod pictures;
mod points;
mod polytope;
mod portable;
mod scan;
mod scene;
mod shading;
mod solid;
mod texture;
mod torn;

use std::fs::{self, File};
use std::io::{self, BufWriter};
use std::path::Path;

use image::ImageFormat;
use rayon::prelude::*;
use serde_json::json;

use self::mesh::Mesh;
pub use self::options::SynthOptions;
use self::options::{check, prepare, write};
use self::pictures::CAMERA_ANGLE;
use self::portable::hash;
pub use self::scan::{SynthesizedScan, synthesize_scan};
use self::scene::Scene;
use self::shading::Lights;
use super::Error;
use crate::geometry::Camera;

/// Number of points in `points.ply`.
const POINTS: usize = 100_000;
/// Counts of a dataset made by [`synthesize`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Synthesized {
    /// Number of pictures of all splits.
    pub pictures: usize,
    /// Number of triangles of the mesh.
    pub triangles: usize,
    /// Number of points on the surface.
    pub points: usize,
    /// Number of cells that the scene occupies.
    pub occupied_cells: usize,
}

/// Writes a synthetic dataset to the folder `out`:
///
/// - `transforms_{train,val,test}.json` and `{train,val,test}/r_*.png`: the Blender layout, straight alpha;
/// - `mesh.ply` and `mesh.obj`: the surface of each solid as triangles, closed, outward, vertices exact (PLY: in f32);
/// - `points.ply`: 100 000 points, uniform by area, with normals and sRGB diffuse colors;
/// - `occupancy.npz`: `occupancy`, bool \[z\]\[y\]\[x\], true if the cell, a closed box, has a point in common with a
///   solid or its inside, within 1e-9; `bounds`, float64 (2, 3), the grid's corners.
///
/// The scene lies within \[−1, 1\]³, z up.
///
/// # Errors
///
/// If an option is out of range, the folder is not empty (unless forced), or a file cannot be written.
pub fn synthesize(out: &Path, options: &SynthOptions) -> Result<Synthesized, Error> {
    check(options)?;
    prepare(out, options.force)?;
    let scene = Scene::new(hash(options.seed, 0));
    let mut pictures = 0;
    let validation = options.test_views.div_ceil(4);
    for (stream, split, count) in [(1, "train", options.views), (2, "val", validation), (3, "test", options.test_views)]
    {
        let cameras = pictures::cameras(count, options.size, hash(options.seed, stream));
        photograph(&scene, out, split, &cameras)?;
        pictures += cameras.len();
    }
    let mesh = Mesh::of_scene(&scene);
    write(&out.join("mesh.ply"), |file| mesh.write_ply(file))?;
    write(&out.join("mesh.obj"), |file| mesh.write_obj(file))?;
    let points = points::points(&scene, POINTS, hash(options.seed, 4));
    write(&out.join("points.ply"), |file| points::write_ply(&points, file))?;
    let cells = occupancy::occupancy(&scene);
    write(&out.join("occupancy.npz"), |file| occupancy::write_npz(&cells, file))?;
    let occupied_cells = cells.iter().filter(|&&occupied| occupied).count();
    Ok(Synthesized { pictures, triangles: mesh.triangles.len(), points: points.len(), occupied_cells })
}

/// Writes the pictures of one split and its JSON file.
fn photograph(scene: &Scene, out: &Path, split: &str, cameras: &[Camera]) -> Result<(), Error> {
    let folder = out.join(split);
    fs::create_dir_all(&folder).map_err(Error::write(&folder))?;
    let lights = Lights::new();
    cameras.par_iter().enumerate().try_for_each(|(i, camera)| {
        let picture = pictures::picture(scene, &lights, camera);
        let path = folder.join(format!("r_{i}.png"));
        let encoded = |file: &mut BufWriter<File>| picture.write_to(file, ImageFormat::Png).map_err(io::Error::other);
        write(&path, encoded)
    })?;
    let frame = |(i, camera): (usize, &Camera)| {
        let matrix = glam::DMat4::from_mat3_translation(camera.world_from_camera, camera.position);
        let rows = matrix.transpose().to_cols_array_2d();
        json!({ "file_path": format!("./{split}/r_{i}"), "transform_matrix": rows })
    };
    let frames: Vec<_> = cameras.iter().enumerate().map(frame).collect();
    let json = json!({ "camera_angle_x": CAMERA_ANGLE, "frames": frames });
    write(&out.join(format!("transforms_{split}.json")), |file| {
        serde_json::to_writer_pretty(&mut *file, &json).map_err(io::Error::from)
    })
}
