//! Boxes, rays, cameras and their paths, lattices, and the map between a dataset's space and the model's. Everything is f64.

mod aabb;
mod camera;
mod lattice;
mod path;
mod pose;
mod ray;
mod similarity;
mod viewpoint;

pub use aabb::Aabb;
pub use camera::{Camera, PoseError};
pub use lattice::Lattice;
pub use path::{CameraPath, Keyframe, PathError};
pub use pose::{NotRigid, rigid};
pub use ray::Ray;
pub use similarity::Similarity;
pub use viewpoint::Viewpoint;
