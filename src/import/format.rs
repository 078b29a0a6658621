//! Which reader a file is for.

use std::path::Path;

use super::{Fault, ImportError, Input, ReadOptions, Visitor};
use super::{arrays, colmap, e57, gltf, las, obj, octomap, pcd, ply, scannet, torch, xyz};

/// The formats, one reader each.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// Stanford's, of meshes and clouds.
    Ply,
    /// Wavefront's.
    Obj,
    /// glTF 2, as JSON or GLB.
    Gltf,
    /// Lines of numbers.
    Xyz,
    /// NumPy's, of points, grids and this project's priors.
    Arrays,
    /// The Point Cloud Library's.
    Pcd,
    /// LAS and LAZ.
    Las,
    /// ASTM E2807.
    E57,
    /// COLMAP's `points3D`, binary.
    ColmapBinary,
    /// COLMAP's `points3D`, text.
    ColmapText,
    /// A checkpoint that PyTorch wrote: DVGO's, TensoRF's.
    Torch,
    /// OctoMap's `.bt`, of bits, and `.ot`, of probabilities.
    Octomap,
}

/// Endings that name a format.
const ENDINGS: [(&str, Format); 21] = [
    ("ply", Format::Ply),
    ("obj", Format::Obj),
    ("gltf", Format::Gltf),
    ("glb", Format::Gltf),
    ("xyz", Format::Xyz),
    ("txt", Format::Xyz),
    ("csv", Format::Xyz),
    ("pts", Format::Xyz),
    ("asc", Format::Xyz),
    ("npy", Format::Arrays),
    ("npz", Format::Arrays),
    ("pcd", Format::Pcd),
    ("las", Format::Las),
    ("laz", Format::Las),
    ("e57", Format::E57),
    ("tar", Format::Torch),
    ("pth", Format::Torch),
    ("pt", Format::Torch),
    ("th", Format::Torch),
    ("bt", Format::Octomap),
    ("ot", Format::Octomap),
];

impl Format {
    /// By the file's name.
    ///
    /// # Errors
    ///
    /// If its ending is none of those that are read.
    pub fn from_path(path: &Path) -> Result<Self, Fault> {
        match path.file_name().and_then(|n| n.to_str()) {
            Some("points3D.bin") => return Ok(Self::ColmapBinary),
            Some("points3D.txt") => return Ok(Self::ColmapText),
            _ => {}
        }
        let ending = path.extension().map(|e| e.to_string_lossy().to_ascii_lowercase()).unwrap_or_default();
        ENDINGS.iter().find(|(known, _)| *known == ending).map(|(_, format)| *format).ok_or_else(|| {
            let known: Vec<_> = ENDINGS.iter().map(|(known, _)| format!(".{known}")).collect();
            Fault::malformed("the file's name", format!("points3D.bin, points3D.txt or one in {}", known.join(", ")), {
                if ending.is_empty() { "no ending".into() } else { format!(".{ending}") }
            })
        })
    }
}

/// Reads the geometry of `path` from its beginning to its end. A folder is a ScanNet scene's, whose mesh is read, or one with
/// COLMAP's points.
///
/// # Errors
///
/// If the file is of no known format or not what its format says, and those of `visitor`.
pub fn read(path: &Path, options: &ReadOptions, visitor: &mut dyn Visitor) -> Result<(), ImportError> {
    let of = |path: &Path| {
        let path = path.to_path_buf();
        move |fault: Fault| fault.of(&path)
    };
    if let Some(scan) = scannet::scan_of(path)? {
        return read_file(&scan.mesh, options, &mut scan.aligned(visitor));
    }
    if !path.is_dir() {
        return read_file(path, options, visitor);
    }
    let points = ["points3D.bin", "points3D.txt"].map(|name| path.join(name));
    match points.iter().find(|file| file.is_file()) {
        Some(file) => read_file(file, options, visitor),
        None => Err(of(path)(Fault::malformed("the folder", "a ScanNet scene, or COLMAP's points3D", "neither"))),
    }
}

fn read_file(path: &Path, options: &ReadOptions, visitor: &mut dyn Visitor) -> Result<(), ImportError> {
    let mut read = || {
        let format = Format::from_path(path)?;
        let mut input = Input::open(path)?;
        match format {
            Format::Ply => ply::read(&mut input, options, visitor),
            Format::Obj => obj::read(&mut input, options, visitor),
            Format::Gltf => gltf::read(&mut input, &|name| gltf::beside(path, name), options, visitor),
            Format::Xyz => xyz::read(&mut input, options, visitor),
            Format::Arrays => arrays::read(&mut input, options, visitor),
            Format::Pcd => pcd::read(&mut input, options, visitor),
            Format::Las => las::read(&mut input, options, visitor),
            Format::E57 => e57::read(&mut input, options, visitor),
            Format::ColmapBinary => colmap::read_binary(&mut input, options, visitor),
            Format::ColmapText => colmap::read_text(&mut input, options, visitor),
            Format::Torch => torch::read(&mut input, options, visitor),
            Format::Octomap => octomap::read(&mut input, options, visitor),
        }
    };
    read().map_err(|fault: Fault| fault.of(path))
}
