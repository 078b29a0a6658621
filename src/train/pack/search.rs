//! Search for the loss parameter that meets a bound on distortion or bytes.

use std::ops::Range;

use super::occupancy::without_gaps;
use super::{Lossy, ReferencePictures, lossy};
use crate::FactorImportance;
use strivec_format::container::{
    EncodeOptions, Error, Limits, Metadata, decode_scene_file, encode_scene_file, sections,
};
use strivec_format::model::{Scale, Scene};

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
    /// Where the first scale is in it.
    pub first_scale: Range<u64>,
    /// The mean squared error of the pictures of `decoded`.
    pub error: f64,
    /// The loss of [`lossy()`] that it comes from; 0 if it comes from another encoding.
    pub loss: f64,
}

/// log₁₀ of the smallest and the largest loss that is tried.
const RANGE: [f64; 2] = [-17.0, -8.0];
/// The search ends if the interval of log₁₀ losses is no longer than this.
const MIN_INTERVAL: f64 = 0.002;
/// The search ends if a candidate leaves at most this share of an error, or of bytes, unused.
const ERROR_SLACK: f64 = 0.02;
const BYTES_SLACK: f64 = 0.003;
/// The most losses that are tried for one set of steps.
const MAX_LOSSES: usize = 12;
/// The most candidates of a [`search`].
pub const MAX_TRIED: usize = 2 * MAX_LOSSES;
/// The most of a file of a given size that the first scale and what precedes it may take, so that it shows soon. Views and
/// its correction come to that, less than a hundredth.
const FIRST_SCALE: f64 = 0.39;
/// The most of its own bytes that the first scale gives up for that. Where it would have to give up more, what precedes it is
/// large.
const MOST_OF_FIRST: f64 = 0.3;
/// The zstd level if the number of bytes does not matter.
const QUICK_LEVEL: i32 = 1;

impl Candidate {
    /// A `scene` that readers decode as `decoded`, in a file of so many `bytes`, of which nothing else is known.
    pub fn unmeasured(scene: Scene, decoded: Scene, options: EncodeOptions, bytes: u64) -> Self {
        Self { scene, options, decoded, bytes, first_scale: 0..0, error: 0.0, loss: 0.0 }
    }

