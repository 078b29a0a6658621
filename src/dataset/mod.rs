//! Posed photographs. One file a layout; each returns a [`Dataset`].
//!
//! In: a folder of pictures with their camera poses, from anywhere, so nothing in it is trusted. Out: cameras and
//! colors in the dataset's own space. Mapping that space to the model's is left to the caller.
#![forbid(unsafe_code)]

mod blender;
mod error;
mod layout;
mod photographs;
mod picture;
mod pixels;
mod scan;
mod scannet;
mod synthetic;

pub use blender::{load_blender, load_blender_cameras};
pub use error::{Error, ErrorKind};
pub use layout::{load, load_cameras};
pub use pixels::Pixels;
pub use scan::Scan;
pub use scannet::{load_scannet, load_scannet_cameras};
pub use synthetic::{SynthOptions, Synthesized, SynthesizedScan, synthesize, synthesize_scan};

use std::ops::Range;

use crate::geometry::Camera;

/// The photographs of one split of a dataset, with their cameras in the dataset's own space.
#[derive(Clone, Debug, PartialEq)]
pub struct Dataset {
    /// What to call it: the folder's name.
    pub name: String,
    /// At least one.
    pub views: Vec<View>,
    /// Frames of the split that are no views because nobody knows where they were taken from.
    pub lost: usize,
}

/// One photograph.
#[derive(Clone, Debug, PartialEq)]
pub struct View {
    /// The file name without folder and extension, as in `r_0`.
    pub name: String,
    /// Where it was taken from; its size is the picture's.
    pub camera: Camera,
    /// What it shows.
    pub pixels: Pixels,
}

/// A camera without its photograph.
#[derive(Clone, Debug, PartialEq)]
pub struct NamedCamera {
    /// The file name without folder and extension, as in `r_0`.
    pub name: String,
    /// Its size is that of the picture it takes.
    pub camera: Camera,
}

/// Which photographs are loaded, and how large.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LoadOptions {
    /// Pictures are made this many times smaller in both directions by averaging blocks of premultiplied colors;
    /// columns and rows that do not fill a block are dropped. At least 1.
    pub downscale: u32,
    /// Only the views of these numbers in the split; all where absent.
    pub views: Option<Range<usize>>,
    /// Of these only every so many, the first included. At least 1.
    pub every: usize,
}

impl Default for LoadOptions {
    /// All at full size.
    fn default() -> Self {
        Self { downscale: 1, views: None, every: 1 }
    }
}
