//! Options for priors from files.

use std::path::PathBuf;

use strivec_recipe::Prior;

/// Prior options of commands that train.
#[derive(Clone, Debug, clap::Args)]
pub(crate) struct Inputs {
    /// Geometry, or output of `strivec prior`; repeatable [default: photographs]
    ///
    /// Occupied space from meshes, point clouds, grids and octrees in the dataset's space; several are joined. `strivec prior`
    /// reads geometry of other spaces and units, filters, closes and dilates it. Without files, the dataset's or matched
    /// points or a coarse reconstruction show where matter is.
    #[arg(long = "prior", value_name = "FILE")]
    files: Vec<PathBuf>,
    /// Find the occupied space with eight coarse tensors: slower, less precise
    #[arg(long, conflicts_with = "files", hide_short_help = true)]
    bootstrap: bool,
}

impl Inputs {
    /// The source of the prior.
    pub(crate) fn prior(&self) -> Prior {
        match (self.bootstrap, self.files.is_empty()) {
            (true, _) => Prior::Bootstrap,
            (false, true) => Prior::Photographs,
            (false, false) => Prior::Files { files: self.files.clone(), options: Box::default() },
        }
    }
}
