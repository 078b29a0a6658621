//! The scene as a scanned room: ScanNet's layout, a mesh with holes, and poses before alignment.

use std::fs;
use std::io::{self, Write};
use std::path::Path;

use glam::{DMat3, DMat4, DVec3};
use image::codecs::jpeg::JpegEncoder;
use image::{ExtendedColorType, RgbaImage};
use rayon::prelude::*;

use super::mesh::SolidMesh;
use super::options::{SynthOptions, Synthesized, write};
use super::pictures::{cameras, picture};
use super::portable::{cos_sin, hash, srgb};
use super::room;
use super::scene::SyntheticScene;
use super::shading::Lights;
use super::solid::Face;
use super::surroundings::Surroundings;
use super::thing::Thing;
use crate::Error;
use strivec_dataset::OPENGL_FROM_OPENCV;
use strivec_dataset::files;
use strivec_format::color::byte;
use strivec_format::geometry::Camera;

/// Meters per unit of the scene: the still life is 4.8 m across, or half of that in a room of 5.5 by 4.6 m.
const SCALE: f64 = 2.4;
const SCALE_IN_ROOM: f64 = 1.2;
/// The longest edge of the mesh's triangles and the radii of its holes, in the scene's units.
const LONGEST: f64 = 0.03;
const RADII: [f64; 2] = [0.05, 0.15];
/// The share of the surface's area that is missing in the mesh.
const TORN: f64 = 0.08;
/// Number of frames whose pose is lost.
const LOST: u32 = 2;
/// JPEG quality, 1 to 100.
const QUALITY: u8 = 95;

/// Writes the synthetic scene to the folder `out` in ScanNet's layout, with files named after the folder:
///
/// - `color/N.jpg` on white, and `pose/N.txt` with OpenCV's axes; two frames beyond the number of views have infinite
///   poses, like the lost frames of a scanner. The layout has no splits: `views` and `test_views` are added up.
/// - `intrinsic/intrinsic_color.txt`; `NAME.txt` with sizes, focal lengths and an axis alignment that turns about z and
///   tilts.
/// - `NAME_vh_clean_2.ply`: the surface before alignment, with vertex colors; holes of 8 % of its area. Of a room's floor,
///   walls and ceiling it has the inner sides.
///
/// Aligned, the still life lies within ±2.4 m, a room within ±3 m, z up.
pub(super) fn synthesize(out: &Path, options: &SynthOptions) -> Result<Synthesized, Error> {
    let name = files::name_of(out);
    let scene = SyntheticScene::within(options.surroundings, options.seed);
    let scale = if scene.surroundings == Surroundings::Room { SCALE_IN_ROOM } else { SCALE };
    let stored_from_aligned = aligned_from_stored().inverse();

    let count = options.views + options.test_views + LOST;
    let cameras = cameras(&scene, count, options.size, hash(options.seed, 1));
    let lost = lost(count, hash(options.seed, 2));
    let folders = ["color", "pose", "intrinsic"].map(|part| out.join(part));
    folders.iter().try_for_each(|folder| fs::create_dir_all(folder).map_err(Error::write(folder)))?;
    let [color, pose, intrinsic] = folders;
    let lights = Lights::new();
    cameras.par_iter().enumerate().try_for_each(|(i, camera)| {
        let rgb = on_white(&picture(&scene, &lights, camera, 1.0));
        write(&color.join(format!("{i}.jpg")), |file| {
            let mut encoder = JpegEncoder::new_with_quality(file, QUALITY);
            let encoded = encoder.encode(&rgb, camera.width, camera.height, ExtendedColorType::Rgb8);
            encoded.map_err(io::Error::other)
        })?;
        let matrix = if lost.contains(&(i as u32)) {
            DMat4::from_cols_array(&[f64::NEG_INFINITY; 16])
        } else {
            let opencv = camera.world_from_camera * OPENGL_FROM_OPENCV;
            stored_from_aligned * DMat4::from_mat3_translation(opencv, scale * camera.position)
        };
        write(&pose.join(format!("{i}.txt")), |file| file.write_all(lines(&matrix).as_bytes()))
    })?;
    let camera = &cameras[0];
    let [[fx, fy], [mx, my]] = [camera.focal, camera.principal];
    let intrinsics = DMat4::from_cols_array_2d(&[
        [fx, 0.0, 0.0, 0.0],
        [0.0, fy, 0.0, 0.0],
        [mx, my, 1.0, 0.0],
        [0.0, 0.0, 0.0, 1.0],
    ]);
    write(&intrinsic.join("intrinsic_color.txt"), |file| file.write_all(lines(&intrinsics).as_bytes()))?;
    write(&out.join(format!("{name}.txt")), |file| file.write_all(constants(camera, count).as_bytes()))?;

    let (mut mesh, mut colors) = (SolidMesh::default(), Vec::new());
    for thing in &scene.things {
        let first = mesh.vertices.len();
        let mut solid = SolidMesh::default();
        solid.sweep(&thing.solid);
        if thing.lets_light_through {
            solid.keep(room::faces_inside);
        }
        solid.refine(LONGEST);
        colors.extend(solid.vertices.iter().map(|&vertex| color_at(thing, vertex)));
        mesh.triangles.extend(solid.triangles.iter().map(|t| t.map(|index| index + first as u32)));
        mesh.vertices.append(&mut solid.vertices);
    }
    let (torn, was) = mesh.tear(TORN, RADII, hash(options.seed, 3));
    let colors: Vec<[u8; 3]> = was.iter().map(|&index| colors[index as usize]).collect();
    mesh.vertices.iter_mut().for_each(|v| *v = stored_from_aligned.transform_point3(scale * *v));
    write(&out.join(format!("{name}_vh_clean_2.ply")), |file| write_ply(&mesh, &colors, file))?;
    let (pictures, triangles) = (cameras.len(), mesh.triangles.len());
    Ok(Synthesized { pictures, lost: lost.len(), triangles, torn, points: 0, occupied_cells: 0 })
}

