//! The figures of the paper's tables.

use serde::{Deserialize, Serialize};

/// The figures of a training in a table.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Figures {
    /// In dB, the mean over views.
    pub(super) psnr: Option<f64>,
    pub(super) ssim: Option<f64>,
    pub(super) lpips_vgg: Option<f64>,
    pub(super) lpips_alex: Option<f64>,
    /// Parameters, in millions.
    pub(super) millions: Option<f64>,
    /// Minutes of training; the paper's are of an RTX 3090.
    pub(super) minutes: Option<f64>,
    /// Seconds of a picture.
    pub(super) seconds: Option<f64>,
}

impl Figures {
    pub(super) const fn psnr(psnr: f64) -> Self {
        Self {
            psnr: Some(psnr),
            ssim: None,
            lpips_vgg: None,
            lpips_alex: None,
            millions: None,
            minutes: None,
            seconds: None,
        }
    }

    pub(super) const fn ssim(self, ssim: f64) -> Self {
        Self { ssim: Some(ssim), ..self }
    }

    pub(super) const fn vgg(self, lpips_vgg: f64) -> Self {
        Self { lpips_vgg: Some(lpips_vgg), ..self }
    }

    pub(super) const fn alex(self, lpips_alex: f64) -> Self {
        Self { lpips_alex: Some(lpips_alex), ..self }
    }

    pub(super) const fn millions(self, millions: f64) -> Self {
        Self { millions: Some(millions), ..self }
    }

    pub(super) const fn minutes(self, minutes: f64) -> Self {
        Self { minutes: Some(minutes), ..self }
    }

    pub(super) const fn seconds(self, seconds: f64) -> Self {
        Self { seconds: Some(seconds), ..self }
    }

    /// The mean of each figure that all of `scenes` have.
    pub(super) fn mean<'a>(scenes: impl Iterator<Item = &'a Self> + Clone) -> Self {
        let count = scenes.clone().count() as f64;
        let mean = |of: fn(&Self) -> Option<f64>| scenes.clone().map(of).sum::<Option<f64>>().map(|sum| sum / count);
        Self {
            psnr: mean(|f| f.psnr),
            ssim: mean(|f| f.ssim),
            lpips_vgg: mean(|f| f.lpips_vgg),
            lpips_alex: mean(|f| f.lpips_alex),
            millions: mean(|f| f.millions),
            minutes: mean(|f| f.minutes),
            seconds: mean(|f| f.seconds),
        }
    }
}

