//! A dataset as it would be loaded, without its pictures.

use std::path::{Path, PathBuf};

use super::capture::Capture;
use super::inventory_entry::{InventoryEntry, Standing, relative_to};
use super::names::NamesOfFolders;
use super::shot::Split;
use super::{Error, Inventory, Layout, LoadOptions, NamedCamera, files, masks, photographs};
use strivec_format::digits::plural;
use strivec_format::geometry::Aabb;

/// A dataset without its pictures.
#[derive(Clone, Debug, PartialEq)]
pub struct Description {
    /// The dataset's name, which is the folder's.
    pub name: String,
    /// Layout of the dataset.
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
    /// The range of distances from the cameras at which the scene is, if its files have one.
    pub range: Option<[f64; 2]>,
    /// The used, unused and absent files of the folder.
    pub inventory: Inventory,
}

/// The dataset in `folder` as it would be loaded, whether or not its pictures exist.
///
/// # Errors
///
/// The errors of [`load_cameras`](super::load_cameras).
pub fn describe(folder: &Path, options: &LoadOptions) -> Result<Description, Error> {
    let layout = options.layout.map_or_else(|| Layout::of(folder), Ok)?;
    let options = LoadOptions { layout: Some(layout), ..options.clone() };
    let mut capture = photographs::capture(folder, "all", &options)?;
    let mut names = Vec::new();
    for name in Split::ALL.map(Split::name) {
        match capture.split(name, &options.holdout) {
            Err(
                Error::Split { .. } | Error::EmptySplit { .. } | Error::NoFrames { .. } | Error::MissingPictures { .. },
            ) => continue,
            // Test views that are the validation views are counted once.
            Ok(shots) if name == "test" && shots[0].split == Some(Split::Validation) => continue,
            found => found?,
        };
        names.push(name);
    }
    let (splits, mut entries) = photographs::described(&capture, &names, folder, &options)?;
    if splits.is_empty() {
        capture.split("all", &options.holdout)?;
    }
    let masks = capture.shots.iter().filter(|shot| shot.mask.is_some()).count();
    if let Some(mask) = capture.shots.iter().find_map(|shot| shot.mask.as_ref())
        && masks::is_black(mask).unwrap_or(false)
    {
        let what = "the first mask is black alone: nothing of its photograph counts";
        entries.push(InventoryEntry::new(Standing::Doubtful, relative_to(folder, mask), 1, what));
    }
    let absent = capture.shots.iter().map(|shot| &shot.picture).filter(|picture| !picture.is_file());
    let missing: Vec<PathBuf> = capture.left_out.iter().chain(absent).cloned().collect();
    if let Some(first) = missing.first() {
        let instead = NamesOfFolders::default().instead_of(first);
        let what = format!("{} not there, the first of them, {instead}", plural(missing.len(), "picture"));
        entries.push(InventoryEntry::new(Standing::Absent, relative_to(folder, first), missing.len(), what));
    }
    capture.entries.append(&mut entries);
    let inventory = Inventory::of(folder, layout, &capture, options.downscale);
    let Capture { lost, points, bounds, range, .. } = capture;
    Ok(Description {
        name: files::name_of(folder),
        layout,
        splits,
        masks,
        lost,
        missing,
        points,
        bounds,
        range,
        inventory,
    })
}
