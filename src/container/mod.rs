//! The `.strivec` file: [`encode`] turns a [`Scene`](crate::model::Scene) into bytes, [`decode`] turns bytes into a
//! scene, [`sections`] lists what a file holds. `format-spec/v1.md` is normative; the files here are named after it.
//!
//! Bytes may come from anyone: whatever they are, reading them ends in a scene that passes
//! [`Scene::check`](crate::model::Scene::check) or in an [`Error`] that names what is wrong, never in a panic, and in
//! memory that is bounded by the file's size. Opening files, and deciding what to do about an error, is left to
//! others.

#![forbid(unsafe_code)]

mod array;
mod codec;
mod cosine;
mod decoder;
mod encode;
mod error;
mod factors;
mod frame;
mod header;
pub mod limits;
mod matrix;
mod metadata;
mod occupancy;
mod parallel;
mod payload;
mod placement;
mod prefix;
mod provenance;
mod reader;
mod records;
mod rules;
mod section;
mod source;
mod table;
mod writer;

pub use array::{ArrayOptions, Encoding, Filter, GRID_BITS, step, step_code};
pub use codec::Codec;
pub use encode::{EncodeOptions, FactorOptions, encode, encode_scene_file, with_notes};
pub use error::Error;
pub use header::{MAGIC, VERSION, Version};
pub use limits::Limits;
pub use metadata::{
    Metadata, Pose, Probe, Probes, Quality, Thumbnail, ThumbnailFormat, TrainingCamera, UnknownSection, Views,
};
pub use prefix::{Prefix, beginning};
pub use reader::{Part, Reader, SceneFile, decode, decode_scene_file};
pub use section::{Section, SectionKind};
pub use source::{Fetch, Seekable, Source};
pub use table::{Contents, sections};
