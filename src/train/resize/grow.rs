//! More parameters where pictures' errors ask for them.
//!
//! A round gives one of these, none of which changes the field at once (the march's step is shorter where the coarsest scale gets
//! finer); which, a short training of each tells, by how far the error falls for each parameter:
//! - components of tensors, for a third of the parameters that there are. Every tensor is offered a few, each with two random vectors
//!   and one of zeros; those are kept along whose third vectors the photographs' error falls most steeply for the parameters
//!   that they hold;
//! - twice the resolution of a scale, or of all.
//!
//! It ends where there is no room, and where nothing helps.

use std::ops::Range;

use rayon::prelude::*;

use super::ranks::{drop_ranks, with_components};
use super::{BATCHES, RAYS, ResizeStep, Resized, Resizing, Tuning, Worth, resample};
use crate::dataset::View;
use crate::field::Field;
use crate::model::{Factors, Scale, Scene};
use crate::random::Random;
use crate::train::{Backward, BatchRoulette, RayBatch, RaySampler, TrainError, march_step};

/// How many times the parameters a round of components leads to.
const GROWN: f64 = 4.0 / 3.0;
/// Components of density, and of appearance, that every tensor is given to choose among.
const OFFERED: usize = 4;
/// The most cells along an axis.
const MAX_CELLS: u32 = 1024;
/// The standard deviation of their numbers: about that of trained ones.
const DEVIATION: f64 = 0.3;

/// Grows `scene`, which was trained on `views`, to at most `most` parameters. `stepped` hears of every training step, and ends
/// everything by an error. The same arguments always give the same result, on any number of threads. A scene that is as large
/// already stays as it is.
///
/// # Errors
///
/// Where no ray meets the scene, training diverges, or `stepped` says so.
pub fn grow<E: From<TrainError>>(
    scene: Scene,
    views: &[View],
    most: u64,
    tuning: &Tuning,
    stepped: &mut dyn FnMut(&ResizeStep) -> Result<(), E>,
) -> Result<Resized, E> {
    let mut resizing = Resizing::begin(&scene, views, tuning, stepped)?;
    let mut good = scene;
    loop {
        let held = good.nonzero_parameter_count();
        let next = most.min((GROWN * held as f64) as u64);
        let scales = good.scales.len();
        let mut ways = vec![with_more_components(&good, resizing.photographs(), next, &resizing.random())];
        ways.extend((0..scales).map(|s| finer(&good, s..s + 1, tuning.config.field.step_cells)));
        ways.extend((scales > 1).then(|| finer(&good, 0..scales, tuning.config.field.step_cells)));
        ways.retain(|larger| (held + 1..=most).contains(&larger.nonzero_parameter_count()));
        match resizing.round_of_best(&good, ways)? {
            Some(larger) => good = larger,
            None => break,
        }
    }
    resizing.finish(good)
}

/// `scene` with more components, and `most` parameters at most where that are not fewer than it has.
fn with_more_components(scene: &Scene, photographs: &RaySampler<'_>, most: u64, random: &Random) -> Scene {
    let mut larger = scene.clone();
    let old: Vec<[usize; 2]> =
        scene.scales.iter().map(|s| [s.factors.density_rank as usize, s.factors.appearance_rank as usize]).collect();
    for (s, scale) in larger.scales.iter_mut().enumerate() {
        offer(scale, &random.substream(3).substream(s as u64));
    }
    let worth = worth(&larger, &old, photographs, random);
    worth.least(&larger, most).clear(&mut larger);
    drop_ranks(&mut larger);
    larger
}

/// `scene` with twice the resolution of `scales`, and steps of the march as short as the coarsest scale then asks for.
fn finer(scene: &Scene, scales: Range<usize>, step_cells: f64) -> Scene {
    let mut scene = scene.clone();
    for scale in &mut scene.scales[scales] {
        let to = scale.cloud.resolution.map(|cells| if cells > MAX_CELLS / 2 { cells } else { 2 * cells });
        resample(scale, to);
    }
    scene.rules.step = scene.rules.step.min(march_step(&scene.scales[0].cloud, step_cells));
    scene
}

/// Gives all tensors of `scale` components that change nothing yet.
fn offer(scale: &mut Scale, random: &Random) {
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
        let new = old + OFFERED;
        let kept: Vec<usize> = (0..old).collect();
        *values = with_components(values, rows, old, new, |_| &kept);
        let random = random.substream(part as u64);
        values.par_chunks_mut(rows * new).enumerate().for_each(|(n, tensor)| {
            for (row, numbers) in tensor.chunks_exact_mut(new).enumerate().filter(|(row, _)| !third.contains(row)) {
                for (c, number) in numbers[old..].iter_mut().enumerate() {
                    *number = (DEVIATION * random.normal(((n * rows + row) * OFFERED + c) as u64)) as f32;
                }
            }
        });
        *rank = new as u32;
    }
    let matrix = &mut scale.appearance_matrix;
    let old = matrix.rank as usize;
    let random = random.substream(2);
    let bound = 1.0 / ((old + OFFERED) as f64).sqrt();
    let offered = |p: usize| {
        let random = random.substream(p as u64);
        (0..OFFERED as u64).map(move |c| (bound * (2.0 * random.uniform(c) - 1.0)) as f32)
    };
    matrix.weights = (matrix.weights.chunks_exact(old).enumerate())
        .flat_map(|(p, row)| row.iter().copied().chain(offered(p)))
        .collect();
    matrix.rank += OFFERED as u32;
}

/// How steeply the photographs' error falls along the third vector of the components that `scene` has beyond the `old` ranks:
/// the squared length of its gradient. Others are beyond price.
fn worth(scene: &Scene, old: &[[usize; 2]], photographs: &RaySampler<'_>, random: &Random) -> Worth {
    let field = Field::new(scene);
    let mut backward = Backward::new(&field);
    let mut sums: Vec<[Vec<f32>; 2]> =
        field.scales.iter().map(|s| [vec![0.0; s.density.len()], vec![0.0; s.appearance.len()]]).collect();
    let count = photographs.kept_count().min(RAYS);
    for n in 0..BATCHES {
        let batch = RayBatch::draw(photographs, &field, &random.substream(0), n * count as u64, count);
        let gradients = backward.gradients(&field, &batch.rays, &batch.targets, BatchRoulette::default());
        for ((sums, density), appearance) in sums.iter_mut().zip(gradients.density).zip(gradients.appearance) {
            for (sums, gradients) in sums.iter_mut().zip([density, appearance]) {
                sums.par_iter_mut().zip(gradients).for_each(|(sum, g)| *sum += g / BATCHES as f32);
            }
        }
    }
    let mut worth = Worth::nothing(scene);
    for (((scale, worth), sums), old) in scene.scales.iter().zip(&mut worth.scales).zip(&sums).zip(old) {
        let rows = Factors::rows(scale.cloud.resolution);
        let third = Factors::axis_ranges(scale.cloud.resolution)[2].clone();
        for ((worth, sums), &old) in worth.iter_mut().zip(sums).zip(old) {
            let rank = old + OFFERED;
            worth.par_chunks_mut(rank).zip(sums.par_chunks(rows * rank)).for_each(|(worth, gradient)| {
                worth[..old].fill(f64::INFINITY);
                for (c, worth) in worth.iter_mut().enumerate().skip(old) {
                    *worth = third.clone().map(|row| f64::from(gradient[row * rank + c]).powi(2)).sum();
                }
            });
        }
    }
    worth
}
