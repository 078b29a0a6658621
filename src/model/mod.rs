//! The frozen scene: plain data, its invariants ([`Scene::check`]), and the f64 [`ReferenceField`] that defines every
//! number an implementation must reproduce.

mod decoder;
mod factors;
mod frame;
mod occupancy;
mod provenance;
mod reference;
mod rules;
mod scale;
mod scene;
mod tensor_cloud;

pub use decoder::{AppearanceMatrix, Decoder, DecoderMode, Linear};
pub use factors::{FactorKind, Factors};
pub use frame::{ColorSpace, Frame, UpAxis};
pub use occupancy::Occupancy;
pub use provenance::Provenance;
pub use reference::{DensityAt, MARGIN_HORIZON, Neighbor, Point, ReferenceField, alpha, sigmoid, softplus};
pub use rules::{Aggregation, Coverage, Reduction, Rules};
pub use scale::{MAX_TOP_K, Scale};
pub use scene::{BrokenInvariant, Scene};
pub use tensor_cloud::{Placement, TensorCloud};