    /// Encodes and decodes `scene` with `options` and measures the result.
    ///
    /// # Errors
    ///
    /// If the scene cannot be encoded.
    pub fn new(scene: Scene, options: EncodeOptions, distortion: &ReferencePictures) -> Result<Self, Error> {
        let bytes = encode_scene_file(&scene, &Metadata::default(), &options)?;
        let decoded = decode_scene_file(&bytes, Limits { memory: u64::MAX })?.scene;
        let error = distortion.mse(&decoded);
        let sections = sections(&bytes)?.sections;
        let mut of_first = sections.iter().filter(|s| s.scale == Some(0)).map(|s| s.offset..s.offset + s.length);
        let first = of_first.next().unwrap_or_default();
        let first_scale = first.start..of_first.next_back().unwrap_or(first).end;
        Ok(Self { scene, options, decoded, bytes: bytes.len() as u64, first_scale, error, loss: 0.0 })
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
/// the gaps of its occupancy, and with coarser steps of the first scale if it takes more than two fifths of the file. Returns
/// `None` if even the largest loss misses the goal. `on_candidate` is called with every candidate. If the goal is an error,
/// candidates are compressed at a low level: compression does not change the error.
///
/// # Errors
///
/// If the scene cannot be encoded.
pub fn search(
    scene: &Scene,
    importance: &FactorImportance,
    distortion: &ReferencePictures,
    goal: Goal,
    reserved: u64,
    on_candidate: &mut dyn FnMut(&Candidate),
) -> Result<Option<Candidate>, Error> {
    let simpler = matches!(goal, Goal::Bytes(_)).then(|| without_gaps(scene));
    let scene = simpler.as_ref().unwrap_or(scene);
    let mut search = |guess: f64, of_first: f64| {
        let mut candidate_of = |loss: f64| {
            let Lossy { scene, mut options, .. } = lossy(scene, importance, loss, of_first);
            if matches!(goal, Goal::Error { .. }) {
                options.zstd_level = Some(QUICK_LEVEL);
            }
            let candidate = Candidate { loss, ..Candidate::new(scene, options, distortion)? };
            on_candidate(&candidate);
            Ok(candidate)
        };
        search_loss(&mut candidate_of, goal, reserved, guess)
    };
    let Some(found) = search(goal.first_guess(scene), 1.0)? else { return Ok(None) };
    let of_first = if matches!(goal, Goal::Bytes(_)) { loss_of_first(&found, reserved) } else { 1.0 };
    if of_first <= 1.0 {
        return Ok(Some(found));
    }
    Ok(search(found.loss.log10(), of_first)?.or(Some(found)))
}

/// The loss of the first scale, relative to that of the others, at which it takes at most [`FIRST_SCALE`] of a file of as many
/// bytes as `found`, for which it is 1. At least 1, and 1 where that takes too much from it.
///
/// A number takes half a bit less if its loss doubles. What the first scale gives up, the others take.
fn loss_of_first(found: &Candidate, reserved: u64) -> f64 {
    let numbers = |scales: &[Scale]| scales.iter().map(Scale::nonzero_parameter_count).sum::<u64>() as f64;
    let (first, others) = found.scene.scales.split_at(1);
    let Range { start, end } = found.first_scale;
    let excess = end as f64 - FIRST_SCALE * (found.bytes + reserved) as f64;
    if others.is_empty() || excess <= 0.0 || excess > MOST_OF_FIRST * (end - start) as f64 {
        return 1.0;
    }
    (16.0 * excess * (1.0 / numbers(first) + 1.0 / numbers(others))).exp2()
}

/// The candidate of the loss that meets `goal` best; log₁₀ of the first one that is tried is `guess`.
fn search_loss(
    candidate_of: &mut dyn FnMut(f64) -> Result<Candidate, Error>,
    goal: Goal,
    reserved: u64,
    guess: f64,
) -> Result<Option<Candidate>, Error> {
    let [mut low, mut high] = RANGE;
    let mut next = guess.clamp(low + MIN_INTERVAL, high - MIN_INTERVAL);
    let mut before: Option<[f64; 2]> = None;
    let mut best: Option<(f64, Candidate)> = None;
    for _ in 0..MAX_LOSSES {
        let candidate = candidate_of(10f64.powf(next))?;
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

#[cfg(test)]
mod tests {
    use super::*;
    use strivec_format::container::decode;

    #[test]
    fn a_large_first_scale_gives_up_bits_but_not_for_what_precedes_it() {
        let two_scales = include_bytes!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../fixtures/v1/residual.strivec"));
        let scene = decode(two_scales).unwrap();
        let numbers: Vec<f64> = scene.scales.iter().map(|scale| scale.nonzero_parameter_count() as f64).collect();
        let of_first = |first_scale: Range<u64>| {
            let candidate = Candidate::unmeasured(scene.clone(), scene.clone(), EncodeOptions::default(), 900);
            loss_of_first(&Candidate { first_scale, ..candidate }, 100)
        };
        assert_eq!(of_first(50..390), 1.0);
        // 10 bytes less for the first scale's numbers and 10 more for the others.
        let bits = 80.0 / numbers[0] + 80.0 / numbers[1];
        assert!((of_first(50..400).log2() - 2.0 * bits).abs() < 1e-9);
        assert_eq!(of_first(500..600), 1.0, "even nothing would be too much");

        let mut one = scene.clone();
        one.scales.truncate(1);
        let candidate = Candidate::unmeasured(one.clone(), one, EncodeOptions::default(), 900);
        assert_eq!(loss_of_first(&Candidate { first_scale: 50..400, ..candidate }, 100), 1.0);
    }
}
