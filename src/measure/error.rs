//! Why a measurement cannot be made.

/// Pictures that cannot be measured or written.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// Pictures of different sizes, or a list of colors of another length than the size says.
    #[error("picture size: expected {expected} pixels, found {found}")]
    Size {
        /// Number of pixels of the first picture, or by its size.
        expected: usize,
        /// Number of pixels of the other.
        found: usize,
    },
    /// A picture without pixels.
    #[error("picture size: expected at least one pixel, found none")]
    Empty,
    /// A picture smaller than the SSIM window.
    #[error(
        "picture size: expected at least {window}x{window} pixels for SSIM, found {}x{}", found[0], found[1]
    )]
    SmallerThanWindow {
        /// The window's edge.
        window: usize,
        /// Columns and rows.
        found: [u32; 2],
    },
    /// A picture that cannot be encoded.
    #[error("PNG: {0}")]
    Png(#[from] image::ImageError),
}

impl Error {
    /// Fails unless `found` colors are as many as `size` (columns, rows) says.
    pub(super) fn unless_size(size: [u32; 2], found: usize) -> Result<(), Self> {
        let expected = size[0] as usize * size[1] as usize;
        if expected == found { Ok(()) } else { Err(Self::Size { expected, found }) }
    }
}
