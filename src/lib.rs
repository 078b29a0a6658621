//! Strivec: sparse tri-vector radiance fields (ICCV 2023) as a compact, versioned file and the toolkit around it.
//!
//! Layers, each importing only from those above it in this list (`tests/import_order` checks it):
//!
//! 0. [`geometry`]: boxes, rays, cameras, lattices, the map between a dataset's space and the model's.
//!    [`color`]: colors as bytes. [`digits`]: numbers as text. [`escape`]: untrusted texts. [`psnr`]: decibels of an
//!    error. [`random`]: counter-based random numbers. [`version`](mod@version): the text of `--version`. `npy`: NumPy
//!    arrays from untrusted files.
//! 1. [`model`]: the frozen scene, its invariants, and the f64 reference field that defines every number.
//! 2. [`container`]: `.strivec` bytes from and to a scene. `dataset`: posed photographs. `import`: readers of other
//!    programs' geometry files. `prior`: occupied space, and tensors placed in it. `field`: the fast field that
//!    rendering and training share.
//! 3. `render`: pictures of a scene. `train`: a scene from photographs.
//! 4. `measure`: PSNR, SSIM, speed. `pack`: making files small. `interop`: other programs' files from a scene.
//! 5. `recipe`: the whole way from photographs to a scene file.
//! 6. `cli`: the commands. `player`: interactive views. `web`: bindings for a page in a browser.
//!
//! With `default-features = false` only layers 0, 1 and `container` are built. The feature `render` adds `field` and
//! the CPU renderers, `gpu` those for GPUs, `toolkit` datasets, priors, training and packing.
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

pub mod color;
pub mod color_map;
pub mod container;
pub mod digits;
pub mod escape;
pub mod geometry;
pub mod model;
pub mod psnr;
pub mod random;
pub mod version;

#[cfg(feature = "toolkit")]
pub mod dataset;
#[cfg(feature = "render")]
pub mod field;
#[cfg(feature = "toolkit")]
pub mod import;
#[cfg(feature = "toolkit")]
pub mod interop;
#[cfg(feature = "toolkit")]
pub mod measure;
#[cfg(feature = "toolkit")]
pub mod npy;
#[cfg(feature = "toolkit")]
pub mod pack;
#[cfg(feature = "toolkit")]
pub mod prior;
#[cfg(feature = "toolkit")]
pub mod recipe;
#[cfg(feature = "render")]
pub mod render;
#[cfg(feature = "toolkit")]
pub mod train;

#[cfg(feature = "gpu")]
pub mod player;

#[cfg(feature = "cli")]
pub mod cli;
#[cfg(all(feature = "web", target_arch = "wasm32"))]
pub mod web;
