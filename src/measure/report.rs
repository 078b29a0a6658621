//! The result of an evaluation: one line per view, and the means that papers print.

use std::borrow::Cow;
use std::collections::BTreeMap;

use serde::Serialize;

use super::{Error, SsimConvention, ssim};
use strivec_format::color_map::ColorFit;
use strivec_format::psnr::psnr_of_mse;

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
    /// Measures made on request, by their names.
    #[serde(flatten)]
    pub others: BTreeMap<&'static str, f64>,
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
        let covered = covered(rendered, truth, Some(mask));
        Self::compared(name, size, [&covered, truth], mse, mse_after_color_fit(&kept[0], &kept[1]))
    }

    /// Adds SSIM of the same pictures by `conventions`. Each takes the pixels that do not count as identical.
    ///
    /// # Errors
    ///
    /// The errors of [`SsimConvention::mean`].
    pub fn add(
        &mut self,
        conventions: &[SsimConvention],
        size: [u32; 2],
        rendered: &[[f32; 3]],
        truth: &[[f32; 3]],
        mask: Option<&[bool]>,
    ) -> Result<(), Error> {
        let rendered = covered(rendered, truth, mask);
        for convention in conventions {
            self.others.insert(convention.result_name(), convention.mean(size, &rendered, truth)?);
        }
        Ok(())
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
        let (name, psnr, others) = (name.to_owned(), psnr_of_mse(mse), BTreeMap::new());
        Ok(Self { name, mse, psnr, psnr_after_color_fit, ssim, others })
    }
}

/// `rendered`, with the colors of `truth` where `mask` is false.
fn covered<'a>(rendered: &'a [[f32; 3]], truth: &[[f32; 3]], mask: Option<&[bool]>) -> Cow<'a, [[f32; 3]]> {
    let Some(mask) = mask else { return rendered.into() };
    let same = |((&rendered, &truth), &counts)| if counts { rendered } else { truth };
    rendered.iter().zip(truth).zip(mask).map(same).collect()
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
    /// The means of the measures made on request, by their names.
    #[serde(flatten)]
    pub others: BTreeMap<&'static str, f64>,
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
        let mean_of = |name| (name, views.iter().filter_map(|v| v.others.get(name)).sum::<f64>() / count);
        let others = views[0].others.keys().copied().map(mean_of).collect();
        Some(Self { psnr, psnr_after_color_fit, ssim, others, views })
    }
}
