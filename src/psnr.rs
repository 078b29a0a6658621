//! The peak signal-to-noise ratio of a mean squared error.

/// −10·log₁₀(`mse`): the PSNR in decibels of pictures whose values span \[0, 1\]; infinite for an error of 0.
pub fn psnr_of_mse(mse: f64) -> f64 {
    // 0 − … so that an error of 1 gives 0 rather than −0.
    0.0 - 10.0 * mse.log10()
}
