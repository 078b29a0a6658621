//! Geometry from other programs' files: triangles, points and occupied cells, one after the other.
//!
//! In: a file or a folder from anywhere, of which nothing is trusted. Out: calls of a [`Visitor`], so that nothing larger
//! than a mesh's vertices is held in memory. [`crate::prior::build()`] makes a prior of them. One file a format;
//! each reader takes an [`Input`], which may as well be bytes in memory, and checks lengths before it sets memory aside.

mod archive;
pub mod arrays;
pub mod colmap;
pub mod e57;
mod error;
mod format;
pub mod gltf;
mod grid;
mod input;
pub mod las;
pub mod obj;
pub mod octomap;
pub mod pcd;
pub mod ply;
mod scannet;
#[cfg(test)]
mod testing;
pub mod torch;
mod visitor;
pub mod xyz;

pub use error::{Fault, ImportError};
pub use format::{Format, read};
pub use input::Input;
pub use visitor::{Point, ReadOptions, Visitor};
