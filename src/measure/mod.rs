//! How good a picture is: PSNR, SSIM, reports of them, and the PNG files that show pictures and their errors; and how
//! fast pictures and training are ([`mod@bench`]).
//!
//! In: colors as \[height\]\[width\], row-major from the top left, sRGB in \[0, 1\], each picture with its size as
//! \[columns, rows\]. Out: numbers, and the bytes of PNG files. Files are opened and terminals written to elsewhere.
#![forbid(unsafe_code)]

pub mod bench;
mod cells;
mod error;
mod error_map;
mod parity;
mod png;
mod probes;
mod psnr;
mod regions;
mod report;
mod sheet;
mod ssim;

pub use cells::{Cell, CellMap, FLAT};
pub use error::Error;
pub use error_map::{error_map, ramp};
pub use parity::{F32_POSITION_ERROR, Parity, parity};
pub use png::{color_png, depth_png, opacity_png};
pub use probes::{PROBE_MARGIN, ProbeReport, check_probes, make_probes, probe_density_error};
pub use psnr::{mse, psnr};
pub use regions::{Region, RegionErrors, RegionReport};
pub use report::{Report, ViewReport};
pub use sheet::{Canvas, side_by_side, stacked};
pub use ssim::{SSIM_WINDOW, ssim};
