//! Options of the photographs that pictures are compared with.

use std::path::PathBuf;

use crate::Error;
use crate::view_selection::ViewSelection;
use strivec_capture::dataset;
use strivec_capture::dataset::{Dataset, LoadOptions, Photograph};
use strivec_recipe::RefinedPoses;

/// The selected views of a dataset.
#[derive(Clone, Debug, clap::Args)]
pub(crate) struct Photographs {
    /// Dataset folder
    dataset: PathBuf,
    /// Split of the dataset: train, val, test or all; for Blender's layout S of transforms_S.json
    #[arg(long, value_name = "S", default_value = "test")]
    pub(crate) split: String,
    /// Downscale photographs N times
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..))]
    pub(crate) downscale: u32,
    #[command(flatten)]
    selection: ViewSelection,
    /// Refined poses of the training views, as a training with `poses.refine` writes them: views move by the similarity from the
    /// dataset's poses to these [default: views stay where the dataset has them]
    #[arg(long, value_name = "FILE")]
    aligned_to: Option<PathBuf>,
}

impl Photographs {
    /// The dataset with the selected views alone, moved to the refined poses if they are given.
    ///
    /// # Errors
    ///
    /// If the dataset or the file of poses cannot be read or is refused.
    pub(crate) fn load(&self) -> Result<Dataset, Error> {
        let options = self.selection.options(self.downscale);
        let mut dataset = dataset::load(&self.dataset, &self.split, &options)?;
        if let Some(path) = &self.aligned_to {
            let all = LoadOptions { views: None, every: 1, ..options };
            let cameras = dataset::load_cameras(&self.dataset, "train", None, &all)?;
            let (map, focal_scale) = RefinedPoses::alignment(path, &cameras).or_else(|error| {
                // They may be the poses of a training on other photographs of the dataset.
                let cameras = dataset::load_cameras(&self.dataset, "all", None, &all);
                cameras.ok().and_then(|cameras| RefinedPoses::alignment(path, &cameras).ok()).ok_or(error)
            })?;
            for Photograph { camera, .. } in &mut dataset.views {
                *camera = camera.mapped(&map);
                camera.focal = camera.focal.map(|focal| focal_scale * focal);
            }
        }
        Ok(dataset)
    }
}
