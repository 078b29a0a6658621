//! The result of an evaluation: one line per view, and the means that papers print.

use serde::Serialize;

use super::{Error, ssim};
use crate::psnr::psnr_of_mse;

/// The quality of one rendered view against its photograph. In JSON an infinite PSNR (identical pictures) is `null`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ViewReport {
    /// The view's name.
    pub name: String,
    /// Mean squared error over pixels and channels.
    pub mse: f64,
    /// PSNR in dB.
    pub psnr: f64,
    /// Mean SSIM; `None` if the picture is smaller than the window.
    pub ssim: Option<f64>,
}

impl ViewReport {
    /// Compares the picture `rendered` with the photograph `truth`, both of `size` (columns, rows), in the pixels for
    /// which `mask` is true; in all without one. SSIM takes the others as identical.
    ///
    /// # Errors
    ///
    /// [`Error::Size`] if one of the three has another size, [`Error::Empty`] if `mask` is true nowhere.
    pub fn new(
        name: &str,
        size: [u32; 2],
        rendered: &[[f32; 3]],
        truth: &[[f32; 3]],
        mask: Option<&[bool]>,
    ) -> Result<Self, Error> {
        Error::unless_size(size, rendered.len())?;
        let Some(mask) = mask else { return Self::compared(name, size, rendered, truth, super::mse(rendered, truth)?) };
        for found in [truth.len(), mask.len()] {
            Error::unless_size(size, found)?;
        }
        let mse = super::mse(&counted(rendered, mask), &counted(truth, mask))?;
        let same = |((&rendered, &truth), &counts)| if counts { rendered } else { truth };
        let covered: Vec<_> = rendered.iter().zip(truth).zip(mask).map(same).collect();
        Self::compared(name, size, &covered, truth, mse)
    }

    fn compared(
        name: &str,
        size: [u32; 2],
        rendered: &[[f32; 3]],
        truth: &[[f32; 3]],
        mse: f64,
    ) -> Result<Self, Error> {
        let ssim = match ssim(size, rendered, truth) {
            Err(Error::SmallerThanWindow { .. }) => None,
            other => Some(other?),
        };
        Ok(Self { name: name.to_owned(), mse, psnr: psnr_of_mse(mse), ssim })
    }
}

/// The colors for which `mask` is true.
pub fn counted<T: Copy>(colors: &[T], mask: &[bool]) -> Vec<T> {
    colors.iter().zip(mask).filter(|(_, counts)| **counts).map(|(color, _)| *color).collect()
}

/// The quality of several views.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Report {
    /// The mean of the views' PSNR in decibels, as papers print it (not the PSNR of the mean error).
    pub psnr: f64,
    /// The mean of the views' SSIM; `None` if a view has none.
    pub ssim: Option<f64>,
    /// The views in the order of the dataset.
    pub views: Vec<ViewReport>,
}

impl Report {
    /// The means of `views`; `None` for no views.
    pub fn new(views: Vec<ViewReport>) -> Option<Self> {
        if views.is_empty() {
            return None;
        }
        let count = views.len() as f64;
        let psnr = views.iter().map(|v| v.psnr).sum::<f64>() / count;
        let ssim = views.iter().map(|v| v.ssim).sum::<Option<f64>>().map(|sum| sum / count);
        Some(Self { psnr, ssim, views })
    }
}
