//! Options for priors from files.

use std::path::PathBuf;

use super::shaping::Shaping;
use crate::Error;
use strivec_train::recipe::Prior;

/// Prior options of commands that train.
#[derive(Clone, Debug, clap::Args)]
#[command(next_help_heading = "Prior")]
pub(crate) struct Inputs {
    /// Prior geometry: meshes, point clouds, grids, octrees, or output of `strivec prior`; several are joined [default: coarse reconstruction from the photographs]
    #[arg(long = "prior", value_name = "INPUT")]
    files: Vec<PathBuf>,
    /// Find the occupied space with eight coarse tensors instead of the coarse reconstruction: slower, less precise
    #[arg(long, conflicts_with = "files")]
    bootstrap: bool,
    #[command(flatten)]
    shaping: Shaping,
}

impl Inputs {
    /// The source of the prior.
    pub(crate) fn prior(&self) -> Result<Prior, Error> {
        Ok(match (self.bootstrap, self.files.is_empty()) {
            (true, _) => Prior::Bootstrap,
            (false, true) => Prior::Photographs,
            (false, false) => Prior::Files { files: self.files.clone(), options: Box::new(self.shaping.options()?) },
        })
    }
}
