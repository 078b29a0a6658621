//! The `.strivec` file: [`encode()`] turns a [`Scene`](crate::model::Scene) into bytes, [`decode`] turns bytes into a
//! scene, [`sections`] lists the sections of a file. `format-spec/v1.md` is normative; the files here are named after
//! its sections.
//!
//! Bytes are untrusted. Reading any bytes ends in a scene that passes [`Scene::check`](crate::model::Scene::check) or
//! in an [`Error`] that names the fault, never in a panic, and in memory that is bounded by the file's size and by
//! [`Limits`]. Opening files and recovering from errors is left to the caller.

mod array;
mod cameras;
mod chunks;
mod codec;
mod decoder;
mod edit;
mod encode;
mod encoding;
mod error;
mod factors;
mod fetch;
mod frame;
mod header;
mod license;
pub mod limits;
mod matrix;
mod metadata;
mod notes;
mod occupancy;
mod order;
mod parallel;
mod part;
mod payload;
mod placement;
mod pose;
mod prefix;
mod probes;
mod provenance;
mod quality;
mod read_all;
mod reader;
mod record;
mod rules;
mod scale;
mod section;
mod source;
mod table;
mod thumbnail;
mod version;
mod views;
mod writer;

pub use cameras::TrainingCamera;
pub use codec::Codec;
pub use edit::{with_frame, with_notes};
pub use encode::{EncodeOptions, FactorOptions, NetworkSteps, Original, encode, encode_scene_file, rewrite_scene_file};
pub use encoding::{ArrayOptions, Encoding, Filter, GRID_BITS, step, step_code};
pub use error::Error;
pub use header::MAGIC;
pub use limits::{FEATURES, FREQUENCIES, LAYER_WIDTH, LAYERS, Limits, RANK, RESOLUTION};
pub use metadata::{Metadata, SkippedSection, UnknownSection};
pub use part::Part;
pub use pose::Pose;
pub use prefix::{Prefix, first_scales};
pub use probes::{Probe, Probes};
pub use quality::Quality;
pub use read_all::read_all;
pub use reader::{Reader, SceneFile, decode, decode_scene_file};
pub use section::{Section, SectionKind};
pub use source::{Fetch, Seekable, Source};
pub use table::{Contents, sections};
pub use thumbnail::{Thumbnail, ThumbnailFormat};
pub use version::{VERSION, Version};
pub use views::Views;
