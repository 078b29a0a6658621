//! Geometry from other programs' files: a stream of triangles, points and occupied cells.
//!
//! In: an untrusted file or folder. Out: calls of a [`Visitor`], so that memory holds at most a mesh's vertices. There
//! is one module per format. Each reader takes an [`Input`], a file or bytes in memory, and checks lengths before it
//! allocates.
#![forbid(unsafe_code)]

pub mod archive;
pub mod arrays;
mod beside;
pub mod colmap;
pub mod e57;
mod error;
mod format;
pub mod gltf;
pub mod grid;
mod input;
pub mod las;
pub mod npy;
pub mod obj;
pub mod octomap;
pub mod off;
pub mod pcd;
pub mod ply;
mod polygon;
pub mod splats;
pub mod stl;
#[doc(hidden)]
pub mod testing;
mod transformed;
mod visitor;
pub mod xyz;

pub use beside::beside;
pub use error::{Fault, ImportError};
pub use format::{Format, read};
pub use input::Input;
pub use transformed::Transformed;
pub use visitor::{LeftOut, Point, ReadOptions, Visitor};
