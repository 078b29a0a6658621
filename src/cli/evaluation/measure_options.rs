//! Options of the measures beside PSNR and the default SSIM.

use crate::cli::named_value::one_of;
use crate::measure::SsimConvention;

/// Measures made on request.
#[derive(Clone, Debug, Default, clap::Args)]
#[command(next_help_heading = "Measures")]
pub(in crate::cli) struct MeasureOptions {
    /// Also measure SSIM as these programs do, comma-separated: nerf (the default SSIM), 3dgs (3D Gaussian splatting), skimage
    /// (scikit-image's defaults)
    #[arg(long, value_name = "NAMES", value_delimiter = ',', hide_possible_values = true,
        value_parser = one_of(SsimConvention::ALL, SsimConvention::name))]
    pub(in crate::cli) ssim: Vec<SsimConvention>,
}
