//! Training a scene for a file of a given size.
//!
//! The steps of components come from the search of [`mod@super::search`], for a file a little larger than the goal.
//! Then the scene is trained with rounded factors, at last with rounded matrices and decoder too, and what a bit costs
//! in the loss is steered so that the file reaches its goal.

use super::lossy::options_of;
use super::{Candidate, Goal, ReferencePictures, search};
use crate::{FactorImportance, Rounding, Trainer};
use strivec_format::container::{EncodeOptions, Error, FactorOptions, Metadata, encode_scene_file};
use strivec_format::model::{Scale, Scene};

/// The file at the start, in goals. Training takes bytes away: with the loss of a bit below, up to a tenth.
const START: f64 = 1.03;
/// The loss of a bit at the start, relative to that at which a coarser step would be as good. Larger ones also keep training
/// from fitting the training views alone; from 20 to 160, pictures of other views are equally good for their bytes.
const BIT: f64 = 60.0;
/// Number of times that the loss of a bit is corrected.
const CORRECTIONS: u64 = 32;
/// The share of the steps after which the file should have reached its goal, and the part of the goal that is aimed at.
const REACHED: f64 = 0.8;
const AIM: f64 = 0.99;
/// The exponent of a correction: bits follow their loss slowly.
const GAIN: f64 = 6.0;
/// The largest correction at once, and of all together: larger losses of bits spoil pictures.
const LARGEST: f64 = 2.0;
const LARGEST_IN_ALL: f64 = 8.0;

/// Begins the last `steps` of `trainer` with `scene`, of the same photographs: for a file of at most `goal` bytes without
/// metadata. Returns false if no encoding of the scene is so small. `tried` is called with every candidate for the start.
///
/// # Errors
///
/// If the scene cannot be encoded.
pub fn begin_for_size(
    trainer: &mut Trainer<'_>,
    scene: &Scene,
    importance: &FactorImportance,
    goal: u64,
    steps: u64,
    tried: &mut dyn FnMut(&Candidate),
) -> Result<bool, Error> {
    let start = Goal::Bytes((START * goal as f64) as u64);
    let Some(candidate) = search(scene, importance, &ReferencePictures::of_nothing(), start, 0, tried)? else {
        return Ok(false);
    };
    let Candidate { scene, options, bytes, loss, .. } = candidate;
    let of_scale = |(density, appearance): (&FactorOptions, &FactorOptions)| {
        [density, appearance].into_iter().flat_map(|part| part.steps.iter().flatten().cloned()).collect()
    };
    let codes: Vec<Vec<Vec<u8>>> = options.density.iter().zip(&options.appearance).map(of_scale).collect();
    // A step costs loss/12 for each number; another one that is a bit coarser, ln 2/6 of the loss more.
    let bit = BIT * std::f64::consts::LN_2 / 6.0 * loss;
    trainer.begin_rounding(scene, &codes, bit, [bytes, goal], steps);
    Ok(true)
}

/// Corrects the loss of a bit after a step of `trainer`, if one is due.
///
/// # Errors
///
/// If the scene cannot be encoded.
pub fn steer_to_size(trainer: &mut Trainer<'_>) -> Result<(), Error> {
    let (step, steps) = (trainer.steps_done(), trainer.config().schedule.steps);
    let Some(&Rounding { start, goal, .. }) = trainer.rounding() else { return Ok(()) };
    if !step.is_multiple_of((steps / CORRECTIONS).max(1)) || step == steps {
        return Ok(());
    }
    let (scene, options) = rounded(trainer);
    let bytes = size(&scene, &options)? as f64;
    let along = (step as f64 / (REACHED * steps as f64)).min(1.0);
    let expected = start as f64 + along * (AIM * goal as f64 - start as f64);
    let correction = (bytes / expected).powf(GAIN).clamp(1.0 / LARGEST, LARGEST);
    if let Some(rounding) = trainer.rounding_mut() {
        let first = rounding.first_bit;
        rounding.bit = (correction * rounding.bit).clamp(first / LARGEST_IN_ALL, first * LARGEST_IN_ALL);
    }
    Ok(())
}

/// The rounded scene of `trainer`, and its encoding.
fn rounded(trainer: &Trainer<'_>) -> (Scene, EncodeOptions) {
    let scene = trainer.scene();
    let of_scale = |(mut codes, scale): (Vec<Vec<u8>>, &Scale)| {
        let of_appearance = codes.split_off(scale.factors.density.len());
        [codes, of_appearance]
    };
    let codes = trainer.step_codes().into_iter().zip(&scene.scales).map(of_scale).collect();
    let options = EncodeOptions { network_steps: trainer.network_steps(), ..options_of(codes) };
    (scene, options)
}

/// The scene of `trainer` and its encoding, of at most `most` bytes without metadata: its rounded factors; if their file is
/// larger, its unrounded ones with coarser steps. `None` if no encoding is so small.
///
/// # Errors
///
/// If the scene cannot be encoded.
pub fn rounded_to_size(
    trainer: &Trainer<'_>,
    importance: impl FnOnce(&Scene) -> FactorImportance,
    most: u64,
) -> Result<Option<(Scene, EncodeOptions)>, Error> {
    let (scene, options) = rounded(trainer);
    if size(&scene, &options)? <= most {
        return Ok(Some((scene, options)));
    }
    let scene = trainer.unrounded_scene();
    let found = search(
        &scene,
        &importance(&scene),
        &ReferencePictures::of_nothing(),
        Goal::Bytes(most),
        0,
        &mut |_: &Candidate| {},
    )?;
    Ok(found.map(|candidate| (candidate.scene, candidate.options)))
}

/// Bytes of the file of `scene`, encoded by `options`, without metadata.
///
/// # Errors
///
/// If the scene cannot be encoded.
pub fn size(scene: &Scene, options: &EncodeOptions) -> Result<u64, Error> {
    Ok(encode_scene_file(scene, &Metadata::default(), options)?.len() as u64)
}
