//! Synthetic photographs of a scene with exact geometry: the project's demo and the ground truth of its tests.
//!
//! In: the number and size of views, a layout, a camera model, and a seed. Out: a folder in that layout with the scene's
//! exact mesh, points on its surface and an occupancy grid; in ScanNet's layout, with a mesh that has holes. The same seed
//! gives the same bytes on any number of threads. Viewpoints are the same in all layouts but ScanNet's.
#![forbid(unsafe_code)]

mod camera_model;
mod colmap;
mod error;
mod layout;
mod matrices;
mod mesh;
mod metashape;
mod occupancy;
mod options;
mod outdoor;
mod pictures;
mod points;
mod polytope;
mod portable;
mod room;
mod scan;
mod scene;
mod shading;
mod solid;
mod surroundings;
mod texture;
mod thing;
mod torn;
mod transforms;

use std::fs::{self, File};
use std::io::{self, BufWriter};
use std::path::{Path, PathBuf};

use image::ImageFormat;
use rayon::prelude::*;

pub use self::camera_model::CameraModel;
pub use self::error::Error;
use self::layout::PlannedPicture;
pub use self::layout::SynthLayout;
use self::mesh::SolidMesh;
pub use self::options::{SynthOptions, Synthesized};
use self::options::{check, prepare, write};
use self::portable::hash;
use self::scene::SyntheticScene;
use self::shading::Lights;
pub use self::surroundings::Surroundings;
use strivec_dataset::Split;
use strivec_format::geometry::{Camera, Ray};
use strivec_import::npy;

/// Number of points in `points.ply`.
const POINTS: usize = 100_000;
/// Number of points for sparse models; those that fewer than two pictures see are left out.
const SPARSE_POINTS: usize = 5000;
/// Number of points for sparse models of a room; those that fewer than two pictures see are left out.
const ROOM_POINTS: usize = 20_000;

/// Writes a synthetic dataset to the folder `out`: pictures with straight alpha as PNG, and the files of the layout:
///
/// - [`SynthLayout::Blender`]: `transforms_{train,val,test}.json` and `{train,val,test}/r_*.png`;
/// - [`SynthLayout::Transforms`]: `transforms.json` with `train_filenames` and its kin, the same pictures;
/// - [`SynthLayout::Colmap`] and [`SynthLayout::ColmapText`]: `sparse/0` with the points that at least two pictures see,
///   and `images/`, every eighth of which by name is a test view;
/// - [`SynthLayout::Nsvf`]: `intrinsics.txt`, `bbox.txt`, `pose/` and `rgb/` with names that begin with the split;
/// - [`SynthLayout::Llff`]: `poses_bounds.npy` and `images/`, every eighth of which is a test view;
/// - [`SynthLayout::ScanNet`]: other viewpoints, in meters, JPEG on white, two poses lost; a torn mesh and no other truth.
///
/// All but the last have the truth:
///
/// - `mesh.ply` and `mesh.obj`: the surface of each solid as triangles, closed, outward, vertices exact (PLY: in f32);
/// - `points.ply`: 100 000 points, uniform by area, with normals and sRGB diffuse colors;
/// - `occupancy.npz`: `occupancy`, bool \[z\]\[y\]\[x\], true if the cell, a closed box, has a point in common with a
///   solid or its inside, within 1e-9; `bounds`, float64 (2, 3), the grid's corners.
///
/// With surroundings, pictures are opaque, and in all layouts but ScanNet's `distances/` has the exact distances along the
/// rays of test views, float32 \[row\]\[column\], infinite to the sky. With a plain floor, the layout
/// [`SynthLayout::Transforms`] has the depth maps of all views in `depths/`.
///
/// The still life lies within \[−1, 1\]³, z up, a room within \[−2.5, 2.5\]³. Pictures of fisheye and equirectangular
/// cameras use the sines of the platform's mathematics library and may differ in their last bits between platforms.
///
/// # Errors
///
/// If an option is out of range, the layout cannot state the camera model or the split, the folder is not empty (unless
/// forced), or a file cannot be written.
pub fn synthesize(out: &Path, options: &SynthOptions) -> Result<Synthesized, Error> {
    check(options)?;
    prepare(out, options.force)?;
    if options.layout == SynthLayout::ScanNet {
        return scan::synthesize(out, options);
    }
    let SynthOptions { layout, camera, seed, .. } = *options;
    let scene = SyntheticScene::within(options.surroundings, options.seed);
    let cameras = |count: u32, stream: u64| -> Vec<Camera> {
        let pinholes = pictures::cameras(&scene, count, options.size, hash(seed, stream));
        pinholes.iter().map(|pinhole| camera.camera(pinhole)).collect()
    };
    let validation = cameras(options.test_views.div_ceil(4), 2);
    let photographs = layout.photographs(cameras(options.views, 1), validation, cameras(options.test_views, 3));
    take(&scene, out, &photographs, hash(seed, 8))?;
    if scene.surroundings != Surroundings::None {
        let tests: Vec<_> = photographs.iter().filter(|photograph| photograph.split == Split::Test).collect();
        write_distances(
            &tests,
            &scene,
            |_, _| 1.0,
            |photograph| out.join(format!("distances/{}.npy", photograph.stem())),
        )?;
    }
    let has_depths = scene.surroundings == Surroundings::Floor && layout == SynthLayout::Transforms;
    if has_depths {
        // Depths are along the optical axis.
        let all: Vec<_> = photographs.iter().collect();
        let cosine = |camera: &Camera, ray: &Ray| -ray.direction.dot(camera.world_from_camera.z_axis);
        write_distances(&all, &scene, cosine, |photograph| out.join(photograph.depth_file()))?;
    }
    let sparse_count = if scene.surroundings == Surroundings::Room { ROOM_POINTS } else { SPARSE_POINTS };
    let sparse_points = || points::points(&scene, sparse_count, hash(seed, 5));
    match layout {
        SynthLayout::Blender | SynthLayout::ScanNet => transforms::write_blender(out, &photographs)?,
        SynthLayout::Transforms => transforms::write_transforms(out, &photographs, camera, has_depths)?,
        SynthLayout::Colmap | SynthLayout::ColmapText => {
            let points = sparse_points();
            let model = colmap::Reconstruction::new(&scene, &photographs, &points, camera);
            model.write(out, layout == SynthLayout::ColmapText)?;
        }
        SynthLayout::Nsvf => matrices::write_nsvf(out, &photographs)?,
        SynthLayout::Llff => matrices::write_llff(out, &photographs, &sparse_points())?,
        SynthLayout::Metashape => metashape::write_metashape(out, &photographs, camera)?,
    }
    let mesh = SolidMesh::of_scene(&scene);
    write(&out.join("mesh.ply"), |file| mesh.write_ply(file))?;
    write(&out.join("mesh.obj"), |file| mesh.write_obj(file))?;
    let points = points::points(&scene, POINTS, hash(seed, 4));
    write(&out.join("points.ply"), |file| points::write_ply(&points, file))?;
    let cells = occupancy::occupancy(&scene);
    write(&out.join("occupancy.npz"), |file| occupancy::write_npz(&scene, &cells, file))?;
    let occupied_cells = cells.iter().filter(|&&occupied| occupied).count();
    let (pictures, triangles, points) = (photographs.len(), mesh.triangles.len(), points.len());
    Ok(Synthesized { pictures, lost: 0, triangles, torn: 0.0, points, occupied_cells })
}

