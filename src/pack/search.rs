//! Finding the loss that a user asked for.

use super::{Judge, Lossy, Sensitivity, lossy};
use crate::container::{EncodeOptions, Error, Limits, Metadata, decode_scene_file, encode_scene_file};
use crate::model::Scene;

/// What a file should be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Goal {
    /// The smallest whose pictures' mean squared error is at most `more` above `before`.
    Error {
        /// The error of the scene as it was: none where the judge's pictures are its own.
        before: f64,
        /// Positive.
        more: f64,
    },
    /// The best of at most this many bytes.
    Bytes(u64),
}

/// A scene, ready to be written, and what that does to it.
#[derive(Clone, Debug)]
pub struct Candidate {
    /// What is to be written.
    pub scene: Scene,
    /// How.
    pub options: EncodeOptions,
    /// What a reader gets.
    pub decoded: Scene,
    /// Bytes of the file without metadata, as `options` compress them.
    pub bytes: u64,
    /// The mean squared error of a reader's pictures to those of the scene as it was.
    pub error: f64,
}

/// log10 of the smallest and the largest loss that is tried.
const RANGE: [f64; 2] = [-17.0, -8.0];
/// Losses this near in log10 are taken to be the same.
const APART: f64 = 0.01;
/// The share of what the goal allows that a search may leave unused.
const UNUSED: f64 = 0.02;
/// The most losses that [`search`] tries.
pub const MAX_TRIED: usize = 12;
/// zstd's level where bytes decide nothing.
const QUICK_LEVEL: i32 = 1;

impl Candidate {
    /// What `options` make of `scene`, which `judge` knows as `pictured`.
    ///
    /// # Errors
    ///
    /// Where the scene cannot be encoded.
    pub fn new(scene: Scene, options: EncodeOptions, judge: &Judge) -> Result<Self, Error> {
        let bytes = encode_scene_file(&scene, &Metadata::default(), &options)?;
        let decoded = decode_scene_file(&bytes, Limits { memory: u64::MAX })?.scene;
        let error = judge.error(&decoded);
        Ok(Self { scene, options, decoded, bytes: bytes.len() as u64, error })
    }
}

impl Goal {
    /// How far `candidate` is from the goal, on a scale on which that is nearly linear in the logarithm of the loss and rises
    /// with it; 0 where it is just met.
    fn beyond(self, candidate: &Candidate, reserved: u64) -> f64 {
        match self {
            Self::Error { before, more } => ((candidate.error - before).max(0.0) / more).ln(),
            Self::Bytes(most) => (most as f64 / (candidate.bytes + reserved) as f64).ln(),
        }
    }

    /// Whether `beyond` is on the right side.
    fn is_met(self, beyond: f64) -> bool {
        match self {
            Self::Error { .. } => beyond <= 0.0,
            Self::Bytes(_) => beyond >= 0.0,
        }
    }

    /// Where to aim at, to meet it and leave little unused.
    fn aim(self) -> f64 {
        match self {
            Self::Error { .. } => -0.5 * UNUSED,
            Self::Bytes(_) => 0.5 * UNUSED,
        }
    }

    /// log10 of a loss to begin with.
    fn first_guess(self, scene: &Scene) -> f64 {
        match self {
            // A number whose steps cost this loss adds a twelfth of it.
            Self::Error { more, .. } => (12.0 * more / scene.parameter_count() as f64).log10(),
            Self::Bytes(_) => 0.5 * (RANGE[0] + RANGE[1]),
        }
    }
}

/// Chooses among all losses for `scene`, `reserved` bytes being wanted for metadata; `None` where even the largest loss misses
/// `goal`. `tried` hears of every candidate. Where the goal is an error, candidates are compressed in haste, as that changes no
/// number.
///
/// # Errors
///
/// Where the scene cannot be encoded.
pub fn search(
    scene: &Scene,
    sensitivity: &Sensitivity,
    judge: &Judge,
    goal: Goal,
    reserved: u64,
    tried: &mut dyn FnMut(&Candidate),
) -> Result<Option<Candidate>, Error> {
    let [mut low, mut high] = RANGE;
    let mut next = goal.first_guess(scene).clamp(low + APART, high - APART);
    let mut before: Option<[f64; 2]> = None;
    let mut best: Option<(f64, Candidate)> = None;
    for _ in 0..MAX_TRIED {
        let Lossy { scene, mut options, .. } = lossy(scene, sensitivity, 10f64.powf(next));
        if matches!(goal, Goal::Error { .. }) {
            options.zstd_level = Some(QUICK_LEVEL);
        }
        let candidate = Candidate::new(scene, options, judge)?;
        tried(&candidate);
        let beyond = goal.beyond(&candidate, reserved);
        let here = [next, beyond];
        if beyond <= 0.0 {
            low = next;
        } else {
            high = next;
        }
        if goal.is_met(beyond) {
            // What is nearer to the goal is better.
            if best.as_ref().is_none_or(|(other, _)| beyond.abs() < other.abs()) {
                best = Some((beyond, candidate));
            }
            if beyond.abs() <= UNUSED {
                break;
            }
        }
        if high - low <= APART {
            break;
        }
        // The secant's, or what errors that are in proportion to losses suggest; where that is out of the question, the middle.
        let slope = before.map_or(std::f64::consts::LN_10, |[x, y]| (beyond - y) / (next - x));
        next += (goal.aim() - beyond) / slope;
        if !(low + 0.1 * APART..=high - 0.1 * APART).contains(&next) {
            next = 0.5 * (low + high);
        }
        before = Some(here);
    }
    Ok(best.map(|(_, candidate)| candidate))
}
