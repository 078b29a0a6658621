//! The `.strivec` file format: a scene, its bytes, and the numbers that it means.
//!
//! [`model`]: the scene, its invariants, and [`model::ReferenceField`], the f64 field that defines every number.
//! [`container`]: bytes from and to a scene, for untrusted input. [`geometry`]: boxes, rays, cameras and their lenses.
//! The other modules are small: numbers and untrusted texts as text, colors as bytes, random numbers by a counter.
//!
//! Read a file and evaluate the field at a point:
//!
//! ```
//! use glam::DVec3;
//! use strivec_format::container;
//! use strivec_format::model::ReferenceField;
//!
//! let bytes = include_bytes!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../fixtures/v1/everything.strivec"));
//! let scene = container::decode(bytes)?;
//! let field = ReferenceField::new(&scene);
//! let point = field.locate(DVec3::new(0.1, 0.2, 0.3));
//! let density = field.density(field.density_feature(&point).feature);
//! assert!(density >= 0.0);
//! # Ok::<(), container::Error>(())
//! ```
#![forbid(unsafe_code)]

mod binary16;
pub mod color;
pub mod color_map;
pub mod container;
pub mod digits;
pub mod escape;
pub mod geometry;
mod invalid;
pub mod model;
mod named;
pub mod psnr;
pub mod random;

pub use invalid::{Invalid, OptionName, Place, named_by};
