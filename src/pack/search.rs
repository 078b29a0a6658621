//! Search for the loss parameter that meets a bound on distortion or bytes.

use super::occupancy::without_gaps;
use super::{Distortion, Lossy, lossy};
use crate::container::{EncodeOptions, Error, Limits, Metadata, decode_scene_file, encode_scene_file};
use crate::model::Scene;
use crate::train::FactorImportance;

/// The bound that a file must meet.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Goal {
    /// The smallest file whose pictures have a mean squared error of at most `before + more`.
    Error {
        /// The error of the original scene: 0 against its own pictures.
        before: f64,
        /// The error that the encoding may add, positive.
        more: f64,
    },
    /// The file with the least error of at most this many bytes.
    Bytes(u64),
}

/// A scene ready to be written, with its size and distortion.
#[derive(Clone, Debug)]
pub struct Candidate {
    /// The scene to write.
    pub scene: Scene,
    /// The options to write it with.
    pub options: EncodeOptions,
    /// The scene that a reader decodes.
    pub decoded: Scene,
    /// Bytes of the file without metadata.
    pub bytes: u64,
    /// The mean squared error of the pictures of `decoded`.
    pub error: f64,
    /// The loss of [`lossy`] that it comes from; 0 if it comes from another encoding.
    pub loss: f64,
}

/// log₁₀ of the smallest and the largest loss that is tried.
const RANGE: [f64; 2] = [-17.0, -8.0];
/// The search ends if the interval of log₁₀ losses is no longer than this.
const MIN_INTERVAL: f64 = 0.002;
/// The search ends if a candidate leaves at most this share of an error, or of bytes, unused.
const ERROR_SLACK: f64 = 0.02;
const BYTES_SLACK: f64 = 0.003;
/// The most losses that [`search`] tries.
pub const MAX_TRIED: usize = 12;
/// The zstd level if the number of bytes does not matter.
const QUICK_LEVEL: i32 = 1;

impl Candidate {
    /// Encodes and decodes `scene` with `options` and measures the result.
    ///
    /// # Errors
    ///
    /// If the scene cannot be encoded.
    pub fn new(scene: Scene, options: EncodeOptions, distortion: &Distortion) -> Result<Self, Error> {
        let bytes = encode_scene_file(&scene, &Metadata::default(), &options)?;
        let decoded = decode_scene_file(&bytes, Limits { memory: u64::MAX })?.scene;
        let error = distortion.mse(&decoded);
        Ok(Self { scene, options, decoded, bytes: bytes.len() as u64, error, loss: 0.0 })
    }
}

impl Goal {
    /// The distance of `candidate` from the goal, about linear in the logarithm of the loss and increasing with it; 0
    /// if the goal is just met.
    fn beyond(self, candidate: &Candidate, reserved: u64) -> f64 {
        match self {
            Self::Error { before, more } => ((candidate.error - before).max(0.0) / more).ln(),
            Self::Bytes(most) => (most as f64 / (candidate.bytes + reserved) as f64).ln(),
        }
    }

    /// True if a candidate at this distance meets the goal.
    fn is_met(self, beyond: f64) -> bool {
        match self {
            Self::Error { .. } => beyond <= 0.0,
            Self::Bytes(_) => beyond >= 0.0,
        }
    }

    /// The distance to aim at: the goal is met, and little is left unused.
    fn aim(self) -> f64 {
        match self {
            Self::Error { .. } => -0.5 * self.slack(),
            Self::Bytes(_) => 0.5 * self.slack(),
        }
    }

    /// The distance that leaves little unused.
    fn slack(self) -> f64 {
        match self {
            Self::Error { .. } => ERROR_SLACK,
            Self::Bytes(_) => BYTES_SLACK,
        }
    }

    /// log₁₀ of the first loss to try.
    fn first_guess(self, scene: &Scene) -> f64 {
        match self {
            // An entry adds a twelfth of the loss to the error.
            Self::Error { more, .. } => (12.0 * more / scene.parameter_count() as f64).log10(),
            Self::Bytes(_) => 0.5 * (RANGE[0] + RANGE[1]),
        }
    }
}

/// Searches the loss for `scene` that meets `goal` best, with `reserved` bytes kept free for metadata; where bytes matter, without
/// the gaps of its occupancy. Returns `None` if even the largest loss misses the goal. `on_candidate` is called with every
/// candidate. If the goal is an error, candidates are compressed at a low level: compression does not change the error.
///
/// # Errors
///
/// If the scene cannot be encoded.
pub fn search(
    scene: &Scene,
    importance: &FactorImportance,
    distortion: &Distortion,
    goal: Goal,
    reserved: u64,
    on_candidate: &mut dyn FnMut(&Candidate),
) -> Result<Option<Candidate>, Error> {
    let simpler = matches!(goal, Goal::Bytes(_)).then(|| without_gaps(scene));
    let scene = simpler.as_ref().unwrap_or(scene);
    let [mut low, mut high] = RANGE;
    let mut next = goal.first_guess(scene).clamp(low + MIN_INTERVAL, high - MIN_INTERVAL);
    let mut before: Option<[f64; 2]> = None;
    let mut best: Option<(f64, Candidate)> = None;
    for _ in 0..MAX_TRIED {
        let loss = 10f64.powf(next);
        let Lossy { scene, mut options, .. } = lossy(scene, importance, loss);
        if matches!(goal, Goal::Error { .. }) {
            options.zstd_level = Some(QUICK_LEVEL);
        }
        let candidate = Candidate { loss, ..Candidate::new(scene, options, distortion)? };
        on_candidate(&candidate);
        let beyond = goal.beyond(&candidate, reserved);
        let here = [next, beyond];
        if beyond <= 0.0 {
            low = next;
        } else {
            high = next;
        }
        if goal.is_met(beyond) {
            // Of the candidates that meet the goal, the nearest to it is best.
            if best.as_ref().is_none_or(|(other, _)| beyond.abs() < other.abs()) {
                best = Some((beyond, candidate));
            }
            if beyond.abs() <= goal.slack() {
                break;
            }
        }
        if high - low <= MIN_INTERVAL {
            break;
        }
        // The secant method; at first, errors are taken to be proportional to losses. Outside of the interval, its
        // middle.
        let slope = before.map_or(std::f64::consts::LN_10, |[x, y]| (beyond - y) / (next - x));
        next += (goal.aim() - beyond) / slope;
        if !(low + 0.1 * MIN_INTERVAL..=high - 0.1 * MIN_INTERVAL).contains(&next) {
            next = 0.5 * (low + high);
        }
        before = Some(here);
    }
    Ok(best.map(|(_, candidate)| candidate))
}
