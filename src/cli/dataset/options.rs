//! Options of commands that read a dataset.

use std::path::PathBuf;

use crate::named_value::one_of;
use crate::numbers::in_range;
use crate::quantity;
use strivec_capture::dataset::{Holdout, Layout, LoadOptions};

/// Layout and splits of a dataset.
#[derive(Clone, Debug, Default, clap::Args)]
pub(crate) struct DatasetOptions {
    /// Layout of the folder [default: by its files]
    #[arg(long, value_parser = one_of(Layout::ALL, Layout::name), help_heading = "Dataset")]
    layout: Option<Layout>,
    /// Test views: every Nth photograph; 0 for none
    ///
    /// For datasets without splits. Photographs are in the order of their names.
    #[arg(long, value_name = "N", default_value_t = Holdout::default().every, conflicts_with = "test_names", help_heading = "Dataset")]
    test_every: usize,
    /// Test views: those named in a text file
    ///
    /// For datasets without splits. The file has one name per line.
    #[arg(long, value_name = "FILE", help_heading = "Dataset")]
    test_names: Option<PathBuf>,
    /// Leave out photographs whose pictures do not exist
    #[arg(long, help_heading = "Dataset")]
    skip_missing: bool,
    /// Maximum memory of the loaded photographs, as in 16GB
    ///
    /// A pixel takes 4 bytes, 16 if photographs are downscaled. Memory for decoding counts as well.
    #[arg(long, value_name = "SIZE", default_value = MAX_MEMORY, value_parser = quantity::size, help_heading = "Dataset")]
    max_memory: u64,
    /// Turn the dataset about its z axis
    ///
    /// The paper measures so how much a model depends on the axes. Points, meshes and boxes of the dataset are left out.
    #[arg(long, value_name = "DEGREES", default_value_t = 0.0, hide_default_value = true, allow_hyphen_values = true,
        value_parser = in_range(f64::MIN..=f64::MAX, "a number of degrees"), help_heading = "Dataset")]
    turn: f64,
}

/// The text of the default of [`LoadOptions::max_memory`].
const MAX_MEMORY: &str = "8GB";

impl DatasetOptions {
    /// Options to load all views, downscaled `downscale` times.
    pub(crate) fn load_options(&self, downscale: u32) -> LoadOptions {
        LoadOptions {
            downscale,
            layout: self.layout,
            holdout: Holdout { every: self.test_every, names: self.test_names.clone() },
            skip_missing: self.skip_missing,
            max_memory: self.max_memory,
            turn_degrees: self.turn,
            ..LoadOptions::default()
        }
    }
}
