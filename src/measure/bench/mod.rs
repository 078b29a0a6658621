//! How fast training and rendering are, against what this machine can do.
//!
//! [`Peak`] measures the machine; [`training_steps`] and [`frames`] time the work and get its [`Work`] by stage;
//! [`FieldShape::cost`] says what that is in FLOP and bytes; [`StageTable`] divides the one by the other. [`Growth`]
//! tells how a cost grows with a parameter, [`Comparison`] whether one build is slower than another. [`ball`] is
//! something to measure where there is no scene. [`machine_speed`] is what plans of training need of all this.
//!
//! [`Work`]: crate::field::Work

mod against;
mod cost;
mod growth;
mod memory;
mod peak;
mod runs;
mod speed;
mod stages;
mod subject;
mod timing;

pub use against::{Comparison, by_turns};
pub use cost::{Cost, FieldShape, ScaleShape};
pub use growth::Growth;
pub use memory::MemoryMark;
pub use peak::{Peak, ProductRate, Rate};
pub use runs::{Measured, at_rest, frames, training_steps};
pub use speed::machine_speed;
pub use stages::{Bound, StageRow, StageTable, Total};
pub use subject::{ball, ball_on, ball_views, shell, voxel_for};
pub use timing::{Runs, Spread};
