//! A scene as other programs' files: meshes, point clouds, splats, grids and arrays, and a checkpoint of DVGO.
//!
//! In: a [`strivec_format::model::Scene`]. Out: a [`Mesh`] of its surface, and writers of bytes. Coordinates are in the space of
//! the dataset's cameras or in model space ([`Space`]), in 32 bits where these are enough ([`CoarseCoordinates`]). The field is
//! queried at points alone, so nothing here depends on how factors are held.
#![forbid(unsafe_code)]

mod coordinates;
mod cube;
mod description;
mod dvgo;
mod error;
mod factors;
mod glb;
mod layers;
mod marching;
mod mesh;
mod obj;
mod occupancy;
mod ply;
mod sampling;
mod shading;
mod space;
mod splats;
mod surface;

pub use coordinates::CoarseCoordinates;
pub use description::{ArrayReader, SceneDescription};
pub use dvgo::{DvgoOptions, dvgo_checkpoint};
pub use error::Error;
pub use factors::{ArrayWriter, block_name, write_arrays, write_factors};
pub use glb::write_glb;
pub use mesh::Mesh;
pub use obj::write_obj;
pub use occupancy::{OccupancyGrid, OccupancyOptions, write_occupancy};
pub use ply::write_ply;
pub use space::Space;
pub use splats::{Splats, write_sog, write_splats, write_spz};
pub use surface::{SurfaceOptions, surface};
