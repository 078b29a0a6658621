//! The peak signal-to-noise ratio of a mean squared error, and its running mean during training.

/// −10·log₁₀(`mse`): the PSNR in decibels of pictures whose values span \[0, 1\]; infinite for an error of 0.
pub fn psnr_of_mse(mse: f64) -> f64 {
    // 0 − … so that an error of 1 gives 0 rather than −0.
    0.0 - 10.0 * mse.log10()
}

/// An exponentially weighted mean of the squared errors of training steps, without the bias of its start.
#[derive(Clone, Copy, Debug, Default)]
pub struct RunningMse {
    /// Weighted sum of the squared errors.
    squared: f64,
    /// Sum of the weights.
    weight: f64,
}

impl RunningMse {
    /// The share of its weight that a step keeps when the next one is added.
    const DECAY: f64 = 0.98;

    /// Adds the mean squared error of a step.
    pub fn add(&mut self, mse: f64) {
        self.squared = Self::DECAY * self.squared + mse;
        self.weight = Self::DECAY * self.weight + 1.0;
    }

    /// The PSNR of the mean in decibels, at most 120; NaN before the first step.
    pub fn psnr(&self) -> f64 {
        if self.weight == 0.0 { f64::NAN } else { psnr_of_mse((self.squared / self.weight).max(1e-12)) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_running_mean_has_no_bias_towards_its_start() {
        let mut mean = RunningMse::default();
        assert!(mean.psnr().is_nan());
        for _ in 0..3 {
            mean.add(0.01);
            assert!((mean.psnr() - 20.0).abs() < 1e-9);
        }
        mean.add(1.0);
        assert!(mean.psnr() < 7.0);
    }
}
