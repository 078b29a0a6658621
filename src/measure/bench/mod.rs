//! Speed of training and rendering, relative to the peak of the machine.
//!
//! [`Peak`] measures the machine. [`training_steps`] and [`frames`] measure time and [`Work`] by stage.
//! [`FieldShape::cost`] converts work to FLOP and bytes. [`StageTable`] combines them to rates and shares of the peak.
//! [`Growth`] fits the growth of a cost with a parameter; [`Comparison`] compares two builds. [`ball`] is a synthetic
//! scene for measurements without a file. [`machine_speed`] is a quick estimate for plans of training.
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
