//! Options of what a packaged file holds beside its scene.

use super::encoding::LayoutArgs;
use crate::Error;
use crate::numbers::in_range;
use strivec_recipe::PackOptions;

/// Contents of a file beside its scene, and the effort of measuring.
#[derive(Clone, Debug, clap::Args)]
pub(super) struct Extras {
    #[command(flatten)]
    layout: LayoutArgs,
    /// Number of probe rays stored for `verify --render`; 0 stores none [default: 64; 16 in files below 1 MB]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(0..=65_536))]
    probes: Option<u32>,
    /// Fit no corrections for scenes of which only the coarser scales are loaded
    #[arg(long)]
    no_prefixes: bool,
    /// Write no thumbnail, first camera or turntable
    #[arg(long)]
    no_views: bool,
    /// License text of the scene
    #[arg(long, value_name = "TEXT")]
    license: Option<String>,
    /// Multiple of the usual number of rays for measuring and fitting, 0.001 to 100: 0.1 is quick, 4 is thorough
    #[arg(long, value_name = "F", default_value_t = 1.0,
        value_parser = in_range(PackOptions::MIN_EFFORT..=100.0, "a number from 0.001 to 100"))]
    effort: f64,
    /// Random seed
    #[arg(long, default_value_t = 0)]
    pub(super) seed: u64,
}

impl Extras {
    /// The library's options.
    ///
    /// # Errors
    ///
    /// If the compression level is out of range.
    pub(super) fn options(&self) -> Result<PackOptions, Error> {
        self.layout.check()?;
        Ok(PackOptions {
            layout: self.layout.layout(),
            probes: self.probes,
            prefixes: !self.no_prefixes,
            views: !self.no_views,
            license: self.license.clone(),
            effort: self.effort,
            seed: self.seed,
        })
    }
}
