//! Small files: pruning, cropping, and the encoding with the fewest bytes for a given distortion.
//!
//! In: a scene. Out: the scene with components pruned, the options to encode it with, and the distortion. A dataset is
//! not needed: the scene's own pictures from cameras around it are the reference. Photographs can be that, too.

mod balance;
mod crop;
mod distortion;
mod for_size;
mod layout;
mod lossless;
mod lossy;
mod occupancy;
mod prefix;
mod probes;
mod prune;
mod search;
mod views;

pub use balance::{balance, balance_block};
pub use crop::{crop, keep_scales};
pub use distortion::ReferencePictures;
pub use for_size::{begin_for_size, rounded_to_size, size, steer_to_size};
pub use layout::{FileLayout, arranged};
pub use lossless::lossless;
pub use lossy::{Lossy, lossy};
pub use prefix::fit_prefix;
pub use probes::true_probes;
pub use prune::prune;
pub use search::{Candidate, Goal, MAX_TRIED, search};
pub use views::{ModelCameras, probe_views};
