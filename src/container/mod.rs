//! The `.strivec` file: [`encode`] turns a [`Scene`](crate::model::Scene) into bytes, [`decode`] turns bytes into a
//! scene, [`sections`] lists what a file holds. `format-spec/v1.md` is normative; the files here are named after it.
//!
//! Bytes may come from anyone: whatever they are, reading them ends in a scene that passes
//! [`Scene::check`](crate::model::Scene::check) or in an [`Error`] that names what is wrong, never in a panic, and in
//! memory that is bounded by the file's size. Opening files, and deciding what to do about an error, is left to
//! others.

#![forbid(unsafe_code)]

mod appearance;
mod codec;
mod cursor;
mod decode;
mod decoder;
mod encode;
mod error;
mod factors;
mod floats;
mod frame;
mod header;
pub mod limits;
mod occupancy;
mod placement;
mod provenance;
mod records;
mod rules;
mod section;
mod table;
mod writer;

pub use codec::Codec;
pub use decode::decode;
pub use encode::{EncodeOptions, encode};
pub use error::Error;
pub use factors::FactorEncoding;
pub use header::{MAGIC, VERSION, Version};
pub use section::{Section, SectionKind};
pub use table::{Contents, sections};
