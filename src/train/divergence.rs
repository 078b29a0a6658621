//! Detection of divergence within a few steps.

use std::fmt::{self, Display};

use rayon::prelude::*;

use super::{Target, TrainConfig, network_parts};
use strivec_field::{Field, FieldScale};

/// The largest magnitude of a parameter. A step of Adam moves a parameter by no more than the learning rate: at the
/// presets' rate this takes 50 000 steps in one direction. Products of three such factors are far beyond any density.
const MAX_PARAMETER: f32 = 1000.0;
/// Number of steps whose mean error is compared.
const WINDOW: usize = 32;
/// Number of first steps whose mean error is that of an untrained scene.
const FIRST_STEPS: usize = 8;
/// The largest ratio of a window's error to that of an untrained scene and to that of a picture of one color.
const MAX_ERROR_RATIO: f64 = 2.0;
/// Parameters are checked after each of the first steps, this many, and later once per window.
const EARLY_STEPS: u64 = 64;

/// The symptom of a run that has diverged.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Divergence {
    /// The error is infinite or not a number.
    NotFinite {
        /// The mean squared error.
        found: f64,
        /// The learning rates of the factors and of the networks.
        rates: [f64; 2],
    },
    /// The mean error of the last steps is twice that of an untrained scene and of a picture of one color.
    Worse {
        /// The last steps' mean squared error.
        found: f64,
        /// The larger error of the untrained scene and of one color.
        expected: f64,
        /// The learning rates of the factors and of the networks.
        rates: [f64; 2],
    },
    /// A parameter is larger than any scene needs.
    Parameter {
        /// The kind of parameter, in the plural.
        what: &'static str,
        /// The value of one of them.
        found: f32,
        /// The setting of their learning rate.
        setting: &'static str,
        /// The run's learning rate.
        rate: f64,
        /// The presets' learning rate.
        usual: f64,
    },
}

impl Display for Divergence {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let rates = |[factors, networks]: &[f64; 2]| {
            format!(
                "try a smaller `optimizer.factor_learning_rate` (now {factors}) and \
                 `optimizer.network_learning_rate` (now {networks}), \
                 or check that cameras and photographs belong together"
            )
        };
        match self {
            Self::NotFinite { found, rates: now } => {
                write!(f, "the mean squared error is {found}; {}", rates(now))
            }
            Self::Worse { found, expected, rates: now } => write!(
                f,
                "the mean squared error is {found:.4}, more than {MAX_ERROR_RATIO} times the {expected:.4} \
                 of an untrained scene or of one color; {}",
                rates(now)
            ),
            Self::Parameter { what, found, setting, rate, usual } => write!(
                f,
                "one of the {what} is {found}, beyond {MAX_PARAMETER} in magnitude; try a smaller `{setting}` \
                 (now {rate}; the presets have {usual})"
            ),
        }
    }
}

/// The errors of the first and the last steps. A resumed run starts a new monitor.
#[derive(Clone, Debug, Default)]
pub(super) struct DivergenceMonitor {
    steps: u64,
    first: Vec<f64>,
    /// Ring buffer of the last errors, each with that of a picture of one color.
    last: Vec<[f64; 2]>,
}

impl DivergenceMonitor {
    /// Records a step's mean squared error before its update.
    ///
    /// # Errors
    ///
    /// If the errors show that the run has diverged.
    pub(super) fn record(&mut self, error: f64, targets: &[Target], config: &TrainConfig) -> Result<(), Divergence> {
        let rates = [config.optimizer.factor_learning_rate, config.optimizer.network_learning_rate];
        if !error.is_finite() {
            return Err(Divergence::NotFinite { found: error, rates });
        }
        if self.first.len() < FIRST_STEPS {
            self.first.push(error);
        }
        let errors = [error, variance(targets)];
        let place = self.steps as usize % WINDOW;
        self.steps += 1;
        match self.last.get_mut(place) {
            Some(last) => *last = errors,
            None => self.last.push(errors),
        }
        if self.last.len() == WINDOW {
            let mean = |of: usize| self.last.iter().map(|errors| errors[of]).sum::<f64>() / WINDOW as f64;
            let untrained = self.first.iter().sum::<f64>() / FIRST_STEPS as f64;
            let (found, expected) = (mean(0), mean(1).max(untrained));
            if found > MAX_ERROR_RATIO * expected {
                return Err(Divergence::Worse { found, expected, rates });
            }
        }
        Ok(())
    }

    /// Checks the parameters of `field` after some of the steps.
    ///
    /// # Errors
    ///
    /// If one is too large.
    pub(super) fn check_parameters(&self, field: &mut Field<f32>, config: &TrainConfig) -> Result<(), Divergence> {
        // Every factor is read, so it is not done in every step.
        if self.steps > EARLY_STEPS && !self.steps.is_multiple_of(WINDOW as u64) {
            return Ok(());
        }
        let usual = TrainConfig::default();
        let is_out = |v: f32| v.is_nan() || v.abs() > MAX_PARAMETER;
        // Chunk by chunk without an end in between, which compiles to vector operations.
        let exploded = |values: &[f32]| {
            let chunk =
                values.par_chunks(1 << 14).find_first(|chunk| chunk.iter().fold(false, |any, &v| any | is_out(v)));
            chunk.and_then(|chunk| chunk.iter().copied().find(|&v| is_out(v)))
        };
        let of_factors = field.scales.iter().flat_map(FieldScale::blocks).find_map(|block| exploded(block.values()));
        if let Some(found) = of_factors {
            return Err(Divergence::Parameter {
                what: "factors",
                found,
                setting: "optimizer.factor_learning_rate",
                rate: config.optimizer.factor_learning_rate,
                usual: usual.optimizer.factor_learning_rate,
            });
        }
        if let Some(found) = network_parts(field).find_map(|part| exploded(part)) {
            return Err(Divergence::Parameter {
                what: "weights of the networks",
                found,
                setting: "optimizer.network_learning_rate",
                rate: config.optimizer.network_learning_rate,
                usual: usual.optimizer.network_learning_rate,
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

    /// The divergence that 64 steps of the error `after` cause, after 64 steps of 0.1 on photographs of two grays.
    fn found(after: f64) -> Option<Divergence> {
        let target = |n: usize| Target {
            color: [(n % 2) as f32 * 0.6; 3],
            background: [1.0; 3],
            view: 0,
            distance: 0.0,
            weight: 1.0,
        };
        let targets: Vec<Target> = (0..16).map(target).collect();
        let mut monitor = DivergenceMonitor::default();
        let config = TrainConfig::default();
        (0..128).find_map(|n| monitor.record(if n < 64 { 0.1 } else { after }, &targets, &config).err())
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
