//! Errors by region of the photographs.

use serde::Serialize;

use super::Error;
use strivec_format::psnr::psnr_of_mse;

strivec_format::named! {
    /// The region of a pixel, judged by the photograph alone.
    #[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
    #[serde(rename_all = "lowercase")]
    pub enum Region {
        /// Mostly transparent, with all pixels around it.
        Background = "background",
        /// Within two pixels of both opaque and transparent pixels.
        Silhouette = "silhouettes",
        /// Luminance differs from a neighbor's (above, below, left, right) by more than 0.1.
        Edge = "edges",
        /// Nearly white, like the highlights of glossy surfaces: every channel is at least 0.7.
        Highlight = "highlights",
        /// All other pixels.
        Surface = "other surface",
    }
}

/// Smallest difference of luminance of neighboring pixels at an edge.
const EDGE: f32 = 0.1;
/// Smallest channel value of a highlight.
const HIGHLIGHT: f32 = 0.7;
/// Reach of a silhouette, in pixels.
const SILHOUETTE_REACH: usize = 2;

impl Region {
    /// The regions of a photograph of `size` (columns, rows) with these colors, and these opacities from 0 to 1.
    ///
    /// # Errors
    ///
    /// [`Error::Size`] if either has another size.
    pub fn from_photograph(size: [u32; 2], colors: &[[f32; 3]], opacities: &[f32]) -> Result<Vec<Self>, Error> {
        Error::unless_size(size, colors.len())?;
        Error::unless_size(size, opacities.len())?;
        let [width, height] = size.map(|s| s as usize);
        let luminance: Vec<f32> = colors.iter().map(|[r, g, b]| 0.2126 * r + 0.7152 * g + 0.0722 * b).collect();
        let around = |at: usize, count: usize, reach: usize| at.saturating_sub(reach)..(at + reach + 1).min(count);
        let is_opaque = |x: usize, y: usize| opacities[y * width + x] >= 0.5;
        let region = |x: usize, y: usize| {
            let differs = |other: usize| (luminance[other] - luminance[y * width + x]).abs() > EDGE;
            let columns = around(x, width, SILHOUETTE_REACH);
            let mut near = around(y, height, SILHOUETTE_REACH).flat_map(|y| columns.clone().map(move |x| (x, y)));
            if near.any(|(near_x, near_y)| is_opaque(near_x, near_y) != is_opaque(x, y)) {
                Self::Silhouette
            } else if !is_opaque(x, y) {
                Self::Background
            } else if around(x, width, 1).any(|x| differs(y * width + x))
                || around(y, height, 1).any(|y| differs(y * width + x))
            {
                Self::Edge
            } else if colors[y * width + x].iter().all(|&c| c >= HIGHLIGHT) {
                Self::Highlight
            } else {
                Self::Surface
            }
        };
        Ok((0..height).flat_map(|y| (0..width).map(move |x| region(x, y))).collect())
    }
}

/// The errors of pictures by region.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RegionErrors {
    /// \[region\] the sum over pixels and channels of the squared differences.
    squared: [f64; Region::ALL.len()],
    pixels: [u64; Region::ALL.len()],
}

/// One region of all pictures.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RegionReport {
    /// The region.
    pub region: Region,
    /// Share of the pixels.
    pub share_of_pixels: f64,
    /// Share of the squared error.
    pub share_of_error: f64,
    /// PSNR in dB, from the mean squared error of all its pixels; `null` in JSON if there is no error.
    pub psnr: f64,
}

impl RegionErrors {
    /// Adds a picture whose pixels are of `regions`.
    ///
    /// # Errors
    ///
    /// [`Error::Size`] if the three differ in size.
    pub fn add(&mut self, regions: &[Region], rendered: &[[f32; 3]], truth: &[[f32; 3]]) -> Result<(), Error> {
        for found in [rendered.len(), truth.len()] {
            if found != regions.len() {
                return Err(Error::Size { expected: regions.len(), found });
            }
        }
        for ((&region, a), b) in regions.iter().zip(rendered).zip(truth) {
            let squared = |c: usize| (f64::from(a[c]) - f64::from(b[c])).powi(2);
            self.squared[region as usize] += (0..3).map(squared).sum::<f64>();
            self.pixels[region as usize] += 1;
        }
        Ok(())
    }

    /// One report for each region that the pictures have.
    pub fn report(&self) -> Vec<RegionReport> {
        let pixels = self.pixels.iter().sum::<u64>() as f64;
        let squared = self.squared.iter().sum::<f64>();
        let report = |region: Region| {
            let (of_pixels, of_error) = (self.pixels[region as usize] as f64, self.squared[region as usize]);
            RegionReport {
                region,
                share_of_pixels: of_pixels / pixels,
                share_of_error: if squared > 0.0 { of_error / squared } else { 0.0 },
                psnr: psnr_of_mse(of_error / (3.0 * of_pixels)),
            }
        };
        Region::ALL.into_iter().filter(|&region| self.pixels[region as usize] > 0).map(report).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn regions_follow_the_photograph() {
        // A row that is transparent up to column 8, then dark, bright and dark.
        let color = |x: usize| if (14..20).contains(&x) { [0.9; 3] } else { [0.2, 0.3, 0.1] };
        let colors: Vec<_> = (0..30).map(color).collect();
        let opacities: Vec<_> = (0..30).map(|x| if x < 8 { 0.0 } else { 1.0 }).collect();
        let regions = Region::from_photograph([30, 1], &colors, &opacities).unwrap();
        let count = |region| regions.iter().filter(|&&r| r == region).count();
        assert_eq!(Region::ALL.map(count), [6, 4, 4, 4, 12]);
        assert_eq!(
            [regions[5], regions[6], regions[9], regions[10]].map(Region::name),
            ["background", "silhouettes", "silhouettes", "other surface"]
        );
        assert_eq!(
            [13, 14, 15, 18, 19, 20].map(|x| regions[x] == Region::Edge),
            [true, true, false, false, true, true]
        );
        assert!(Region::from_photograph([29, 1], &colors, &opacities).is_err());
    }

    #[test]
    fn errors_add_up_to_those_of_the_whole() {
        let regions = [Region::Background, Region::Surface, Region::Surface, Region::Edge];
        let truth = [[0.5; 3]; 4];
        let rendered = [[0.5; 3], [0.6; 3], [0.5; 3], [0.7; 3]];
        let mut errors = RegionErrors::default();
        errors.add(&regions, &rendered, &truth).unwrap();
        let report = errors.report();
        assert_eq!(report.len(), 3);
        assert!((report[2].psnr - 10.0 * 200f64.log10()).abs() < 1e-4, "{report:?}");
        assert!((report[1].share_of_error - 0.8).abs() < 1e-6 && report[0].share_of_error == 0.0);
        assert!(errors.add(&regions, &rendered[1..], &truth).is_err());
    }
}
