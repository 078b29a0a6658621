//! The result of an evaluation: one line per view, and the means that papers print.

use serde::Serialize;

use super::{Error, ssim};
use crate::color_map::ColorFit;
use crate::psnr::psnr_of_mse;

/// The weight of the identity in a color fit, in pixels: for pictures of few colors.
const RIDGE: f64 = 1e-3;

/// The quality of one rendered view against its photograph. In JSON an infinite PSNR (identical pictures) is `null`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ViewReport {
    /// The view's name.
    pub name: String,
    /// Mean squared error over pixels and channels.
    pub mse: f64,
    /// PSNR in dB.
    pub psnr: f64,
    /// PSNR in dB after the affine map of the rendered colors that makes it the largest: without differences of exposure and
    /// white balance.
    pub psnr_after_color_fit: f64,
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
        let Some(mask) = mask else {
            let mse = super::mse(rendered, truth)?;
            return Self::compared(name, size, [rendered, truth], mse, mse_after_color_fit(rendered, truth));
        };
        for found in [truth.len(), mask.len()] {
            Error::unless_size(size, found)?;
        }
        let kept = [rendered, truth].map(|colors| counted(colors, mask));
        let mse = super::mse(&kept[0], &kept[1])?;
        let same = |((&rendered, &truth), &counts)| if counts { rendered } else { truth };
        let covered: Vec<_> = rendered.iter().zip(truth).zip(mask).map(same).collect();
        Self::compared(name, size, [&covered, truth], mse, mse_after_color_fit(&kept[0], &kept[1]))
    }

    fn compared(
        name: &str,
        size: [u32; 2],
        [rendered, truth]: [&[[f32; 3]]; 2],
        mse: f64,
        mse_after_color_fit: f64,
    ) -> Result<Self, Error> {
        let ssim = match ssim(size, rendered, truth) {
            Err(Error::SmallerThanWindow { .. }) => None,
            other => Some(other?),
        };
        let psnr_after_color_fit = psnr_of_mse(mse_after_color_fit);
        Ok(Self { name: name.to_owned(), mse, psnr: psnr_of_mse(mse), psnr_after_color_fit, ssim })
    }
}

/// The mean squared error over pixels and channels after the affine map of `rendered`'s colors that makes it the least.
fn mse_after_color_fit(rendered: &[[f32; 3]], truth: &[[f32; 3]]) -> f64 {
    let mut fit = ColorFit::default();
    rendered.iter().zip(truth).for_each(|(&from, &to)| fit.add(from, to, 1.0));
    fit.squared_error(&fit.map(RIDGE)) / (3 * rendered.len()) as f64
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
    /// The mean of the views' PSNR after their color fits.
    pub psnr_after_color_fit: f64,
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
        let psnr_after_color_fit = views.iter().map(|v| v.psnr_after_color_fit).sum::<f64>() / count;
        let ssim = views.iter().map(|v| v.ssim).sum::<Option<f64>>().map(|sum| sum / count);
        Some(Self { psnr, psnr_after_color_fit, ssim, views })
    }
}
