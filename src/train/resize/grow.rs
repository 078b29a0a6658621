//! Growing: more parameters where they reduce the error of pictures most.
//!
//! A round makes one of these changes. None of them changes the field at once, except that the march's step gets
//! shorter with the cells of the coarsest scale. A short training of each finds the change that reduces the error most
//! per parameter:
//! - more components, for a third more parameters. Every tensor gets a few new ones, with two random vectors and one of
//!   zeros. Those are kept that have the steepest descent of the photographs' error along the third vector, per
//!   parameter;
//! - twice the resolution of a scale, or of all scales.
//!
//! Growing ends if the bound leaves no room, or if no change reduces the error.

use std::ops::Range;

use rayon::prelude::*;

use super::ranks::{drop_ranks, with_components};
use super::{ResizeStep, Resized, Resizing, Tuning, resample};
use crate::dataset::View;
use crate::model::{Factors, Scale, Scene};
use crate::random::Random;
use crate::train::importance::ComponentImportance;
use crate::train::{RaySampler, TrainError, march_step};

/// Ratio of the parameters after a round of components to those before.
const GROWTH: f64 = 4.0 / 3.0;
/// Number of new density components, and of new appearance components, that every tensor gets before the selection.
const NEW_COMPONENTS: usize = 4;
/// The most cells along an axis.
const MAX_CELLS: u32 = 1024;
/// Standard deviation of the entries of new vectors: about that of trained ones.
const DEVIATION: f64 = 0.3;

/// Grows `scene`, which was trained on `views`, to at most `max_parameters`. `on_step` is called after each training
/// step; an error that it returns ends the run. The same arguments always give the same result, on any number of
/// threads. A scene that is as large already stays as it is.
///
/// # Errors
///
/// If no ray passes through the scene, training diverges, or `on_step` returns an error.
pub fn grow<E: From<TrainError>>(
    scene: Scene,
    views: &[View],
    max_parameters: u64,
    tuning: &Tuning,
    on_step: &mut dyn FnMut(&ResizeStep) -> Result<(), E>,
) -> Result<Resized, E> {
    let mut resizing = Resizing::begin(&scene, views, tuning, on_step)?;
    let mut good = scene;
    loop {
        let parameters = good.nonzero_parameter_count();
        let next = max_parameters.min((GROWTH * parameters as f64) as u64);
        let scales = good.scales.len();
        let mut candidates = vec![with_more_components(&good, resizing.sampler(), next, &resizing.random())];
        candidates.extend((0..scales).map(|s| finer(&good, s..s + 1, tuning.config.field.step_cells)));
        candidates.extend((scales > 1).then(|| finer(&good, 0..scales, tuning.config.field.step_cells)));
        candidates.retain(|larger| (parameters + 1..=max_parameters).contains(&larger.nonzero_parameter_count()));
        match resizing.round_of_best(&good, candidates)? {
            Some(larger) => good = larger,
            None => break,
        }
    }
    resizing.finish(good)
}

/// `scene` with more components: at most `max_parameters`, or as many as it has if these are more.
fn with_more_components(scene: &Scene, sampler: &RaySampler<'_>, max_parameters: u64, random: &Random) -> Scene {
    let mut larger = scene.clone();
    let old_ranks: Vec<[usize; 2]> =
        scene.scales.iter().map(|s| [s.factors.density_rank as usize, s.factors.appearance_rank as usize]).collect();
    for (s, scale) in larger.scales.iter_mut().enumerate() {
        add_components(scale, &random.substream(3).substream(s as u64));
    }
    let importance = ComponentImportance::of_addition(&larger, &old_ranks, sampler, random);
    importance.least_important(&larger, max_parameters).apply(&mut larger);
    drop_ranks(&mut larger);
    larger
}

/// `scene` with twice the resolution of `scales`, and the march's step of the resolution that the coarsest scale then
/// has.
fn finer(scene: &Scene, scales: Range<usize>, step_cells: f64) -> Scene {
    let mut scene = scene.clone();
    for scale in &mut scene.scales[scales] {
        let to = scale.cloud.resolution.map(|cells| if cells > MAX_CELLS / 2 { cells } else { 2 * cells });
        resample(scale, to);
    }
    scene.rules.step = scene.rules.step.min(march_step(&scene.scales[0].cloud, step_cells));
    scene
}

/// Adds [`NEW_COMPONENTS`] components to all tensors of `scale`. Their third vectors are zeros, so pictures stay the
/// same.
fn add_components(scale: &mut Scale, random: &Random) {
    let resolution = scale.cloud.resolution;
    let rows = Factors::rows(resolution);
    let third = Factors::axis_ranges(resolution)[2].clone();
    let factors = &mut scale.factors;
    for (part, (values, rank)) in
        [(&mut factors.density, &mut factors.density_rank), (&mut factors.appearance, &mut factors.appearance_rank)]
            .into_iter()
            .enumerate()
    {
        let old = *rank as usize;
        let new = old + NEW_COMPONENTS;
        let kept: Vec<usize> = (0..old).collect();
        *values = with_components(values, rows, old, new, |_| &kept);
        let random = random.substream(part as u64);
        values.par_chunks_mut(rows * new).enumerate().for_each(|(n, tensor)| {
            for (row, numbers) in tensor.chunks_exact_mut(new).enumerate().filter(|(row, _)| !third.contains(row)) {
                for (c, number) in numbers[old..].iter_mut().enumerate() {
                    *number = (DEVIATION * random.normal(((n * rows + row) * NEW_COMPONENTS + c) as u64)) as f32;
                }
            }
        });
        *rank = new as u32;
    }
    let matrix = &mut scale.appearance_matrix;
    let old = matrix.rank as usize;
    let random = random.substream(2);
    let bound = 1.0 / ((old + NEW_COMPONENTS) as f64).sqrt();
    let offered = |p: usize| {
        let random = random.substream(p as u64);
        (0..NEW_COMPONENTS as u64).map(move |c| (bound * (2.0 * random.uniform(c) - 1.0)) as f32)
    };
    matrix.weights = (matrix.weights.chunks_exact(old).enumerate())
        .flat_map(|(p, row)| row.iter().copied().chain(offered(p)))
        .collect();
    matrix.rank += NEW_COMPONENTS as u32;
}
