//! The whole way from photographs to a scene file: what `strivec train` does, for any program.
//!
//! In: a dataset's folder or its loaded views, and a [`Recipe`]: the settings ([`TrainConfig`](strivec_train::TrainConfig)),
//! the source of the prior, the budget, and the checkpoint. Out: a [`Trained`] scene with the bytes of its file. On the way,
//! an [`Observer`] receives messages, progress and the trainer after each step, and may stop the run, which then leaves a
//! checkpoint.
//!
//! [`Recipe::prepare`] finds where the scene is; [`run_steps`] trains; [`Packing`] makes a file of a given size. Results do
//! not depend on the observer or on the number of threads.
//!
//! ```
//! use strivec_synth::{SynthOptions, synthesize};
//! use strivec_recipe::{Photographs, Prior, Recipe};
//! use strivec_train::TrainConfig;
//!
//! let folder = std::env::temp_dir().join(format!("strivec-recipe-{}", std::process::id()));
//! synthesize(&folder, &SynthOptions { views: 6, test_views: 1, size: [16, 16], ..SynthOptions::default() })?;
//!
//! let mut config = TrainConfig::preset("fast")?.with_steps(20);
//! config.sampling.batch_rays = 64;
//! // After so few steps hardly anything is seen yet.
//! config.schedule.occupancy_at.clear();
//! let files = vec![folder.join("mesh.ply")];
//! let prior = Prior::Files { files, options: Default::default() };
//! let recipe = Recipe { prior, keep_dead: true, ..Recipe::new(config) };
//! let trained = recipe.train_folder(&folder, &Photographs::default(), &mut ())?;
//!
//! assert_eq!(trained.steps, 20);
//! assert!(strivec_format::container::decode(&trained.bytes)?.check().is_ok());
//! # std::fs::remove_dir_all(&folder)?;
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

#![forbid(unsafe_code)]

mod atomic_file;
mod background;
mod cache;
mod checkpoint_file;
mod distances;
mod error;
mod exposure;
mod fitting;
mod location;
mod observer;
mod packing;
mod photographs;
mod points;
mod prior;
mod prior_files;
mod refined_poses;
mod start;
mod steps;
mod trained;
mod training;
mod viewpoints;

pub use atomic_file::{
    FileError, Reservation, beside, check_output, read_file, remove_file, write_atomically, write_atomically_with,
    write_or_keep,
};
pub use cache::Cache;
pub use checkpoint_file::CheckpointFile;
pub use error::Error;
pub use fitting::Fitting;
pub use location::survey_photographs;
pub use observer::{Observer, ObserverError, Progress};
pub use packing::{JUDGED, PROBED, PackOptions, Packing};
pub use photographs::{Photographs, load};
pub use prior::Prior;
pub use prior_files::{build_prior, check_sight};
pub use refined_poses::{PosesError, RefinedPoses};
pub use start::Start;
pub use steps::run_steps;
pub use trained::Trained;
pub use training::{Recipe, Training};
