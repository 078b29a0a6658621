//! Where a scene is, before anything is known about it: occupied space from photographs, and tensors placed there.
//!
//! In: posed photographs, or occupied boxes and points from elsewhere. Out: [`VoxelBoxes`] in the dataset's space, the
//! map from there to the model's canonical box ([`canonical_map`]), and tensor clouds without numbers
//! ([`placement`]). What the tensors hold is left to training.
#![forbid(unsafe_code)]

mod bounds;
mod canonical;
pub mod coarse;
mod error;
mod first_hit;
pub mod import;
mod overlay;
pub mod placement;
mod sight;
mod voxel_boxes;

pub use bounds::{CameraBounds, frusta_box};
pub use canonical::{CANONICAL_HALF_EXTENT, CANONICAL_TOLERANCE, canonical_map};
pub use coarse::{CoarseOptions, CoarseProgress};
pub use error::Error;
pub use first_hit::{CellTree, FirstHit};
pub use overlay::overlay;
pub use placement::{ScaleShape, place_at, place_on_boxes, place_on_points};
pub use sight::{Advice, Sight, sight};
pub use voxel_boxes::VoxelBoxes;
