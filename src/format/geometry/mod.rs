//! Boxes, rays, cameras and their paths, lattices, the contraction of unbounded scenes, and the map between dataset space
//! and model space. Everything is f64.

mod aabb;
mod camera;
mod camera_alignment;
mod contraction;
mod focus;
mod lattice;
mod lens;
pub mod morton;
mod path;
mod pose;
mod ray;
mod ray_path;
mod similarity;
mod viewpoint;

pub use aabb::Aabb;
pub use camera::{Camera, PoseError};
pub use camera_alignment::align_cameras;
pub use contraction::{Contraction, MAX_SPACING, Spacing};
pub use focus::focus_of_axes;
pub use lattice::{Lattice, cell_at, index_of};
pub use lens::{Coefficients, Distortion, Lens, Projection};
pub use path::{CameraPath, Keyframe, PathError};
pub use pose::{NotRigid, rigid};
pub use ray::Ray;
pub use ray_path::RayPath;
pub use similarity::Similarity;
pub use viewpoint::Viewpoint;