/// Writes the exact distances along the rays of all pixels of `photographs`, times a `scale` of camera and ray, to the `files`;
/// infinite to the sky.
fn write_distances(
    photographs: &[&PlannedPicture],
    scene: &SyntheticScene,
    scale: impl Fn(&Camera, &Ray) -> f64 + Sync,
    file: impl Fn(&PlannedPicture) -> PathBuf + Sync,
) -> Result<(), Error> {
    photographs.par_iter().try_for_each(|photograph| {
        let camera = &photograph.camera;
        let path = file(photograph);
        let folder = path.parent().unwrap_or(Path::new("."));
        fs::create_dir_all(folder).map_err(Error::write(folder))?;
        let distance = |ray: Ray| {
            let to_scene = scene.hit(&ray, 0.0).map(|hit| hit.t);
            let to_ground = || outdoor::distance(&ray, scene.ground?);
            (scale(camera, &ray) * to_scene.or_else(to_ground).unwrap_or(f64::INFINITY)) as f32
        };
        let distances: Vec<f32> = camera.rays(0..camera.height).map(|ray| ray.map_or(f32::NAN, distance)).collect();
        let shape = [camera.height, camera.width].map(|extent| extent as usize);
        write(&path, |file| npy::write(file, &shape, distances))
    })
}

/// Writes the pictures, with exposures of `seed`.
fn take(scene: &SyntheticScene, out: &Path, photographs: &[PlannedPicture], seed: u64) -> Result<(), Error> {
    for photograph in photographs {
        let folder = out.join(&photograph.file);
        let folder = folder.parent().unwrap_or(out);
        fs::create_dir_all(folder).map_err(Error::write(folder))?;
    }
    let lights = Lights::new();
    photographs.par_iter().try_for_each(|photograph| {
        let exposure = pictures::exposure(scene, &photograph.camera, seed);
        let picture = pictures::picture(scene, &lights, &photograph.camera, exposure);
        let encoded = |file: &mut BufWriter<File>| picture.write_to(file, ImageFormat::Png).map_err(io::Error::other);
        write(&out.join(&photograph.file), encoded)
    })
}
