//! Posed photographs. Each layout has a file and returns a `Capture`, which `photographs` makes a [`Dataset`] of.
//!
//! In: an untrusted folder of pictures with their camera poses. Out: cameras and colors in the dataset's own space. The
//! caller maps that space to the model's.

mod camera_groups;
mod capture;
mod colmap;
mod decoding_memory;
mod depth;
mod description;
mod error;
#[doc(hidden)]
pub mod files;
mod inventory;
mod inventory_entry;
mod jpeg;
mod json_number;
mod layout;
mod llff;
mod masks;
mod metashape;
mod names;
mod nsvf;
mod other_keys;
mod photographs;
mod picture;
mod picture_format;
mod pixels;
mod records;
mod scan;
mod scannet;
mod shot;
mod transforms;

pub use camera_groups::{CameraGroup, group_cameras};
pub use capture::Holdout;
pub use depth::DepthMap;
pub use description::{Description, describe};
pub use error::{Error, ErrorKind};
pub use inventory::{Inventory, MAX_LINES};
pub use inventory_entry::{InventoryEntry, Standing};
pub use layout::Layout;
pub use photographs::{fitting_downscale, load, load_cameras, load_transforms_cameras, read_distances};
pub use pixels::Pixels;
pub use scan::Scan;
pub use transforms::depth_maps;
#[doc(hidden)]
pub use {
    capture::TEST_EVERY,
    colmap::{model_number, model_pictures},
    picture::picture_size,
    picture_format::PictureFormat,
    shot::{Focal, Intrinsics, OPENGL_FROM_OPENCV, Split, lens_of},
};

use std::ops::Range;
use std::path::PathBuf;

use rayon::prelude::*;

use strivec_format::geometry::{Aabb, Camera};

/// The photographs of one split of a dataset, with their cameras in the dataset's own space.
#[derive(Clone, Debug, PartialEq)]
pub struct Dataset {
    /// The dataset's name, which is the folder's.
    pub name: String,
    /// The views, at least one.
    pub views: Vec<Photograph>,
    /// Number of frames of the split without a pose, which are not among the views.
    pub lost: usize,
    /// The pictures that do not exist and that the options, or the layout, leave out.
    pub left_out: Vec<PathBuf>,
    /// The errors of the few pictures that cannot be decoded and are left out.
    pub unreadable: Vec<String>,
    /// A file of points on the scene's surfaces, in the dataset's space, such as COLMAP's sparse points.
    pub points: Option<PathBuf>,
    /// The scene's box in the dataset's space, if its files have one.
    pub bounds: Option<Aabb>,
    /// The range of distances from the cameras at which the scene is, in the dataset's units, if its files have one.
    pub range: Option<[f64; 2]>,
    /// Depth maps of photographs, of any split.
    pub depth_maps: Vec<DepthMap>,
}

impl Dataset {
    /// The dataset of `views` alone.
    pub fn new(name: impl Into<String>, views: Vec<Photograph>) -> Self {
        Self {
            name: name.into(),
            views,
            lost: 0,
            left_out: Vec::new(),
            unreadable: Vec::new(),
            points: None,
            bounds: None,
            range: None,
            depth_maps: Vec::new(),
        }
    }
}

/// One photograph.
#[derive(Clone, Debug, PartialEq)]
pub struct Photograph {
    /// The file name without folder and extension, as in `r_0`, or with folders if another photograph has this name.
    pub name: String,
    /// The path of its file in the dataset's folder, with `/` between folders: what it is known by.
    pub path: String,
    /// The camera, of the picture's size.
    pub camera: Camera,
    /// The colors of the picture.
    pub pixels: Pixels,
    /// \[height\]\[width\] true for the pixels that count: those that no mask covers and that the camera has a ray
    /// for. `None` if all do.
    pub mask: Option<Vec<bool>>,
    /// \[height\]\[width\] the distance along each pixel's ray to what it shows, in the dataset's units; 0 if unknown. Empty
    /// if none is known.
    pub distances: Vec<f32>,
}

impl Photograph {
    /// A view all of whose pixels count, whose path is its name.
    pub fn new(name: impl Into<String>, camera: Camera, pixels: Pixels) -> Self {
        let name = name.into();
        Self { path: name.clone(), name, camera, pixels, mask: None, distances: Vec::new() }
    }

