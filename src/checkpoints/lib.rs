//! Checkpoints of PyTorch programs: TensoRF's ([`tensorf`]) and those of the Strivec authors' program ([`authors`]) as scenes
//! and back, and grids of DVGO as occupied cells ([`torch`]). No pickle is ever executed.
#![forbid(unsafe_code)]

pub mod authors;
mod error;
mod family;
mod family_export;
mod pickle_writer;
mod state;
pub mod tensorf;
mod tensorf_export;
pub mod torch;

pub use error::Error;
pub use family::SceneOptions;
pub use pickle_writer::{Numbers, Tensor, Value, write_checkpoint, write_pickle};
pub use tensorf_export::tensorf_checkpoint;
