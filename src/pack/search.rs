//! Finding the loss that a user asked for.

use super::{Judge, Lossy, Sensitivity, lossy};
use crate::container::{EncodeOptions, Error, Extras, Limits, decode_document, encode_document};
use crate::model::Scene;

/// What a file should be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Goal {
    /// The smallest whose pictures have at most this mean squared error to the scene's own.
    Error(f64),
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
    /// Bytes of the file without extras.
    pub bytes: u64,
    /// The mean squared error of a reader's pictures to those of the scene as it was.
    pub error: f64,
}

/// log10 of the smallest and the largest loss that is tried.
const RANGE: [f64; 2] = [-17.0, -8.0];
/// Halvings of that range: to a hundredth of a decade.
const HALVINGS: usize = 10;

impl Candidate {
    /// What `options` make of `scene`, which `judge` knows as `pictured`.
    ///
    /// # Errors
    ///
    /// Where the scene cannot be encoded.
    pub fn new(scene: Scene, options: EncodeOptions, judge: &Judge) -> Result<Self, Error> {
        let bytes = encode_document(&scene, &Extras::default(), &options)?;
        let decoded = decode_document(&bytes, Limits { memory: u64::MAX })?.scene;
        let error = judge.error(&decoded);
        Ok(Self { scene, options, decoded, bytes: bytes.len() as u64, error })
    }
}

/// Chooses among all losses for `scene`, `reserved` bytes being wanted for extras; `None` where even the largest loss misses
/// `goal`. `tried` hears of every candidate.
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
    let mut best = None;
    for _ in 0..HALVINGS {
        let middle = 0.5 * (low + high);
        let Lossy { scene, options, .. } = lossy(scene, sensitivity, 10f64.powf(middle));
        let candidate = Candidate::new(scene, options, judge)?;
        tried(&candidate);
        let (meets, may_lose_more) = match goal {
            Goal::Error(most) => (candidate.error <= most, candidate.error <= most),
            Goal::Bytes(most) => {
                let fits = candidate.bytes + reserved <= most;
                (fits, !fits)
            }
        };
        if meets {
            best = Some(candidate);
        }
        if may_lose_more { low = middle } else { high = middle }
    }
    Ok(best)
}
