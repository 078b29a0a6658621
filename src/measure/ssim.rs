//! Structural similarity (Wang, Bovik, Sheikh and Simoncelli, 2004) in the form that NeRF papers report: a Gaussian
//! window of 11×11 with σ = 1.5, K₁ = 0.01, K₂ = 0.03, values in \[0, 1\], only windows that lie wholly in the picture,
//! one map per channel, averaged over the map and the channels. As mip-NeRF and TensoRF compute it, the variances are
//! kept from falling below 0 and the covariance from exceeding what the variances allow.

use super::Error;

/// The window's edge in pixels.
pub const SSIM_WINDOW: usize = 11;
const SIGMA: f64 = 1.5;
const C1: f64 = 0.01 * 0.01;
const C2: f64 = 0.03 * 0.03;

/// The mean structural similarity of two pictures of `size` (columns, rows): 1 for identical ones.
///
/// # Errors
///
/// [`Error::Size`] if a list of colors does not have the length of `size`; [`Error::SmallerThanWindow`].
pub fn ssim(size: [u32; 2], a: &[[f32; 3]], b: &[[f32; 3]]) -> Result<f64, Error> {
    Error::unless_size(size, a.len())?;
    Error::unless_size(size, b.len())?;
    if size.iter().any(|&extent| (extent as usize) < SSIM_WINDOW) {
        return Err(Error::SmallerThanWindow { window: SSIM_WINDOW, found: size });
    }
    let width = size[0] as usize;
    let sum: f64 = (0..3).map(|channel| channel_ssim(width, &plane(a, channel), &plane(b, channel))).sum();
    Ok(sum / 3.0)
}

fn plane(picture: &[[f32; 3]], channel: usize) -> Vec<f64> {
    picture.iter().map(|color| f64::from(color[channel])).collect()
}

fn channel_ssim(width: usize, a: &[f64], b: &[f64]) -> f64 {
    let window = gaussian();
    let mean = |plane: &[f64]| blurred(&window, width, plane);
    let mean_of_product = |p: &[f64], q: &[f64]| mean(&p.iter().zip(q).map(|(x, y)| x * y).collect::<Vec<_>>());
    let (mean_a, mean_b) = (mean(a), mean(b));
    let (square_a, square_b, product) = (mean_of_product(a, a), mean_of_product(b, b), mean_of_product(a, b));
    let at = |i: usize| {
        let (mean_a, mean_b) = (mean_a[i], mean_b[i]);
        let variance_a = (square_a[i] - mean_a * mean_a).max(0.0);
        let variance_b = (square_b[i] - mean_b * mean_b).max(0.0);
        let covariance = product[i] - mean_a * mean_b;
        let covariance = covariance.signum() * covariance.abs().min((variance_a * variance_b).sqrt());
        (2.0 * mean_a * mean_b + C1) * (2.0 * covariance + C2)
            / ((mean_a * mean_a + mean_b * mean_b + C1) * (variance_a + variance_b + C2))
    };
    (0..mean_a.len()).map(at).sum::<f64>() / mean_a.len() as f64
}

/// One axis of the window, of sum 1.
fn gaussian() -> [f64; SSIM_WINDOW] {
    let middle = (SSIM_WINDOW / 2) as f64;
    let window: [f64; SSIM_WINDOW] = std::array::from_fn(|i| (-0.5 * ((i as f64 - middle) / SIGMA).powi(2)).exp());
    let sum: f64 = window.iter().sum();
    window.map(|v| v / sum)
}

/// The window's weighted means at every position inside the picture: \[rows − 10\]\[columns − 10\].
fn blurred(window: &[f64; SSIM_WINDOW], width: usize, plane: &[f64]) -> Vec<f64> {
    let along_row = |row: &[f64]| -> Vec<f64> {
        row.windows(SSIM_WINDOW).map(|part| part.iter().zip(window).map(|(v, w)| v * w).sum()).collect()
    };
    let rows: Vec<Vec<f64>> = plane.chunks_exact(width).map(along_row).collect();
    let down = |rows: &[Vec<f64>]| -> Vec<f64> {
        let mut sums = vec![0.0; rows[0].len()];
        for (row, weight) in rows.iter().zip(window) {
            sums.iter_mut().zip(row).for_each(|(sum, v)| *sum += weight * v);
        }
        sums
    };
    rows.windows(SSIM_WINDOW).flat_map(down).collect()
}
