//! Making files small: what each number of a scene is worth, and which encoding spends fewest bytes on a given loss.
//!
//! In: a scene. Out: a scene with components dropped, the options to encode it with, and what the loss measures. Neither
//! a dataset nor training is needed: a scene is judged by its own pictures from cameras around it.
#![forbid(unsafe_code)]

mod judge;
mod lossy;
mod prefix;
mod prune;
mod rays;
mod search;
mod sensitivity;

pub use judge::Judge;
pub use lossy::{Lossy, lossy};
pub use prefix::fit_prefix;
pub use prune::{crop, prune};
pub use rays::{Views, probe_views};
pub use search::{Candidate, Goal, MAX_TRIED, search};
pub use sensitivity::{Sensitivity, sensitivity};
