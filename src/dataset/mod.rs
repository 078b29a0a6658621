//! Posed photographs. One file a layout; each returns a [`Dataset`].
//!
//! In: a folder of pictures with their camera poses, from anywhere, so nothing in it is trusted. Out: cameras and
//! colours in the dataset's own space. Mapping that space to the model's is left to the caller.
#![forbid(unsafe_code)]

mod blender;
mod error;
mod picture;
mod pose;
mod synthetic;

pub use blender::{load_blender, load_blender_cameras};
pub use error::{Error, ErrorKind};
pub use synthetic::{SynthOptions, Synthesised, synthesise};

use crate::geometry::Camera;

/// The photographs of one split of a dataset, with their cameras in the dataset's own space.
#[derive(Clone, Debug, PartialEq)]
pub struct Dataset {
    /// What to call it: the folder's name.
    pub name: String,
    /// At least one.
    pub views: Vec<View>,
}

/// One photograph.
#[derive(Clone, Debug, PartialEq)]
pub struct View {
    /// The file name without folder and extension, as in `r_0`.
    pub name: String,
    /// Where it was taken from; its size is the picture's.
    pub camera: Camera,
    /// \[height\]\[width\] sRGB colours in [0, 1], row-major from the top left, composited on the background.
    pub pixels: Vec<[f32; 3]>,
}

/// A camera without its photograph.
#[derive(Clone, Debug, PartialEq)]
pub struct NamedCamera {
    /// The file name without folder and extension, as in `r_0`.
    pub name: String,
    /// Its size is that of the picture it takes.
    pub camera: Camera,
}

/// How photographs become colours.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LoadOptions {
    /// Pictures are made this many times smaller in both directions by averaging blocks of premultiplied colours;
    /// columns and rows that do not fill a block are dropped. At least 1.
    pub downscale: u32,
    /// The sRGB colour behind transparent pictures, in [0, 1].
    pub background: [f32; 3],
}

impl Default for LoadOptions {
    /// Full size on white.
    fn default() -> Self {
        Self { downscale: 1, background: [1.0; 3] }
    }
}
