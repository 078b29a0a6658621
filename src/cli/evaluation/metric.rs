//! The columns of results.

use strivec_measure::{Report, ViewReport};

/// A measured number of a view, and its mean over the views.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Metric {
    /// Name of the metric in JSON and CSV.
    pub(crate) name: &'static str,
}

impl Metric {
    /// The metrics of `report`.
    pub(crate) fn of(report: &Report) -> Vec<Self> {
        let always = ["psnr", "psnr_after_color_fit", "ssim"];
        always.into_iter().chain(report.others.keys().copied()).map(|name| Self { name }).collect()
    }

    /// The heading of its column: `PSNR`, `SSIM 3dgs`.
    pub(crate) fn heading(self) -> String {
        match self.name.split_once('_') {
            Some(("psnr", rest)) => rest.replace('_', " "),
            Some((kind, variant)) => format!("{} {variant}", kind.to_uppercase()),
            None => self.name.to_uppercase(),
        }
    }

    /// `value` of a view, or `-`.
    pub(crate) fn text(self, value: Option<f64>) -> String {
        value.map_or_else(|| "-".to_owned(), |value| format!("{value:.*}", self.decimals()))
    }

    /// `value` of a mean, or `-`: a digit more for decibels.
    pub(crate) fn mean_text(self, value: Option<f64>) -> String {
        value.map_or_else(|| "-".to_owned(), |value| format!("{value:.*}", self.decimals().max(3)))
    }

    /// The number of `view` less that of `base`; `None` if one has none.
    pub(crate) fn difference(self, view: &ViewReport, base: &ViewReport) -> Option<f64> {
        Some(self.of_view(view)? - self.of_view(base)?)
    }

    /// A difference or its standard error: a digit more than the number has.
    pub(crate) fn difference_text(self, value: f64, has_sign: bool) -> String {
        let decimals = self.decimals() + 1;
        if has_sign { format!("{value:+.decimals$}") } else { format!("{value:.decimals$}") }
    }

    fn decimals(self) -> usize {
        if self.name.starts_with("psnr") { 2 } else { 4 }
    }

    /// The number of `view`.
    pub(crate) fn of_view(self, view: &ViewReport) -> Option<f64> {
        match self.name {
            "psnr" => Some(view.psnr),
            "psnr_after_color_fit" => Some(view.psnr_after_color_fit),
            "ssim" => view.ssim,
            name => view.others.get(name).copied(),
        }
    }

    /// The mean of `report`.
    pub(crate) fn mean(self, report: &Report) -> Option<f64> {
        match self.name {
            "psnr" => Some(report.psnr),
            "psnr_after_color_fit" => Some(report.psnr_after_color_fit),
            "ssim" => report.ssim,
            name => report.others.get(name).copied(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn headings_are_the_papers_names() {
        let headings = ["psnr", "psnr_after_color_fit", "ssim", "ssim_3dgs"].map(|name| Metric { name }.heading());
        assert_eq!(headings, ["PSNR", "after color fit", "SSIM", "SSIM 3dgs"]);
    }
}
