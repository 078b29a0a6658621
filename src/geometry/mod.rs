//! Boxes, rays, cameras, lattices and the map between a dataset's space and the model's. Everything is f64.

mod aabb;
mod camera;
mod lattice;
mod ray;
mod similarity;

pub use aabb::Aabb;
pub use camera::{Camera, PoseError};
pub use lattice::Lattice;
pub use ray::Ray;
pub use similarity::Similarity;
