//! Priors from files, as arguments.

use std::path::PathBuf;

use crate::cli::{Error, Session};
use crate::prior::VoxelBoxes;

/// Where the scene is, from files.
#[derive(Clone, Debug, clap::Args)]
#[command(next_help_heading = "Prior from files")]
pub(in crate::cli) struct Inputs {
    /// Where the scene is: meshes, point clouds, grids, octrees, or what `strivec prior` wrote; several are joined
    #[arg(long = "prior", value_name = "INPUT")]
    pub(in crate::cli) files: Vec<PathBuf>,
}

impl Inputs {
    /// The occupied cells in the dataset's space; `None` where no file is named.
    pub(in crate::cli) fn voxels(&self, _session: &Session) -> Result<Option<VoxelBoxes>, Error> {
        if self.files.is_empty() { Ok(None) } else { todo!() }
    }
}
