//! Posed photographs. One file a layout; each returns a [`Dataset`].

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
