//! A scene as other programs' files.

mod state;
pub mod tensorf;
mod torch;

pub use torch::{Numbers, Tensor, Value, write_checkpoint};