/// The map from the scanner's space to the aligned space, whose z is up: a rotation about z, a small tilt, and a shift
/// in meters.
fn aligned_from_stored() -> DMat4 {
    let ((c, s), (cos, sin)) = (cos_sin(1.0 / 11.0), cos_sin(0.02));
    let turn = DMat3::from_cols(DVec3::new(c, s, 0.0), DVec3::new(-s, c, 0.0), DVec3::Z);
    let tilt = DMat3::from_cols(DVec3::X, DVec3::new(0.0, cos, sin), DVec3::new(0.0, -sin, cos));
    DMat4::from_mat3_translation(turn * tilt, DVec3::new(-2.7, 1.9, 1.3))
}

/// Two different frames of `count`, at least 4, none of which is a test view.
fn lost(count: u32, seed: u64) -> [u32; LOST as usize] {
    let training = |frame: u32| (frame + u32::from(frame % 8 == 4)) % count;
    let first = training((seed % u64::from(count)) as u32);
    [first, training((first + count / 2) % count)]
}

/// The rows of a matrix, as text of a scan's file.
fn lines(matrix: &DMat4) -> String {
    let row = |row: [f64; 4]| row.map(|value| format!("{value:.6}")).join(" ") + "\n";
    matrix.transpose().to_cols_array_2d().map(row).concat()
}

/// The scan's constants.
fn constants(camera: &Camera, frames: u32) -> String {
    let rows = aligned_from_stored().transpose().to_cols_array();
    let alignment = rows.map(|value| format!("{value:.6} ")).concat();
    let ([fx, fy], [mx, my]) = (camera.focal, camera.principal);
    format!(
        "axisAlignment = {alignment}\ncolorHeight = {}\ncolorWidth = {}\nfx_color = {fx:.6}\nfy_color = {fy:.6}\n\
         mx_color = {mx:.6}\nmy_color = {my:.6}\nnumColorFrames = {frames}\nsceneType = Misc.\n",
        camera.height, camera.width
    )
}

/// Red, green and blue of `picture` on white.
fn on_white(picture: &RgbaImage) -> Vec<u8> {
    let over =
        |value: u8, alpha: u8| byte((f64::from(value) * f64::from(alpha) / 255.0 + f64::from(255 - alpha)) / 255.0);
    picture.pixels().flat_map(|p| [over(p[0], p[3]), over(p[1], p[3]), over(p[2], p[3])]).collect()
}

/// The diffuse color of `thing` at `point`, which is on its surface or, between vertices of a mesh, near it.
fn color_at(thing: &Thing, point: DVec3) -> [u8; 3] {
    let p = thing.solid.local(point);
    let bounds = &thing.solid.bounds;
    let mut faces: Vec<(f64, Face)> = Vec::new();
    for axis in 0..3 {
        faces.push(((p[axis] - bounds.min[axis]).abs(), Face::Flat { axis, upper: false }));
        faces.push(((p[axis] - bounds.max[axis]).abs(), Face::Flat { axis, upper: true }));
    }
    if let Some(round) = thing.solid.round {
        let distance = round.about.offset(p).length();
        // First, because flat parts also belong to the box of a round solid.
        faces.insert(0, ((distance - round.outer).abs(), Face::Outer));
        if round.inner > 0.0 {
            faces.insert(0, ((distance - round.inner).abs(), Face::Inner));
        }
    }
    let nearest = faces.into_iter().min_by(|a, b| a.0.total_cmp(&b.0)).expect("a box has faces");
    thing.texture.albedo(p, nearest.1, thing.texture_seed).to_array().map(srgb).map(byte)
}

/// A binary little-endian PLY file as in ScanNet: `vertex` with float x, y, z and uchar red, green, blue, alpha; `face`
/// with uchar, int `vertex_indices`.
fn write_ply(mesh: &SolidMesh, colors: &[[u8; 3]], out: &mut impl Write) -> io::Result<()> {
    write!(
        out,
        "ply\nformat binary_little_endian 1.0\nelement vertex {}\nproperty float x\nproperty float y\n\
         property float z\nproperty uchar red\nproperty uchar green\nproperty uchar blue\nproperty uchar alpha\n\
         element face {}\nproperty list uchar int vertex_indices\nend_header\n",
        mesh.vertices.len(),
        mesh.triangles.len()
    )?;
    for (vertex, color) in mesh.vertices.iter().zip(colors) {
        out.write_all(vertex.as_vec3().to_array().map(f32::to_le_bytes).as_flattened())?;
        out.write_all(color)?;
        out.write_all(&[u8::MAX])?;
    }
    for triangle in &mesh.triangles {
        out.write_all(&[3])?;
        out.write_all(triangle.map(u32::to_le_bytes).as_flattened())?;
    }
    Ok(())
}
