//! The photographs that a scene is trained on: their size, and what is said of them.

use std::path::Path;

use super::{Error, Observer};
use strivec_capture::dataset;
use strivec_capture::dataset::{Dataset, Description, LoadOptions};
use strivec_capture::prior;
use strivec_format::OptionName;
use strivec_format::digits::plural;
use strivec_format::geometry::Camera;

/// The photographs to load from a dataset's folder.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Photographs {
    /// The selection; its `downscale` is ignored.
    pub options: LoadOptions,
    /// The photographs are made this many times smaller. `None`: as often as the settings' largest side or
    /// [`LoadOptions::max_memory`] require.
    pub downscale: Option<u32>,
}

impl Photographs {
    /// The options that load the training photographs in `folder`: if no downscale is given, with at most `max_side` pixels
    /// a side ([`PhotographConfig::max_side`](strivec_train::PhotographConfig::max_side)) or, without this
    /// either, the largest that fit into the memory for them.
    ///
    /// # Errors
    ///
    /// If the cameras of the dataset cannot be read.
    pub fn load_options(
        &self,
        folder: &Path,
        max_side: Option<u32>,
        observer: &mut dyn Observer,
    ) -> Result<LoadOptions, dataset::Error> {
        let options = LoadOptions { downscale: self.downscale.unwrap_or(1), ..self.options.clone() };
        if self.downscale.is_some() {
            return Ok(options);
        }
        if let Some(most) = max_side {
            let cameras = dataset::load_cameras(folder, "train", None, &options)?;
            let side = cameras.iter().map(|named| named.camera.width.max(named.camera.height)).max().unwrap_or(0);
            let downscale = side.div_ceil(most.max(1)).max(1);
            if downscale > 1 {
                let message = format!("the settings ask for at most {most} pixels a side");
                observer.message(&format_args!("{} {downscale}: {message}", OptionName("downscale")));
            }
            return Ok(LoadOptions { downscale, ..options });
        }
        let (downscale, bytes) = dataset::fitting_downscale(folder, "train", &options)?;
        if downscale > 1 {
            let [full, most] = [bytes, options.max_memory].map(|bytes| bytes as f64 / 1e9);
            let [downscale_name, memory] = [OptionName("downscale"), OptionName("max_memory")];
            observer.message(&format_args!(
                "{downscale_name} {downscale}: photographs at full size take {full:.1} GB, and {memory} is {most:.1} GB"
            ));
        }
        Ok(LoadOptions { downscale, ..options })
    }
}

/// The training photographs in `folder`.
///
/// # Errors
///
/// [`Error::Dataset`].
pub fn load(folder: &Path, options: &LoadOptions, observer: &mut dyn Observer) -> Result<Dataset, Error> {
    let dataset = dataset::load(folder, "train", options)?;
    observer.message(&contents(&dataset));
    dataset.unreadable.iter().for_each(|error| observer.message(&format_args!("left out: {error}")));
    // A fault in another split does not hinder the training.
    match dataset::describe(folder, &LoadOptions { views: None, every: 1, ..options.clone() }) {
        Ok(description) => describe(folder, description, observer),
        Err(error) => observer.message(&format_args!("the rest of the dataset cannot be described: {error}")),
    }
    Ok(dataset)
}

/// The cameras and the inventory of the dataset in `folder`, a line each.
fn describe(folder: &Path, description: Description, observer: &mut dyn Observer) {
    let Description { splits, points, mut inventory, .. } = description;
    let cameras = splits.iter().flat_map(|(_, named)| named.iter().map(|named| named.camera));
    for group in dataset::group_cameras(&cameras.collect::<Vec<_>>()) {
        observer.message(&format_args!("cameras: {group}"));
    }
    let left_out = points.and_then(|file| prior::points_left_out(folder, &file));
    drop(inventory.entries.splice(..0, left_out));
    for (label, line) in inventory.lines() {
        observer.message(&format_args!("{label}: {line}"));
    }
}

/// One line on the photographs.
fn contents(dataset: &Dataset) -> String {
    let Dataset { name, views, lost, left_out, unreadable, .. } = dataset;
    let largest = |extent: fn(&Camera) -> u32| views.iter().map(|view| extent(&view.camera)).max().unwrap_or(0);
    let [width, height] = [largest(|camera| camera.width), largest(|camera| camera.height)];
    let photographs = plural(views.len(), "photograph");
    let mut text = format!("{name}: {photographs} to train on, {width}x{height} pixels at most");
    let distorted = views.iter().filter(|view| !view.camera.lens.is_pinhole()).count();
    let masked = views.iter().filter(|view| view.mask.is_some()).count();
    for (count, what) in [
        (distorted, "with a lens"),
        (masked, "with a mask"),
        (*lost, "without a pose"),
        (left_out.len(), "missing"),
        (unreadable.len(), "not readable"),
    ] {
        if count > 0 {
            text += &format!(", {count} {what}");
        }
    }
    text
}

/// The cameras of `dataset`'s photographs, in the dataset's space.
pub(super) fn cameras(dataset: &Dataset) -> Vec<Camera> {
    dataset.views.iter().map(|view| view.camera).collect()
}
