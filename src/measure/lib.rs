//! Quality of pictures: PSNR, SSIM, reports, and PNG files of pictures and their errors.
//!
//! In: colors as \[height\]\[width\], row-major from the top left, sRGB in \[0, 1\], each picture with its size as
//! \[columns, rows\]. Out: numbers, and the bytes of PNG files. No file is opened and nothing is printed here.
#![forbid(unsafe_code)]

mod error;
mod error_map;
mod paired;
mod parity;
mod png;
mod probes;
mod regions;
mod report;
mod sheet;
mod squared_error;
mod ssim;

pub use error::Error;
pub use error_map::{ERROR_FULL, error_map, ramp};
pub use paired::PairedDifference;
pub use parity::{F32_POSITION_ERROR, Parity, parity};
pub use png::{DepthCode, color_jpeg, color_png, depth_png, opacity_png};
pub use probes::{
    CheckedProbes, OverBudget, PROBE_MARGIN, ProbeLimits, ProbeReport, check_probes, check_probes_within, make_probes,
    probe_density_error,
};
pub use regions::{Region, RegionErrors, RegionReport};
pub use report::{Report, ViewReport, counted};
pub use sheet::{Sheet, side_by_side, stacked};
pub use squared_error::{mse, psnr};
pub use ssim::{SSIM_WINDOW, SsimConvention, ssim};
