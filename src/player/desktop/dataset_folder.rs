//! Cameras and photographs of a dataset's folder.

use std::path::Path;

use crate::color::byte;
use crate::container::TrainingCamera;
use crate::dataset::{self, LoadOptions};
use crate::model::Scene;

/// A photograph: columns and rows, and \[row\]\[column\] red, green, blue, opacity.
type Rgba = ([u32; 2], Vec<u8>);

/// Reads the training cameras of the dataset in `folder`, and fills `cameras` with them, in the space of `scene`, if it
/// is empty.
///
/// # Errors
///
/// If `folder` is not a dataset.
pub(super) fn add_cameras(folder: &Path, scene: &Scene, cameras: &mut Vec<TrainingCamera>) -> Result<(), String> {
    let named = dataset::load_cameras(folder, "train", None, &LoadOptions::default()).map_err(|e| e.to_string())?;
    if cameras.is_empty() {
        let map = scene.frame.model_from_dataset;
        cameras.extend(named.iter().map(|named| TrainingCamera::from(&named.camera.mapped(&map))));
    }
    Ok(())
}

/// Reads photograph `n` of the dataset in `folder`, composited on `background`, sRGB from 0 to 1.
///
/// # Errors
///
/// If it cannot be read.
pub(super) fn photograph(folder: &Path, n: usize, background: [f32; 3]) -> Result<Option<Rgba>, String> {
    let options = LoadOptions { views: Some(n..n + 1), ..LoadOptions::default() };
    let dataset = dataset::load(folder, "train", &options).map_err(|e| e.to_string())?;
    Ok(dataset.views.into_iter().next().map(|view| {
        let colors = view.pixels.colors(background);
        let rgba = colors
            .iter()
            .flat_map(|c| {
                let [r, g, b] = c.map(|v| byte(v.into()));
                [r, g, b, 255]
            })
            .collect();
        ([view.camera.width, view.camera.height], rgba)
    }))
}
