//! A scene from photographs, on the CPU: losses, gradients, optimizer, schedule, resumable progress.
//!
//! Results are the same on any number of threads: random draws are keyed by their place ([`crate::random`]), rays come
//! in chunks of fixed size, one task owns a tensor, and shared weights are summed in the order of chunks.

mod adam;
mod backward;
mod bootstrap;
mod chunk;
mod cleared;
mod config;
mod divergence;
mod factors;
mod initial;
mod networks;
mod occupancy;
mod pairs;
mod photographs;
mod plan;
mod prepare;
mod progress;
mod prune;
mod rays;
mod resize;
mod trainer;
mod unused;
mod upsample;

pub(crate) use adam::Adam;
pub use adam::Moments;
pub use backward::{Backward, Gradients};
pub use bootstrap::{BootstrapOptions, bootstrap_prior};
pub(crate) use chunk::RAYS_PER_CHUNK;
pub use chunk::{BatchThinning, Target};
pub use config::{ConfigError, DecoderConfig, FieldConfig, ScaleConfig, TrainConfig};
pub use divergence::Divergence;
pub use initial::{initial_scene, march_step};
pub use networks::{NetworkLayout, network_parts};
pub use occupancy::estimate_occupancy;
pub use photographs::Photographs;
pub use plan::{
    Budget, MachineSpeed, PIXELS_APART, PhotographMemory, Plan, ScalePlan, fit_to_budget, fit_to_photographs, plan,
};
pub use prepare::{PrepareError, place_scene, reconstruct_prior};
pub use progress::{Progress, ProgressError};
pub use prune::prune_unoccupied;
pub use rays::RayBatch;
pub use resize::{ResizeRound, ResizeStep, Resized, ShrinkGoal, Tuning, grow, shrink};
pub use trainer::{StepReport, TrainError, Trainer};
pub use unused::{MAX_LOSS, Unused, drop_unused};
pub use upsample::upsample;
