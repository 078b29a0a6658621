//! Detection of a folder's layout.

use std::fs;
use std::path::Path;

use super::{Dataset, Error, LoadOptions, NamedCamera};
use super::{load_blender, load_blender_cameras, load_scannet, load_scannet_cameras};

/// The layout of photographs in a folder.
enum Layout {
    /// `transforms_*.json`.
    Blender,
    /// `pose` and `color`.
    ScanNet,
}

/// The split `split` of the dataset in `folder`, of any layout: Blender's if there is a `transforms_*.json`, else
/// ScanNet's if there is a folder `pose`.
///
/// # Errors
///
/// If the dataset cannot be read or is invalid: all of [`Error`] but those of writing.
pub fn load(folder: &Path, split: &str, options: &LoadOptions) -> Result<Dataset, Error> {
    match Layout::of(folder)? {
        Layout::Blender => load_blender(folder, split, options),
        Layout::ScanNet => load_scannet(folder, split, options),
    }
}

/// The cameras of the same split in the same order; no picture is decoded. `size` (columns and rows, before
/// downscaling) is for datasets that do not define the size of their pictures.
///
/// # Errors
///
/// If [`load`] fails, except for errors of pictures; or with [`Error::UnknownSize`].
pub fn load_cameras(
    folder: &Path,
    split: &str,
    size: Option<[u32; 2]>,
    downscale: u32,
) -> Result<Vec<NamedCamera>, Error> {
    match Layout::of(folder)? {
        Layout::Blender => load_blender_cameras(&folder.join(format!("transforms_{split}.json")), size, downscale),
        Layout::ScanNet => load_scannet_cameras(folder, split, size, downscale),
    }
}

impl Layout {
    fn of(folder: &Path) -> Result<Self, Error> {
        if folder.is_file() {
            return Err(Error::NotAFolder { path: folder.to_path_buf() });
        }
        for entry in fs::read_dir(folder).map_err(Error::read(folder))? {
            let name = entry.map_err(Error::read(folder))?.file_name();
            if name.to_str().is_some_and(|name| name.starts_with("transforms_") && name.ends_with(".json")) {
                return Ok(Self::Blender);
            }
        }
        // Cameras alone need no pictures.
        if folder.join("pose").is_dir() {
            return Ok(Self::ScanNet);
        }
        let found = if folder.join("transforms.json").is_file() {
            "transforms.json (rename it to transforms_train.json)"
        } else if folder.join("sparse").is_dir() || folder.join("colmap_sparse").is_dir() {
            "a COLMAP reconstruction (convert it to transforms_train.json)"
        } else if folder.join("poses_bounds.npy").is_file() {
            "LLFF's poses_bounds.npy (convert it to transforms_train.json)"
        } else {
            "neither"
        };
        Err(Error::Layout { path: folder.to_path_buf(), found })
    }
}