    /// The numbers of the pixels that count, ascending; `None` if all do.
    pub fn counting(&self) -> Option<Vec<u32>> {
        let mask = self.mask.as_ref()?;
        Some((0..).zip(mask).filter(|(_, counts)| **counts).map(|(pixel, _)| pixel).collect())
    }

    /// True if pixel number `pixel`, row by row from the top left, counts.
    pub fn counts(&self, pixel: usize) -> bool {
        self.mask.as_ref().is_none_or(|mask| mask[pixel])
    }
}

/// The share of transparent pixels from which on photographs show a thing without its background; fewer are flaws of pictures.
const TRANSPARENT: f64 = 0.005;

/// True if `views` have a background: hardly anything shows through them.
pub fn are_opaque(views: &[Photograph]) -> bool {
    let transparent: usize = views.par_iter().map(|view| view.pixels.count_transparent()).sum();
    let all: usize = views.iter().map(|view| view.pixels.len()).sum();
    transparent as f64 <= TRANSPARENT * all as f64
}

/// The color differences, from 0 to 1, within which a background is of one color, and the share of the pixels along the
/// photographs' borders that must have it.
const ONE_COLOR: f32 = 0.06;
const PLAIN: f64 = 0.8;

/// True if the pixels along the borders of nearly all `views` have one color: that of a backdrop.
pub fn has_plain_background(views: &[Photograph]) -> bool {
    let of_view = |view: &Photograph| -> Vec<[f32; 3]> {
        let Camera { width, height, .. } = view.camera;
        let sides = (0..height).flat_map(|row| [row * width, row * width + width - 1]);
        let ends = (0..width).flat_map(|column| [column, (height - 1) * width + column]);
        sides.chain(ends).map(|pixel| view.pixels.color(pixel as usize, [1.0; 3])).collect()
    };
    let colors: Vec<[f32; 3]> = views.par_iter().flat_map_iter(of_view).collect();
    let median = |channel: usize| {
        let mut values: Vec<f32> = colors.iter().map(|color| color[channel]).collect();
        values.sort_by(f32::total_cmp);
        values.get(values.len() / 2).copied().unwrap_or(0.0)
    };
    let middle = [0, 1, 2].map(median);
    let is_near = |color: &&[f32; 3]| color.iter().zip(middle).all(|(c, middle)| (c - middle).abs() < ONE_COLOR);
    colors.iter().filter(is_near).count() as f64 >= PLAIN * colors.len() as f64
}

/// A camera without its photograph.
#[derive(Clone, Debug, PartialEq)]
pub struct NamedCamera {
    /// The file name without folder and extension, as in `r_0`, or with folders if another photograph has this name.
    pub name: String,
    /// The path of its photograph in the dataset's folder, with `/` between folders.
    pub path: String,
    /// The camera, of its picture's size.
    pub camera: Camera,
}

/// The selection of photographs to load, their size, and where their cameras are.
#[derive(Clone, Debug, PartialEq)]
pub struct LoadOptions {
    /// Pictures are made this many times smaller in both directions by averaging blocks of premultiplied colors;
    /// columns and rows that do not fill a block are dropped. At least 1.
    pub downscale: u32,
    /// The range of views in the split; `None`: all.
    pub views: Option<Range<usize>>,
    /// The stride in this range: every n-th view is loaded, starting with the first. At least 1.
    pub every: usize,
    /// The layout; `None`: the one whose files the folder has.
    pub layout: Option<Layout>,
    /// The test views of datasets without splits of their own.
    pub holdout: Holdout,
    /// True to leave out photographs whose picture does not exist.
    pub skip_missing: bool,
    /// The most bytes of the loaded photographs, 4 per pixel of 8-bit pictures at full size and 16 per pixel of all others,
    /// and of what decoding takes besides.
    pub max_memory: u64,
    /// Cameras are turned about the dataset's z axis by so many degrees, counterclockwise seen from above. Points, meshes and
    /// boxes that come with the dataset are left out unless this is 0.
    pub turn_degrees: f64,
}

impl LoadOptions {
    /// The default of [`LoadOptions::max_memory`].
    pub const MAX_MEMORY: u64 = 8_000_000_000;
}

impl Default for LoadOptions {
    /// All views at full size.
    fn default() -> Self {
        Self {
            downscale: 1,
            views: None,
            every: 1,
            layout: None,
            holdout: Holdout::default(),
            skip_missing: false,
            max_memory: Self::MAX_MEMORY,
            turn_degrees: 0.0,
        }
    }
}
