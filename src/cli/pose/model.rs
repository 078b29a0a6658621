//! COLMAP's models: which pictures are registered, the points' errors, the largest model first.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

use super::super::Error;
use super::folder::{SPARSE, UNSORTED, remove};
use strivec_capture::dataset::model_pictures;
use strivec_capture::prior::reprojection_errors;

/// A model.
#[derive(Debug, PartialEq)]
pub(super) struct Model {
    /// The registered pictures.
    pub(super) names: BTreeSet<String>,
    pub(super) points: u64,
    /// Mean over the points of their mean distance between projection and feature, in pixels, as COLMAP reports it.
    pub(super) reprojection_error: Option<f64>,
}

/// Moves the models from [`UNSORTED`] to [`SPARSE`] in `capture`, the one of the most pictures first. Returns false if
/// there is none.
pub(super) fn sort(capture: &Path) -> Result<bool, Error> {
    let unsorted = capture.join(UNSORTED);
    let mut found: Vec<(usize, PathBuf)> = Vec::new();
    for entry in fs::read_dir(&unsorted).map_err(Error::io("read", &unsorted))? {
        let folder = entry.map_err(Error::io("read", &unsorted))?.path();
        if folder.join("images.bin").is_file() {
            found.push((model_pictures(&folder)?.len(), folder));
        }
    }
    found.sort_by(|(a, first), (b, second)| b.cmp(a).then_with(|| first.cmp(second)));
    if found.is_empty() {
        return Ok(false);
    }
    let sorted = unsorted.join("sorted");
    fs::create_dir(&sorted).map_err(Error::io("make", &sorted))?;
    for (n, (_, folder)) in found.iter().enumerate() {
        fs::rename(folder, sorted.join(n.to_string())).map_err(Error::io("move", folder))?;
    }
    let sparse = capture.join(SPARSE);
    remove(&sparse, |path| fs::remove_dir_all(path))?;
    fs::rename(&sorted, &sparse).map_err(Error::io("write", &sparse))?;
    remove(&unsorted, |path| fs::remove_dir_all(path))?;
    Ok(true)
}

/// The models in `capture`, in order.
pub(super) fn read_all(capture: &Path) -> Result<Vec<Model>, Error> {
    let folders = (0..).map(|n: usize| capture.join(SPARSE).join(n.to_string())).take_while(|folder| folder.is_dir());
    folders.map(|folder| read(&folder)).collect()
}

fn read(folder: &Path) -> Result<Model, Error> {
    let errors = reprojection_errors(&folder.join("points3D.bin"))?;
    let mean = errors.iter().sum::<f64>() / errors.len() as f64;
    let reprojection_error = Some(mean).filter(|error| error.is_finite() && *error >= 0.0);
    Ok(Model { names: model_pictures(folder)?, points: errors.len() as u64, reprojection_error })
}
