//! Finding out within a few steps that a run has diverged, and saying what to change.

use std::fmt::{self, Display};

use rayon::prelude::*;

use super::{Target, TrainConfig, network_parts};
use crate::field::Field;

/// A step of Adam moves no number by more than the learning rate: a run would have to go on for 50 000 steps in one
/// direction at the presets' rate to bring one here. Products of three are then far beyond what any density needs.
const LARGEST: f32 = 1000.0;
/// Steps whose mean error is compared.
const WINDOW: usize = 32;
/// Steps at the start whose error is that of an untrained scene.
const FIRST: usize = 8;
/// How many times worse than an untrained scene, and than a picture of one color, a window may be.
const WORSE: f64 = 2.0;
/// So many steps are each looked at for parameters that explode; later ones once a window.
const EARLY: u64 = 64;

/// By what it is known that a run has diverged, with the settings to change.
#[derive(Clone, Debug, PartialEq)]
pub enum Divergence {
    /// The error is no number any more.
    NotFinite {
        /// The mean squared error.
        found: f64,
        /// The run's learning rates.
        rates: [f64; 2],
    },
    /// The mean error of the last steps is twice that of an untrained scene, and of one color.
    Worse {
        /// The last steps' mean squared error.
        found: f64,
        /// The larger one of the untrained scene's and one color's.
        expected: f64,
        /// The run's learning rates.
        rates: [f64; 2],
    },
    /// A parameter is beyond what any scene needs.
    Parameter {
        /// Which parameters.
        what: &'static str,
        /// One of them.
        found: f32,
        /// The setting of their learning rate.
        setting: &'static str,
        /// The run's.
        rate: f64,
        /// The presets'.
        usual: f64,
    },
}

impl Display for Divergence {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let rates = |[factors, networks]: &[f64; 2]| {
            format!(
                "try a smaller factor_learning_rate (now {factors}) and network_learning_rate (now {networks}), or check \
                 that cameras and photographs belong together"
            )
        };
        match self {
            Self::NotFinite { found, rates: now } => {
                write!(f, "expected a finite error, found {found}; {}", rates(now))
            }
            Self::Worse { found, expected, rates: now } => write!(
                f,
                "expected a mean squared error below {WORSE} times {expected:.4}, which one color or no training has, found \
                 {found:.4}; {}",
                rates(now)
            ),
            Self::Parameter { what, found, setting, rate, usual } => write!(
                f,
                "expected {what} within {LARGEST} of 0, found {found}; try a smaller {setting} (now {rate}, of presets {usual})"
            ),
        }
    }
}

/// What is remembered of a run's errors. A resumed run begins anew.
#[derive(Clone, Debug, Default)]
pub(super) struct DivergenceMonitor {
    steps: u64,
    first: Vec<f64>,
    /// The last errors, and what one color would have had, in a ring.
    last: Vec<[f64; 2]>,
}

impl DivergenceMonitor {
    /// Looks at a step's mean squared error before its update.
    ///
    /// # Errors
    ///
    /// Where it tells that the run has diverged.
    pub(super) fn record(&mut self, error: f64, targets: &[Target], config: &TrainConfig) -> Result<(), Divergence> {
        let rates = [config.factor_learning_rate, config.network_learning_rate];
        if !error.is_finite() {
            return Err(Divergence::NotFinite { found: error, rates });
        }
        if self.first.len() < FIRST {
            self.first.push(error);
        }
        let seen = [error, variance(targets)];
        let place = self.steps as usize % WINDOW;
        self.steps += 1;
        match self.last.get_mut(place) {
            Some(last) => *last = seen,
            None => self.last.push(seen),
        }
        if self.last.len() == WINDOW {
            let mean = |of: usize| self.last.iter().map(|seen| seen[of]).sum::<f64>() / WINDOW as f64;
            let untrained = self.first.iter().sum::<f64>() / FIRST as f64;
            let (found, expected) = (mean(0), mean(1).max(untrained));
            if found > WORSE * expected {
                return Err(Divergence::Worse { found, expected, rates });
            }
        }
        Ok(())
    }

    /// Looks, every now and then, at what a step has made of `field`'s parameters.
    ///
    /// # Errors
    ///
    /// Where they have exploded.
    pub(super) fn see_parameters(&self, field: &mut Field<f32>, config: &TrainConfig) -> Result<(), Divergence> {
        if self.steps > EARLY && !self.steps.is_multiple_of(WINDOW as u64) {
            return Ok(());
        }
        let usual = TrainConfig::default();
        let exploded = |values: &[f32]| values.par_iter().copied().find_first(|v| v.is_nan() || v.abs() > LARGEST);
        let of_factors = field.scales.iter().find_map(|s| exploded(&s.density).or_else(|| exploded(&s.appearance)));
        if let Some(found) = of_factors {
            return Err(Divergence::Parameter {
                what: "factors",
                found,
                setting: "factor_learning_rate",
                rate: config.factor_learning_rate,
                usual: usual.factor_learning_rate,
            });
        }
        if let Some(found) = network_parts(&mut field.decoder).find_map(|part| exploded(part)) {
            return Err(Divergence::Parameter {
                what: "weights of the networks",
                found,
                setting: "network_learning_rate",
                rate: config.network_learning_rate,
                usual: usual.network_learning_rate,
            });
        }
        Ok(())
    }
}

/// The mean squared error of the best picture of one color.
fn variance(targets: &[Target]) -> f64 {
    let count = targets.len().max(1) as f64;
    let of_channel = |c: usize| {
        let values = || targets.iter().map(|t| f64::from(t.color[c]));
        let mean = values().sum::<f64>() / count;
        values().map(|v| (v - mean).powi(2)).sum::<f64>() / count
    };
    (0..3).map(of_channel).sum::<f64>() / 3.0
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What is found in 64 steps of the error `after`, which follow 64 of 0.1 on photographs of two grays.
    fn found(after: f64) -> Option<Divergence> {
        let target = |n: usize| Target { color: [(n % 2) as f32 * 0.6; 3], background: [1.0; 3] };
        let targets: Vec<Target> = (0..16).map(target).collect();
        let mut watch = DivergenceMonitor::default();
        let config = TrainConfig::default();
        (0..128).find_map(|n| watch.record(if n < 64 { 0.1 } else { after }, &targets, &config).err())
    }

    #[test]
    fn errors_twice_those_of_no_training_and_of_one_color_are_divergence() {
        // One color has an error of 0.09, no training one of 0.1.
        assert_eq!(found(0.19), None);
        let worse = found(0.25).expect("more than twice as bad");
        assert!(
            matches!(worse, Divergence::Worse { found, expected, .. } if found > 0.2 && (expected - 0.1).abs() < 1e-9),
            "{worse}"
        );
        assert!(worse.to_string().contains("factor_learning_rate"), "{worse}");
        assert!(matches!(found(f64::NAN), Some(Divergence::NotFinite { .. })));
    }
}
