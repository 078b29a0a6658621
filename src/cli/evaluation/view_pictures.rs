//! The pictures of a report's views, encoded as data URIs.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use clap::ValueEnum;

use super::evaluator::Shown;
use crate::Error;
use strivec_measure::{ERROR_FULL, color_jpeg, color_png, error_map};

const JPEG_QUALITY: u8 = 90;
/// The most bytes of a report's pictures, which browsers still open.
const MAX_BYTES: usize = 256 << 20;

/// The encoding of a report's pictures.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub(crate) enum PictureFormat {
    /// JPEG of quality 90
    #[default]
    Jpeg,
    /// PNG
    Png,
}

/// The pictures of a view, all of one size.
pub(crate) struct ShownView {
    pub(crate) index: usize,
    pub(crate) name: String,
    /// The PSNR of each file, as in `A 36.21 dB`.
    pub(crate) psnr: Vec<String>,
    /// Columns and rows.
    pub(crate) size: [u32; 2],
    /// (label, data URI): the photograph, then a picture and its error for each file.
    pub(crate) pictures: Vec<(String, String)>,
}

/// Collects the pictures of some views, of one file after another.
pub(crate) struct ViewPictures {
    /// Number of all views, and of those that are shown.
    views: usize,
    shown: usize,
    format: PictureFormat,
    bytes: usize,
    collected: Vec<ShownView>,
}

impl ViewPictures {
    /// For `shown` views, spread over `views`.
    pub(super) fn new(views: usize, shown: usize, format: PictureFormat) -> Self {
        Self { views, shown: shown.min(views), format, bytes: 0, collected: Vec::new() }
    }

    /// Encodes the pictures of a view, if it is one of those that are shown. `name` is the file's among several.
    ///
    /// # Errors
    ///
    /// If the pictures take too much memory, or cannot be encoded.
    pub(crate) fn add(&mut self, view: &Shown<'_>, name: &str) -> Result<(), Error> {
        if (view.index + 1) * self.shown / self.views == view.index * self.shown / self.views {
            return Ok(());
        }
        let label = |picture: &str| if name.is_empty() { picture.to_owned() } else { format!("{picture} {name}") };
        let mut pictures = Vec::new();
        let known = self.collected.iter().position(|shown| shown.index == view.index);
        if known.is_none() {
            pictures.push(("photograph".to_owned(), self.encoded(view.size, view.photograph)?));
        }
        let difference = error_map(view.rendered, view.photograph, ERROR_FULL)?;
        pictures.push((label("rendering"), self.encoded(view.size, view.rendered)?));
        pictures.push((label("error"), self.encoded(view.size, &difference)?));
        let psnr = format!("{name} {:.2} dB", view.report.psnr).trim_start().to_owned();
        match known {
            Some(at) => {
                self.collected[at].pictures.extend(pictures);
                self.collected[at].psnr.push(psnr);
            }
            None => {
                let (index, name, size) = (view.index, view.report.name.clone(), view.size);
                self.collected.push(ShownView { index, name, psnr: vec![psnr], size, pictures });
            }
        }
        Ok(())
    }

    /// The views in their order.
    pub(crate) fn into_views(self) -> Vec<ShownView> {
        self.collected
    }

    fn encoded(&mut self, size: [u32; 2], colors: &[[f32; 3]]) -> Result<String, Error> {
        let (kind, bytes) = match self.format {
            PictureFormat::Jpeg => ("jpeg", color_jpeg(size, colors, JPEG_QUALITY)?),
            PictureFormat::Png => ("png", color_png(size, colors)?),
        };
        let uri = format!("data:image/{kind};base64,{}", STANDARD.encode(bytes));
        self.bytes += uri.len();
        if self.bytes > MAX_BYTES {
            let limit = MAX_BYTES >> 20;
            return Err(Error::Usage(format!(
                "the report's pictures take more than {limit} MiB; show fewer by --report-views, smaller ones \
                 by --downscale, or --report-pictures jpeg"
            )));
        }
        Ok(uri)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use strivec_measure::ViewReport;

    #[test]
    fn shown_views_are_spread_over_all_and_later_files_add_to_them() {
        let flat = vec![[0.5; 3]; 16];
        let collect = |views: usize, shown: usize| {
            let mut pictures = ViewPictures::new(views, shown, PictureFormat::Png);
            for name in ["A", "B"] {
                for index in 0..views {
                    let report = ViewReport::new(&format!("r_{index}"), [4, 4], &flat, &flat, None).unwrap();
                    let view = Shown { index, report: &report, size: [4, 4], photograph: &flat, rendered: &flat };
                    pictures.add(&view, name).unwrap();
                }
            }
            pictures.into_views()
        };
        let indices = |views, shown| collect(views, shown).iter().map(|view| view.index).collect::<Vec<_>>();
        assert_eq!(indices(10, 3), [3, 6, 9]);
        assert_eq!((indices(2, 12), indices(5, 0)), (vec![0, 1], vec![]));
        let labels: Vec<_> = collect(1, 1)[0].pictures.iter().map(|(label, _)| label.clone()).collect();
        assert_eq!(labels, ["photograph", "rendering A", "error A", "rendering B", "error B"]);
        assert_eq!(collect(1, 1)[0].psnr, ["A inf dB", "B inf dB"]);
        assert!(collect(1, 1)[0].pictures[0].1.starts_with("data:image/png;base64,iVBOR"));
    }
}
