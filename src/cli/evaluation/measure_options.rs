//! Options of the measures beside PSNR and the default SSIM.

use crate::named_value::one_of;
use strivec_measure::SsimConvention;

/// Measures made on request.
#[derive(Clone, Debug, Default, clap::Args)]
#[command(next_help_heading = "Measures")]
pub(crate) struct MeasureOptions {
    /// Also measure SSIM as these programs do, comma-separated: nerf (the default SSIM), 3dgs (3D Gaussian splatting), skimage
    /// (scikit-image's defaults)
    #[arg(long, value_name = "NAMES", value_delimiter = ',', hide_possible_values = true,
        value_parser = one_of(SsimConvention::ALL, SsimConvention::name))]
    pub(crate) ssim: Vec<SsimConvention>,
}
