//! Options of the measures beside PSNR and the default SSIM.

use std::io::ErrorKind;
use std::path::PathBuf;
use std::{env, fs};

use crate::cli::Error;
use crate::cli::named_value::one_of;
use crate::measure::{Lpips, LpipsNetwork, PictureMeasure, SsimConvention};

/// The environment variable that names the file of weights.
const WEIGHTS_VARIABLE: &str = "STRIVEC_LPIPS";
/// How to get the file of weights.
const MAKE_WEIGHTS: &str = "`python3 tools/lpips/convert.py lpips.safetensors` makes it (69 MB)";

/// Measures made on request.
#[derive(Clone, Debug, Default, clap::Args)]
#[command(next_help_heading = "Measures")]
pub(in crate::cli) struct MeasureOptions {
    /// Also measure SSIM as these programs do, comma-separated: nerf (the default SSIM), 3dgs (3D Gaussian splatting), skimage
    /// (scikit-image's defaults)
    #[arg(long, value_name = "NAMES", value_delimiter = ',', hide_possible_values = true,
        value_parser = one_of(SsimConvention::ALL, SsimConvention::name))]
    ssim: Vec<SsimConvention>,
    /// Also measure LPIPS with these networks, comma-separated: alex, vgg
    #[arg(long, value_name = "NETWORKS", value_delimiter = ',', hide_possible_values = true,
        value_parser = one_of(LpipsNetwork::ALL, LpipsNetwork::name))]
    lpips: Vec<LpipsNetwork>,
    /// Weights for --lpips, as tools/lpips/convert.py makes them [default: the environment variable STRIVEC_LPIPS]
    #[arg(long, value_name = "FILE", requires = "lpips")]
    lpips_weights: Option<PathBuf>,
}

impl MeasureOptions {
    /// The measures, with their weights.
    ///
    /// # Errors
    ///
    /// If the weights are needed and not named, cannot be read, or are refused.
    pub(in crate::cli) fn load(&self) -> Result<Vec<PictureMeasure>, Error> {
        let mut measures: Vec<_> = self.ssim.iter().map(|&convention| PictureMeasure::Ssim(convention)).collect();
        if self.lpips.is_empty() {
            return Ok(measures);
        }
        let of_environment = || env::var_os(WEIGHTS_VARIABLE).filter(|name| !name.is_empty()).map(PathBuf::from);
        let path = self.lpips_weights.clone().or_else(of_environment).ok_or_else(|| {
            Error::Usage(format!(
                "--lpips needs the weights of its networks: pass the file by --lpips-weights or {WEIGHTS_VARIABLE}; \
                 {MAKE_WEIGHTS}"
            ))
        })?;
        let bytes = fs::read(&path).map_err(|error| match error.kind() {
            ErrorKind::NotFound => Error::Io(format!("{}: cannot read it: {error}; {MAKE_WEIGHTS}", path.display())),
            _ => Error::io("read", &path)(error),
        })?;
        for &network in &self.lpips {
            let refused = |error| Error::Malformed(format!("{}: {error}; {MAKE_WEIGHTS}", path.display()));
            measures.push(PictureMeasure::Lpips(Lpips::from_safetensors(&bytes, network).map_err(refused)?));
        }
        Ok(measures)
    }
}
