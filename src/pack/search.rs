//! Finding the loss that a user asked for.

use super::{Judge, Lossy, Sensitivity, lossy};
use crate::container::{Document, Error, Extras, Limits, decode_document, encode_document};
use crate::model::Scene;

/// What a file should be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Goal {
    /// The smallest whose pictures have at most this mean squared error to the scene's own.
    Error(f64),
    /// The best of at most this many bytes.
    Bytes(u64),
}

/// A file that meets a goal.
#[derive(Clone, Debug)]
pub struct Packed {
    /// The file.
    pub bytes: Vec<u8>,
    /// What a reader gets from it.
    pub document: Document,
    /// The mean squared error of its pictures to those of the scene.
    pub error: f64,
    /// The loss that [`lossy`] was asked for.
    pub loss: f64,
}

/// log10 of the smallest and the largest loss that is tried.
const RANGE: [f64; 2] = [-17.0, -8.0];
/// Halvings of that range: to a hundredth of a decade.
const HALVINGS: usize = 10;

/// Encodes `scene` for `goal`; `None` where even the largest loss misses it. `tried` hears of every file.
///
/// # Errors
///
/// Where the scene cannot be encoded.
pub fn search(
    scene: &Scene,
    extras: &Extras,
    sensitivity: &Sensitivity,
    judge: &Judge,
    goal: Goal,
    tried: &mut dyn FnMut(&Packed),
) -> Result<Option<Packed>, Error> {
    let [mut low, mut high] = RANGE;
    let mut best: Option<Packed> = None;
    for _ in 0..HALVINGS {
        let middle = 0.5 * (low + high);
        let packed = pack(scene, extras, sensitivity, judge, 10f64.powf(middle))?;
        tried(&packed);
        let (meets, wants_more_loss) = match goal {
            Goal::Error(most) => (packed.error <= most, packed.error <= most),
            Goal::Bytes(most) => (packed.bytes.len() as u64 <= most, packed.bytes.len() as u64 > most),
        };
        if meets {
            best = Some(packed);
        }
        if wants_more_loss { low = middle } else { high = middle }
    }
    Ok(best)
}

/// The file of this loss.
///
/// # Errors
///
/// Where the scene cannot be encoded.
pub fn pack(
    scene: &Scene,
    extras: &Extras,
    sensitivity: &Sensitivity,
    judge: &Judge,
    loss: f64,
) -> Result<Packed, Error> {
    let Lossy { scene, options, .. } = lossy(scene, sensitivity, loss);
    let bytes = encode_document(&scene, extras, &options)?;
    let document = decode_document(&bytes, Limits { memory: u64::MAX })?;
    let error = judge.error(&document.scene);
    Ok(Packed { bytes, document, error, loss })
}
