//! Training on the CPU: from photographs to a scene. Losses, gradients, optimizer, schedule, checkpoints.
//!
//! Results are the same on any number of threads: random draws are keyed by their index ([`strivec_format::random`]), rays come
//! in chunks of fixed size, one task owns a tensor, and sums over shared weights are in the order of chunks.
#![forbid(unsafe_code)]

mod adam;
mod backward;
mod block_rules;
mod bootstrap;
mod carving;
mod cells;
mod checkpoint;
mod chunk;
mod component_mask;
mod divergence;
mod error;
mod exposure;
mod factors;
mod for_file;
mod giving_up;
mod importance;
mod initial;
mod lean;
mod network_rounding;
mod networks;
mod occupancy;
pub mod pack;
mod pairs;
mod pixel_blocks;
mod pixel_set;
mod plan;
mod poses;
mod prepare;
mod prune;
mod ray_errors;
mod ray_sampler;
mod rays;
mod rounding;
mod schedule;
mod shrink;
mod trainer;
mod upsample;

pub(crate) use adam::Adam;
pub use adam::Moments;
pub use backward::{Backward, Gradients};
pub use bootstrap::bootstrap_prior;
pub use carving::carved;
pub use cells::{Cell, CellMap, FLAT};
pub use checkpoint::Checkpoint;
pub(crate) use chunk::RAYS_PER_CHUNK;
pub use chunk::{BatchRoulette, Target};
pub use divergence::Divergence;
pub use error::{CheckpointError, TrainError};
pub use exposure::Exposures;
pub use importance::{BlockImportance, DeadComponents, FactorImportance, MAX_LOSS, prune_dead_components};
pub use initial::initial_scene;
pub use network_rounding::NETWORK_BITS;
pub use networks::{NetworkLayout, network_parts};
pub use occupancy::estimate_occupancy;
use occupancy::tight_occupancy;
pub use plan::{
    Budget, MachineSpeed, PIXELS_APART, PhotographMemory, Plan, ScalePlan, fit_to_budget, fit_to_photographs, plan,
};
pub use prepare::{PrepareError, covered_share, place_scene, reconstruct_prior, with_far_cells};
pub use prune::prune_unoccupied;
pub use ray_sampler::RaySampler;
pub use rays::RayBatch;
pub use rounding::Rounding;
pub use shrink::{ShrinkGoal, Tuning, compacted, shrink};
pub use strivec_settings::{
    BootstrapOptions, ConfigError, DecoderConfig, Exposure, FinishConfig, LeanConfig, LossConfig, OptimizerConfig,
    PhotographConfig, PoseConfig, Preset, SamplingConfig, ScaleConfig, ScheduleConfig, SpaceConfig, TrainConfig,
    march_step,
};
pub use trainer::{StepReport, Trainer};
pub use upsample::upsample;
