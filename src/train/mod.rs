//! A scene from photographs, on the CPU: losses, gradients, optimizer, schedule, resumable progress.
//!
//! Results are the same on any number of threads: random draws are keyed by their place ([`crate::random`]), rays come
//! in chunks of fixed size, one task owns a tensor, and shared weights are summed in the order of chunks.

mod adam;
mod backward;
mod bootstrap;
mod checkpoint;
mod chunk;
mod component_mask;
mod config;
mod dead_components;
mod divergence;
mod factors;
mod initial;
mod networks;
mod occupancy;
mod pairs;
mod plan;
mod prepare;
mod prune;
mod ray_sampler;
mod rays;
mod resize;
mod trainer;
mod upsample;

pub(crate) use adam::Adam;
pub use adam::Moments;
pub use backward::{Backward, Gradients};
pub use bootstrap::{BootstrapOptions, bootstrap_prior};
pub use checkpoint::{Checkpoint, CheckpointError};
pub(crate) use chunk::RAYS_PER_CHUNK;
pub use chunk::{BatchRoulette, Target};
pub use config::{ConfigError, DecoderConfig, FieldConfig, ScaleConfig, TrainConfig};
pub use dead_components::{DeadComponents, MAX_LOSS, prune_dead_components};
pub use divergence::Divergence;
pub use initial::{initial_scene, march_step};
pub use networks::{NetworkLayout, network_parts};
pub use occupancy::estimate_occupancy;
pub use plan::{
    Budget, MachineSpeed, PIXELS_APART, PhotographMemory, Plan, ScalePlan, fit_to_budget, fit_to_photographs, plan,
};
pub use prepare::{PrepareError, place_scene, reconstruct_prior};
pub use prune::prune_unoccupied;
pub use ray_sampler::RaySampler;
pub use rays::RayBatch;
pub use resize::{ResizeRound, ResizeStep, Resized, ShrinkGoal, Tuning, grow, shrink};
pub use trainer::{StepReport, TrainError, Trainer};
pub use upsample::upsample;
