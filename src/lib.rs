//! Strivec: sparse tri-vector radiance fields (ICCV 2023) as a compact, versioned file and the toolkit around it.
//!
//! This crate gathers the crates of the toolkit; each module below is one of them, or a module of one. With
//! `default-features = false` there is the file format alone: [`model`], [`container`], [`geometry`]. The feature `render` adds
//! `field` and `render`, `gpu` rendering on GPUs, `toolkit` datasets, priors, training, measures and exports, `cli` (the default)
//! the commands, `player` the desktop player.
//!
//! Read a file and evaluate the field at a point:
//!
//! ```
//! use glam::DVec3;
//! use strivec::container;
//! use strivec::model::ReferenceField;
//!
//! let bytes = std::fs::read("fixtures/v1/everything.strivec")?;
//! let scene = container::decode(&bytes)?;
//! let field = ReferenceField::new(&scene);
//! let point = field.locate(DVec3::new(0.1, 0.2, 0.3));
//! let density = field.density(field.density_feature(&point).feature);
//! assert!(density >= 0.0);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! `examples/` renders a picture, trains on a folder and imports a mesh.
#![forbid(unsafe_code)]

pub use strivec_format::{Invalid, OptionName, Place, named_by};
pub use strivec_format::{color, color_map, container, digits, escape, geometry, model, psnr, random};

#[cfg(feature = "toolkit")]
pub use {
    strivec_capture::{dataset, prior},
    strivec_checkpoints as checkpoints, strivec_export as export, strivec_import as import,
    strivec_import::npy,
    strivec_measure as measure, strivec_recipe as recipe, strivec_synth as synth, strivec_train as train,
    strivec_train::pack,
};
#[cfg(feature = "render")]
pub use {strivec_field as field, strivec_field::render};

#[cfg(feature = "player")]
pub use strivec_desktop as desktop;
#[cfg(feature = "gpu")]
pub use strivec_player as player;
#[cfg(feature = "cli")]
pub use {strivec_cli as cli, strivec_cli::version};
