//! The trained scene: plain data, its invariants ([`Scene::check`]), and the f64 [`ReferenceField`] that defines every
//! number an implementation must reproduce. The files are named after the sections of the file format.

mod decoder;
mod factors;
mod field;
mod frame;
mod matrix;
mod memory;
mod occupancy;
mod provenance;
mod rules;
mod scale;
mod scene;
mod sky;
mod tensor_cloud;

pub use decoder::{Decoder, DecoderMode, Linear};
pub use factors::{Block, FactorKind, Factors, Form};
pub use field::{DensityAt, LocatedPoint, MARGIN_HORIZON, Neighbor, ReferenceField, alpha, sigmoid, softplus};
pub use frame::{ColorSpace, Frame, UpAxis};
pub use matrix::AppearanceMatrix;
pub use memory::{MemoryLimit, OverMemory};
pub use occupancy::Occupancy;
pub use provenance::Provenance;
pub use rules::{Aggregation, Coverage, MAX_STEPS, Reduction, Rules};
pub use scale::{MAX_TOP_K, Scale};
pub use scene::Scene;
pub use sky::SKY_NORMS;
pub use sky::Sky;
pub use tensor_cloud::{Placement, TensorCloud};
