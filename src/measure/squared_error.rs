//! Squared differences of pictures, and their peak signal-to-noise ratio.

use super::Error;
use strivec_format::psnr::psnr_of_mse;

/// The mean squared difference over all pixels and channels, in f64.
///
/// # Errors
///
/// If the pictures differ in size or have no pixels.
pub fn mse(a: &[[f32; 3]], b: &[[f32; 3]]) -> Result<f64, Error> {
    if a.len() != b.len() {
        return Err(Error::Size { expected: a.len(), found: b.len() });
    }
    if a.is_empty() {
        return Err(Error::Empty);
    }
    let squared = |(p, q): (&f32, &f32)| (f64::from(*p) - f64::from(*q)).powi(2);
    let sum: f64 = a.as_flattened().iter().zip(b.as_flattened()).map(squared).sum();
    Ok(sum / (3 * a.len()) as f64)
}

/// The PSNR in decibels between two pictures, from the mean squared error over all pixels and channels; infinite for
/// identical pictures.
///
/// # Errors
///
/// The errors of [`mse`].
pub fn psnr(a: &[[f32; 3]], b: &[[f32; 3]]) -> Result<f64, Error> {
    mse(a, b).map(psnr_of_mse)
}
