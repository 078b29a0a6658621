//! Measures of a pair of pictures that an evaluation makes on request.

use super::{Error, Lpips, LpipsNetwork, SsimConvention};

/// A measure beside PSNR and the default SSIM.
#[derive(Debug)]
pub enum PictureMeasure {
    /// SSIM by a convention.
    Ssim(SsimConvention),
    /// LPIPS with a network.
    Lpips(Lpips),
}

impl PictureMeasure {
    /// Name of the measure in results: `ssim_3dgs`, `lpips_vgg`.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Ssim(SsimConvention::Nerf) => "ssim_nerf",
            Self::Ssim(SsimConvention::GaussianSplatting) => "ssim_3dgs",
            Self::Ssim(SsimConvention::ScikitImage) => "ssim_skimage",
            Self::Lpips(lpips) => match lpips.network() {
                LpipsNetwork::Alex => "lpips_alex",
                LpipsNetwork::Vgg => "lpips_vgg",
            },
        }
    }

    /// The measure of two pictures of `size` (columns, rows).
    ///
    /// # Errors
    ///
    /// [`Error::Size`], and errors of pictures that are too small to measure.
    pub fn of(&self, size: [u32; 2], rendered: &[[f32; 3]], truth: &[[f32; 3]]) -> Result<f64, Error> {
        match self {
            Self::Ssim(convention) => convention.mean(size, rendered, truth),
            Self::Lpips(lpips) => lpips.distance(size, rendered, truth),
        }
    }
}
