//! Errors of measurements.

/// Pictures that cannot be measured or written.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// Pictures of different sizes, or a list of colors whose length differs from the size.
    #[error("the pictures differ in size: {expected} pixels and {found}")]
    Size {
        /// Number of pixels of the first picture, or of its size.
        expected: usize,
        /// Number of pixels of the other.
        found: usize,
    },
    /// A picture without pixels.
    #[error("the picture has no pixels")]
    Empty,
    /// A picture smaller than the SSIM window.
    #[error("SSIM needs pictures of at least {window}x{window} pixels, not {}x{}", found[0], found[1])]
    SmallerThanWindow {
        /// The window's edge.
        window: usize,
        /// Columns and rows.
        found: [u32; 2],
    },
    /// A picture that cannot be encoded.
    #[error("cannot encode the PNG file: {0}")]
    Png(#[from] image::ImageError),
}

impl Error {
    /// Fails unless `found` is the number of pixels of `size` (columns, rows).
    pub(super) fn unless_size(size: [u32; 2], found: usize) -> Result<(), Self> {
        let expected = size[0] as usize * size[1] as usize;
        if expected == found { Ok(()) } else { Err(Self::Size { expected, found }) }
    }
}
