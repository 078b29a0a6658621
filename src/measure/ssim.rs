//! Structural similarity (Wang, Bovik, Sheikh and Simoncelli, 2004): K₁ = 0.01, K₂ = 0.03, values in \[0, 1\], one map per
//! channel, averaged over the map and the channels. Programs differ in the window and at the border; [`SsimConvention`].
//! As mip-NeRF and TensoRF compute it, the variances are kept from falling below 0 and the covariance from exceeding what the
//! variances allow.

use super::Error;

/// The window's edge in pixels, of [`SsimConvention::Nerf`].
pub const SSIM_WINDOW: usize = 11;
const SIGMA: f64 = 1.5;
/// The window's edge of [`SsimConvention::ScikitImage`].
const UNIFORM_WINDOW: usize = 7;
const C1: f64 = 0.01 * 0.01;
const C2: f64 = 0.03 * 0.03;

strivec_format::named! {
    /// The window and the border of SSIM. `tools/measure/ssim.py` compares them with the programs that are named here.
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    pub enum SsimConvention {
        /// A Gaussian window of 11×11 with σ = 1.5, only windows that lie wholly in the picture. The same number comes from
        /// TensorFlow's `tf.image.ssim` (NeRF), mip-NeRF's `compute_ssim`, TensoRF's `rgb_ssim`, torchmetrics (nerfstudio), and
        /// scikit-image with `gaussian_weights=True, sigma=1.5, use_sample_covariance=False`.
        Nerf = "nerf",
        /// A Gaussian window of 11×11 with σ = 1.5 at every pixel, with zeros around the picture: `loss_utils.ssim` of 3D
        /// Gaussian splatting.
        GaussianSplatting = "3dgs",
        /// Equal weights of 7×7 pixels, sample variances, only windows that lie wholly in the picture: the defaults of
        /// scikit-image's `structural_similarity`, which pixelNeRF uses.
        ScikitImage = "skimage",
    }
}

/// Along one axis the weights of a window, of sum 1; the zeros around the picture; and the factor of variances.
struct Window {
    weights: Vec<f64>,
    padding: usize,
    variance_scale: f64,
}

impl SsimConvention {
    /// Name of the convention in results.
    pub fn result_name(self) -> &'static str {
        match self {
            Self::Nerf => "ssim_nerf",
            Self::GaussianSplatting => "ssim_3dgs",
            Self::ScikitImage => "ssim_skimage",
        }
    }

    /// The mean structural similarity of two pictures of `size` (columns, rows): 1 for identical ones.
    ///
    /// # Errors
    ///
    /// [`Error::Size`] if a list of colors does not have the length of `size`; [`Error::SmallerThanWindow`].
    pub fn mean(self, size: [u32; 2], a: &[[f32; 3]], b: &[[f32; 3]]) -> Result<f64, Error> {
        Error::unless_size(size, a.len())?;
        Error::unless_size(size, b.len())?;
        let window = self.window();
        let extent = window.weights.len();
        if size.iter().any(|&n| n == 0 || n as usize + 2 * window.padding < extent) {
            return Err(Error::SmallerThanWindow { window: extent, found: size });
        }
        let of_channel = |channel| {
            let [a, b] = [a, b].map(|picture| plane(size, picture, channel, window.padding));
            channel_ssim(&window, size[0] as usize + 2 * window.padding, &a, &b)
        };
        Ok((0..3).map(of_channel).sum::<f64>() / 3.0)
    }

    fn window(self) -> Window {
        let (weights, padding) = match self {
            Self::Nerf => (gaussian(), 0),
            Self::GaussianSplatting => (gaussian(), SSIM_WINDOW / 2),
            Self::ScikitImage => (vec![1.0 / UNIFORM_WINDOW as f64; UNIFORM_WINDOW], 0),
        };
        let pixels = (UNIFORM_WINDOW * UNIFORM_WINDOW) as f64;
        let variance_scale = if self == Self::ScikitImage { pixels / (pixels - 1.0) } else { 1.0 };
        Window { weights, padding, variance_scale }
    }
}

/// [`SsimConvention::mean`] of [`SsimConvention::Nerf`].
///
/// # Errors
///
/// The errors of [`SsimConvention::mean`].
pub fn ssim(size: [u32; 2], a: &[[f32; 3]], b: &[[f32; 3]]) -> Result<f64, Error> {
    SsimConvention::Nerf.mean(size, a, b)
}

/// A channel of `picture`, with `padding` zeros on each side.
fn plane(size: [u32; 2], picture: &[[f32; 3]], channel: usize, padding: usize) -> Vec<f64> {
    let [width, height] = size.map(|n| n as usize + 2 * padding);
    let mut plane = vec![0.0; width * height];
    for (row, colors) in picture.chunks_exact(size[0] as usize).enumerate() {
        let to = &mut plane[(row + padding) * width + padding..][..colors.len()];
        to.iter_mut().zip(colors).for_each(|(to, color)| *to = f64::from(color[channel]));
    }
    plane
}

fn channel_ssim(window: &Window, width: usize, a: &[f64], b: &[f64]) -> f64 {
    let mean = |plane: &[f64]| blurred(&window.weights, width, plane);
    let mean_of_product = |p: &[f64], q: &[f64]| mean(&p.iter().zip(q).map(|(x, y)| x * y).collect::<Vec<_>>());
    let (mean_a, mean_b) = (mean(a), mean(b));
    let (square_a, square_b, product) = (mean_of_product(a, a), mean_of_product(b, b), mean_of_product(a, b));
    let at = |i: usize| {
        let (mean_a, mean_b) = (mean_a[i], mean_b[i]);
        let variance_a = window.variance_scale * (square_a[i] - mean_a * mean_a).max(0.0);
        let variance_b = window.variance_scale * (square_b[i] - mean_b * mean_b).max(0.0);
        let covariance = window.variance_scale * (product[i] - mean_a * mean_b);
        let covariance = covariance.signum() * covariance.abs().min((variance_a * variance_b).sqrt());
        (2.0 * mean_a * mean_b + C1) * (2.0 * covariance + C2)
            / ((mean_a * mean_a + mean_b * mean_b + C1) * (variance_a + variance_b + C2))
    };
    (0..mean_a.len()).map(at).sum::<f64>() / mean_a.len() as f64
}

/// One axis of the Gaussian window, of sum 1.
fn gaussian() -> Vec<f64> {
    let middle = (SSIM_WINDOW / 2) as f64;
    let window = (0..SSIM_WINDOW).map(|i| (-0.5 * ((i as f64 - middle) / SIGMA).powi(2)).exp());
    let sum: f64 = window.clone().sum();
    window.map(|v| v / sum).collect()
}

/// The weighted means of the window, of edge n, at every position inside the picture: \[rows − n + 1\]\[columns − n + 1\].
fn blurred(window: &[f64], width: usize, plane: &[f64]) -> Vec<f64> {
    let along_row = |row: &[f64]| -> Vec<f64> {
        row.windows(window.len()).map(|part| part.iter().zip(window).map(|(v, w)| v * w).sum()).collect()
    };
    let rows: Vec<Vec<f64>> = plane.chunks_exact(width).map(along_row).collect();
    let down = |rows: &[Vec<f64>]| -> Vec<f64> {
        let mut sums = vec![0.0; rows[0].len()];
        for (row, weight) in rows.iter().zip(window) {
            sums.iter_mut().zip(row).for_each(|(sum, v)| *sum += weight * v);
        }
        sums
    };
    rows.windows(window.len()).flat_map(down).collect()
}