/// A scene's name, and its figures.
pub(super) type OfScene = (&'static str, Figures);

/// The figures of scenes by measure: PSNR, SSIM, LPIPS by VGG and by AlexNet.
struct Breakdown<const N: usize>([[f64; N]; 4]);

impl<const N: usize> Breakdown<N> {
    fn of(&self, scenes: [&'static str; N]) -> Vec<OfScene> {
        let [psnr, ssim, vgg, alex] = &self.0;
        let figures = |n: usize| Figures::psnr(psnr[n]).ssim(ssim[n]).vgg(vgg[n]).alex(alex[n]);
        (0..N).map(|n| (scenes[n], figures(n))).collect()
    }
}

/// The scenes of NeRF Synthetic, in the order of the paper's breakdown.
const SYNTHETIC: [&str; 8] = ["chair", "drums", "lego", "mic", "materials", "ship", "hotdog", "ficus"];

/// The breakdown of NeRF Synthetic by scene ("Detailed breakdown of quantitative metrics") for the preset `name`; empty if the
/// paper has none.
pub(super) fn of_synthetic(name: &str) -> Vec<OfScene> {
    let breakdown = match name {
        "12" => Breakdown([
            [35.21, 25.96, 35.60, 35.29, 29.54, 30.64, 37.03, 34.21],
            [0.983, 0.937, 0.980, 0.989, 0.948, 0.888, 0.981, 0.983],
            [0.025, 0.070, 0.022, 0.015, 0.062, 0.145, 0.033, 0.022],
            [0.011, 0.051, 0.009, 0.007, 0.027, 0.092, 0.015, 0.013],
        ]),
        "24" => Breakdown([
            [35.60, 26.16, 36.05, 35.81, 29.79, 30.89, 37.24, 34.37],
            [0.984, 0.940, 0.982, 0.990, 0.952, 0.893, 0.982, 0.984],
            [0.022, 0.067, 0.020, 0.013, 0.058, 0.141, 0.031, 0.021],
            [0.010, 0.049, 0.008, 0.006, 0.024, 0.087, 0.014, 0.012],
        ]),
        "48" => Breakdown([
            [35.88, 26.20, 36.52, 36.65, 29.90, 31.13, 37.63, 34.47],
            [0.985, 0.940, 0.984, 0.992, 0.953, 0.899, 0.983, 0.985],
            [0.021, 0.064, 0.017, 0.011, 0.056, 0.138, 0.029, 0.018],
            [0.009, 0.048, 0.007, 0.005, 0.023, 0.086, 0.012, 0.011],
        ]),
        "tensorf-cp" => Breakdown([
            [33.60, 25.17, 34.05, 33.77, 30.10, 28.84, 36.24, 30.72],
            [0.973, 0.921, 0.971, 0.983, 0.950, 0.857, 0.975, 0.965],
            [0.044, 0.114, 0.038, 0.035, 0.068, 0.196, 0.052, 0.058],
            [0.022, 0.069, 0.014, 0.018, 0.031, 0.130, 0.024, 0.024],
        ]),
        "tensorf-vm" => Breakdown([
            [35.76, 26.01, 36.46, 34.61, 30.12, 30.77, 37.41, 33.99],
            [0.985, 0.937, 0.983, 0.988, 0.952, 0.895, 0.982, 0.982],
            [0.022, 0.073, 0.018, 0.015, 0.058, 0.138, 0.032, 0.022],
            [0.010, 0.051, 0.007, 0.009, 0.026, 0.085, 0.013, 0.012],
        ]),
        _ => return Vec::new(),
    };
    breakdown.of(SYNTHETIC)
}

/// The same of Tanks and Temples ("Quantity comparison on five scenes in the Tanks and Temples dataset").
pub(super) fn of_tanks(name: &str) -> Vec<OfScene> {
    let breakdown = match name {
        "48" => Breakdown([
            [28.39, 27.32, 28.09, 26.58, 33.13],
            [0.948, 0.915, 0.884, 0.917, 0.957],
            [0.083, 0.150, 0.216, 0.154, 0.078],
            [0.083, 0.123, 0.167, 0.125, 0.065],
        ]),
        "tensorf-cp" => Breakdown([
            [27.86, 26.25, 26.74, 24.73, 32.39],
            [0.934, 0.885, 0.839, 0.879, 0.948],
            [0.106, 0.202, 0.283, 0.227, 0.088],
            [0.089, 0.154, 0.237, 0.176, 0.063],
        ]),
        "tensorf-vm" => Breakdown([
            [28.34, 27.14, 27.22, 26.19, 33.92],
            [0.948, 0.914, 0.864, 0.912, 0.965],
            [0.078, 0.145, 0.252, 0.159, 0.064],
            [0.081, 0.129, 0.217, 0.139, 0.057],
        ]),
        _ => return Vec::new(),
    };
    breakdown.of(["Ignatius", "Truck", "Barn", "Caterpillar", "Family"])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn breakdowns_have_the_means_of_the_papers_tables() {
        let all = [
            (of_synthetic("12"), [32.94, 0.961, 0.049, 0.028]),
            (of_synthetic("24"), [33.24, 0.963, 0.046, 0.026]),
            (of_synthetic("48"), [33.55, 0.965, 0.044, 0.025]),
            (of_synthetic("tensorf-cp"), [31.56, 0.949, 0.076, 0.041]),
            (of_synthetic("tensorf-vm"), [33.14, 0.963, 0.047, 0.027]),
            (of_tanks("48"), [28.70, 0.924, 0.136, 0.113]),
            (of_tanks("tensorf-cp"), [27.59, 0.897, 0.181, 0.144]),
            (of_tanks("tensorf-vm"), [28.56, 0.920, 0.140, 0.125]),
        ];
        for (scenes, expected) in all {
            let mean = Figures::mean(scenes.iter().map(|scene| &scene.1));
            let found = [mean.psnr, mean.ssim, mean.lpips_vgg, mean.lpips_alex].map(Option::unwrap);
            for (measure, (a, b)) in found.iter().zip(expected).enumerate() {
                // The paper rounds means up as well as down.
                let tolerance = if measure == 0 { 0.01 } else { 0.001 };
                assert!((a - b).abs() <= tolerance, "{found:?} {expected:?}");
            }
        }
    }
}
