//! Posed photographs. Each layout has a file and returns a [`Dataset`].
//!
//! In: an untrusted folder of pictures with their camera poses. Out: cameras and colors in the dataset's own space. The
//! caller maps that space to the model's.
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
    /// The dataset's name, which is the folder's.
    pub name: String,
    /// The views, at least one.
    pub views: Vec<View>,
    /// Number of frames of the split without a pose, which are not among the views.
    pub lost: usize,
}

/// One photograph.
#[derive(Clone, Debug, PartialEq)]
pub struct View {
    /// The file name without folder and extension, as in `r_0`.
    pub name: String,
    /// The camera, of the picture's size.
    pub camera: Camera,
    /// The colors of the picture.
    pub pixels: Pixels,
}

/// A camera without its photograph.
#[derive(Clone, Debug, PartialEq)]
pub struct NamedCamera {
    /// The file name without folder and extension, as in `r_0`.
    pub name: String,
    /// The camera, of its picture's size.
    pub camera: Camera,
}

/// The selection of photographs to load, and their size.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LoadOptions {
    /// Pictures are made this many times smaller in both directions by averaging blocks of premultiplied colors;
    /// columns and rows that do not fill a block are dropped. At least 1.
    pub downscale: u32,
    /// The range of views in the split; `None`: all.
    pub views: Option<Range<usize>>,
    /// The stride in this range: every n-th view is loaded, starting with the first. At least 1.
    pub every: usize,
}

impl Default for LoadOptions {
    /// All views at full size.
    fn default() -> Self {
        Self { downscale: 1, views: None, every: 1 }
    }
}
