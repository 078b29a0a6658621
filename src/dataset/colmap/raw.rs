//! Cameras and images as COLMAP's files have them.

/// A camera as its file has it: the model's name, size and parameters.
pub(super) struct RawCamera {
    pub(super) model: String,
    pub(super) size: [u64; 2],
    pub(super) parameters: Vec<f64>,
}

/// An image as its file has it.
pub(super) struct RawImage {
    /// w, x, y, z of the rotation `camera_from_world`.
    pub(super) rotation: [f64; 4],
    pub(super) translation: [f64; 3],
    pub(super) camera: u32,
    pub(super) name: String,
}

/// Names of models by their number in binary files, with the number of parameters of all.
pub(super) const BINARY_MODELS: [(&str, usize); 18] = [
    ("SIMPLE_PINHOLE", 3),
    ("PINHOLE", 4),
    ("SIMPLE_RADIAL", 4),
    ("RADIAL", 5),
    ("OPENCV", 8),
    ("OPENCV_FISHEYE", 8),
    ("FULL_OPENCV", 12),
    ("FOV", 5),
    ("SIMPLE_RADIAL_FISHEYE", 4),
    ("RADIAL_FISHEYE", 5),
    ("THIN_PRISM_FISHEYE", 12),
    ("RAD_TAN_THIN_PRISM_FISHEYE", 16),
    ("SIMPLE_DIVISION", 4),
    ("DIVISION", 5),
    ("SIMPLE_FISHEYE", 3),
    ("FISHEYE", 4),
    ("EUCM", 6),
    ("EQUIRECTANGULAR", 2),
];
