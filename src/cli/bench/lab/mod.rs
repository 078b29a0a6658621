//! Speed of training and rendering.
//!
//! [`training_steps`] and [`frames`] measure time by stage ([`StageTable`]) and memory. [`BuildComparison`] compares two builds.
//! [`ball`] is a synthetic scene for measurements without a file. [`machine_speed`] is a quick estimate for plans of
//! training.

mod against;
mod memory;
mod runs;
mod speed;
mod stages;
mod subject;
mod timing;

pub use against::{BuildComparison, by_turns};
pub use memory::MemoryMark;
pub use runs::{Measured, at_rest, frames, training_steps};
pub use speed::machine_speed;
pub use stages::{StageRow, StageTable, Total};
pub use subject::{ball, ball_views};
pub use timing::{Runs, Spread};
