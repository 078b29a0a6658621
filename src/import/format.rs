//! The reader of each file, by its name.

use std::path::Path;

use super::{Fault, ImportError, Input, ReadOptions, Visitor, beside};
use super::{arrays, colmap, e57, gltf, las, obj, octomap, off, pcd, ply, splats, stl, xyz};

/// The supported formats, with one reader each.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// Stanford's polygon files: meshes and point clouds.
    Ply,
    /// Wavefront's meshes.
    Obj,
    /// glTF 2, as JSON or GLB.
    Gltf,
    /// Triangles, binary or text.
    Stl,
    /// Geomview's meshes.
    Off,
    /// Lines of numbers.
    Xyz,
    /// Lines of x, y, z and a normal.
    XyzNormals,
    /// Lines of x, y, z and a color.
    XyzColors,
    /// NumPy's arrays: points, grids, and occupied cells of a lattice.
    Arrays,
    /// The Point Cloud Library's point clouds.
    Pcd,
    /// LAS and LAZ point clouds.
    Las,
    /// ASTM E2807 scans.
    E57,
    /// COLMAP's `points3D`, binary.
    ColmapBinary,
    /// COLMAP's `points3D`, text.
    ColmapText,
    /// Checkpoints of DVGO and TensoRF, written by PyTorch.
    Torch,
    /// OctoMap's octrees: `.bt` (occupancy) and `.ot` (probabilities).
    Octomap,
    /// Gaussian splats as SPZ.
    Spz,
    /// Gaussian splats as records of 32 bytes.
    Splat,
    /// Gaussian splats as SOG, bundled.
    Sog,
    /// The `meta.json` of Gaussian splats as SOG.
    SogMeta,
    /// The depth maps that a `transforms.json` names.
    DepthMaps,
}

/// File name extensions and their formats.
const ENDINGS: [(&str, Format); 29] = [
    ("ply", Format::Ply),
    ("obj", Format::Obj),
    ("gltf", Format::Gltf),
    ("glb", Format::Gltf),
    ("stl", Format::Stl),
    ("off", Format::Off),
    ("spz", Format::Spz),
    ("splat", Format::Splat),
    ("sog", Format::Sog),
    ("xyz", Format::Xyz),
    ("xyzn", Format::XyzNormals),
    ("xyzrgb", Format::XyzColors),
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
    ("json", Format::DepthMaps),
];

impl Format {
    /// The format of the file `path`, by its name.
    ///
    /// # Errors
    ///
    /// If the extension is not supported.
    pub fn from_path(path: &Path) -> Result<Self, Fault> {
        match path.file_name().and_then(|n| n.to_str()) {
            Some("points3D.bin") => return Ok(Self::ColmapBinary),
            Some("points3D.txt") => return Ok(Self::ColmapText),
            Some(splats::SOG_META) => return Ok(Self::SogMeta),
            Some("lod-meta.json") => return Err(converted("SOG in levels of detail")),
            _ => {}
        }
        let ending = path.extension().map(|e| e.to_string_lossy().to_ascii_lowercase()).unwrap_or_default();
        if ending == "ksplat" {
            return Err(converted("the extension .ksplat"));
        }
        ENDINGS.iter().find(|(known, _)| *known == ending).map(|(_, format)| *format).ok_or_else(|| {
            let known: Vec<_> = ENDINGS.iter().map(|(known, _)| format!(".{known}")).collect();
            let found = if ending.is_empty() { "no extension".into() } else { format!("the extension .{ending}") };
            let problem = format!("{found} is not supported; use points3D.bin, points3D.txt or {}", known.join(", "));
            Fault::broken("the file name", problem)
        })
    }
}

/// The error for splats as `what`.
fn converted(what: &str) -> Fault {
    Fault::unsupported(what, "convert it to SOG, SPZ or PLY, for example by splat-transform")
}

/// Reads the geometry of the file `path`, or of a folder: SOG, or the points of COLMAP's in itself, or in `0` or `sparse/0`.
///
/// # Errors
///
/// If the format is unknown or of another crate ([`Format::Torch`], [`Format::DepthMaps`]), the file breaks its format, and
/// those of `visitor`.
pub fn read(path: &Path, options: &ReadOptions, visitor: &mut dyn Visitor) -> Result<(), ImportError> {
    if !path.is_dir() {
        return read_file(path, options, visitor);
    }
    let folders = ["", "0", "sparse/0"].map(|folder| path.join(folder));
    let points = folders.iter().flat_map(|folder| ["points3D.bin", "points3D.txt"].map(|name| folder.join(name)));
    match points.chain([path.join(splats::SOG_META)]).find(|file| file.is_file()) {
        Some(file) => read_file(&file, options, visitor),
        None => Err(Fault::broken(
            "the folder",
            "it has neither a ScanNet scene, nor the meta.json of SOG, nor, in itself, 0 or sparse/0, COLMAP's points3D.bin or points3D.txt",
        )
        .of(path)),
    }
}

fn read_file(path: &Path, options: &ReadOptions, visitor: &mut dyn Visitor) -> Result<(), ImportError> {
    let of = |fault: Fault| fault.of(path);
    let format = Format::from_path(path).map_err(of)?;
    let input = &mut Input::open(path).map_err(of)?;
    let read = match format {
        Format::Ply => ply::read(input, options, visitor),
        Format::Obj => obj::read(input, options, visitor),
        Format::Gltf => gltf::read(input, &|name| beside(path, name), options, visitor),
        Format::Stl => stl::read(input, options, visitor),
        Format::Off => off::read(input, options, visitor),
        Format::Xyz => xyz::read(input, options, visitor),
        Format::XyzNormals => xyz::read_normals(input, options, visitor),
        Format::XyzColors => xyz::read_colors(input, options, visitor),
        Format::Arrays => arrays::read(input, options, visitor),
        Format::Pcd => pcd::read(input, options, visitor),
        Format::Las => las::read(input, options, visitor),
        Format::E57 => e57::read(input, options, visitor),
        Format::ColmapBinary => colmap::read_binary(input, options, visitor),
        Format::ColmapText => colmap::read_text(input, options, visitor),
        Format::Octomap => octomap::read(input, options, visitor),
        Format::Spz => splats::read_spz(input, options, visitor),
        Format::Splat => splats::read_records(input, options, visitor),
        Format::Sog => splats::read_sog(input, options, visitor),
        Format::SogMeta => splats::read_sog_meta(input, &|name| beside(path, name), options, visitor),
        Format::Torch => Err(Fault::unsupported("a checkpoint of PyTorch", "read it with `strivec_checkpoints`")),
        Format::DepthMaps => Err(Fault::unsupported("a list of depth maps", "read it with `strivec_capture`")),
    };
    read.map_err(of)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::Seen;

    #[test]
    fn the_points_of_a_reconstruction_are_found_below_its_folder() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::create_dir_all(folder.path().join("sparse/0")).unwrap();
        let none = read(folder.path(), &ReadOptions::default(), &mut Seen::default()).unwrap_err().to_string();
        assert!(none.contains("sparse/0"), "{none}");
        std::fs::write(folder.path().join("sparse/0/points3D.txt"), "1 1 2 3 9 8 7 0.5 1 2\n").unwrap();
        for start in ["", "sparse", "sparse/0"] {
            let mut seen = Seen::default();
            read(&folder.path().join(start), &ReadOptions::default(), &mut seen).unwrap();
            assert_eq!(seen.positions(), [[1.0, 2.0, 3.0]], "{start}");
        }
    }
}
