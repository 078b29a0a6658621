//! A dataset as it would be loaded, without its pictures.

use std::path::{Path, PathBuf};

use super::shot::Split;
use super::{Error, Layout, LoadOptions, NamedCamera, files, photographs};
use crate::geometry::Aabb;

/// A dataset without its pictures.
#[derive(Clone, Debug, PartialEq)]
pub struct Description {
    /// The dataset's name, which is the folder's.
    pub name: String,
    /// Its layout.
    pub layout: Layout,
    /// The cameras of each split that has any.
    pub splits: Vec<(&'static str, Vec<NamedCamera>)>,
    /// Number of photographs with a mask.
    pub masks: usize,
    /// Number of frames without a pose.
    pub lost: usize,
    /// The pictures that do not exist.
    pub missing: Vec<PathBuf>,
    /// A file of points on the scene's surfaces, in the dataset's space.
    pub points: Option<PathBuf>,
    /// The scene's box in the dataset's space, if its files have one.
    pub bounds: Option<Aabb>,
}

/// The dataset in `folder` as it would be loaded, whether or not its pictures exist.
///
/// # Errors
///
/// As [`load_cameras`](super::load_cameras)'s.
pub fn describe(folder: &Path, options: &LoadOptions) -> Result<Description, Error> {
    let layout = options.layout.map_or_else(|| Layout::of(folder), Ok)?;
    let name = files::name_of(folder);
    let (splits, missing, points) = (Vec::new(), Vec::new(), None);
    let mut all = Description { name, layout, splits, masks: 0, lost: 0, missing, points, bounds: None };
    for split in [Split::Train, Split::Validation, Split::Test].map(Split::name) {
        let mut capture = match layout.read(folder, split, options.downscale) {
            Err(Error::MissingSplit { .. } | Error::Split { .. }) if split != "train" => continue,
            read => read?,
        };
        let of_split = match capture.split(split, &options.holdout) {
            Err(Error::Split { .. } | Error::NoFrames { .. }) => continue,
            // Test views that are the validation views are counted once.
            Ok(shots) if split == "test" && shots.iter().any(|shot| shot.split == Some(Split::Validation)) => continue,
            shots => shots?,
        };
        all.masks += of_split.iter().filter(|shot| shot.mask.is_some()).count();
        all.missing.extend(of_split.iter().map(|shot| &shot.picture).filter(|p| !p.is_file()).cloned());
        if all.splits.is_empty() || capture.lost > 0 {
            all.missing.append(&mut capture.left_out);
        }
        all.lost += capture.lost;
        (all.points, all.bounds) = (all.points.or(capture.points.take()), all.bounds.or(capture.bounds));
        all.splits.push((split, photographs::cameras(capture, split, None, options)?));
    }
    if all.splits.is_empty() { Err(Error::NoFrames { path: folder.to_path_buf() }) } else { Ok(all) }
}
