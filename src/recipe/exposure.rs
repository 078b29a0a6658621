//! The choice of exposures: photographs that show the same surfaces more or less bright each get a map of colors.

use super::Observer;
use strivec_capture::dataset::Dataset;
use strivec_capture::prior;
use strivec_train::{Exposure, TrainConfig};

/// The brightness, in stops of encoded luminance beside the median photograph, from which on exposures differ. Those of one phone
/// differ by up to 0.27 where maps of their own lose on held-out photographs (docs/experiments/2026-11-30-captures.md).
const DIFFERENT: f64 = 0.35;
/// The share of the photographs that may differ as much from other causes.
const OTHERS: f64 = 0.1;

/// Turns the fit of exposures on in `config`, which leaves it open, if many of the photographs of `dataset`, whose distances are
/// known, show the same surfaces brighter or darker than others do.
pub(super) fn decide_exposure(config: &mut TrainConfig, dataset: &Dataset, observer: &mut dyn Observer) {
    if config.photographs.exposure != Exposure::Auto {
        return;
    }
    let known: Vec<f64> = prior::brightness(&dataset.views).into_iter().flatten().collect();
    let different = known.iter().filter(|stops| stops.abs() > DIFFERENT).count();
    if different as f64 > OTHERS * known.len() as f64 {
        config.photographs.exposure = Exposure::On;
        let [least, most] = [f64::min, f64::max].map(|of| known.iter().copied().fold(0.0, of).exp2());
        observer.message(&format_args!(
            "exposure: photographs show the same surfaces {least:.2} to {most:.2} times as bright as the median one, so that each has \
             colors of its own"
        ));
    }
}
