//! Encoding with the fewest bytes for a given distortion.
//!
//! Each vector of a component is stored by its cosine transform with a quantization step of its own. With the
//! importance h of the vector's entries, an error of variance step²/12 adds h·step²/12 per entry to the mean squared
//! error of pictures, and one bit less per entry adds ln 2/6·h·step². A given distortion takes the fewest bytes if
//! h·step² is the same everywhere: that is `loss`. A component is dropped if its absence costs less than its bits.

use std::ops::Range;

use rayon::prelude::*;

use crate::container::{ArrayOptions, EncodeOptions, Encoding, FactorOptions, step, step_code};
use crate::model::{Factors, Scene};
use crate::train::FactorImportance;

/// A scene without the components that cost more bytes than they save error, and its encoding.
#[derive(Clone, Debug)]
pub struct Lossy {
    /// The scene to write.
    pub scene: Scene,
    /// The options to write it with.
    pub options: EncodeOptions,
    /// The estimated mean squared error of pictures.
    pub expected_error: f64,
    /// Share of components that were dropped, in \[0, 1\].
    pub dropped: f64,
}

/// Chooses the quantization steps at which h·step² is `loss` for every vector of `scene`, and drops components.
pub fn lossy(scene: &Scene, importance: &FactorImportance, loss: f64) -> Lossy {
    let mut scene = scene.clone();
    let mut options = EncodeOptions {
        density: Vec::new(),
        appearance: Vec::new(),
        networks: ArrayOptions::best(Encoding::F16),
        zstd_level: Some(19),
        ..EncodeOptions::default()
    };
    let (mut expected_error, mut dropped, mut all) = (0.0, 0u64, 0u64);
    for (s, scale) in scene.scales.iter_mut().enumerate() {
        let resolution = scale.cloud.resolution;
        let factors = &mut scale.factors;
        for (values, rank, h, scale_options) in [
            (&mut factors.density, factors.density_rank, &importance.density[s], &mut options.density),
            (&mut factors.appearance, factors.appearance_rank, &importance.appearance[s], &mut options.appearance),
        ] {
            let (rank, axes) = (rank as usize, Factors::axis_ranges(resolution));
            let tensor = Factors::rows(resolution) * rank;
            let choices: Vec<Choice> = (values.par_chunks_exact_mut(tensor).zip(h.par_chunks_exact(tensor)))
                .flat_map_iter(|(values, h)| {
                    (0..rank).map(|c| choose(values, h, rank, c, &axes, loss)).collect::<Vec<_>>()
                })
                .collect();
            let mut steps = Vec::with_capacity(3 * choices.len());
            for choice in choices {
                all += 1;
                dropped += u64::from(choice.is_dropped);
                expected_error += choice.error;
                steps.extend(choice.steps);
            }
            scale_options.push(FactorOptions { array: ArrayOptions::best(Encoding::Cosine), steps: Some(steps) });
        }
    }
    Lossy { scene, options, expected_error, dropped: dropped as f64 / all.max(1) as f64 }
}

/// The encoding of one component of a tensor.
struct Choice {
    is_dropped: bool,
    steps: [u8; 3],
    error: f64,
}

/// Chooses the steps of component `c` of a tensor, given its `values` and their importance `h`. Writes zeros if it is
/// dropped.
fn choose(
    values: &mut [f32],
    importance: &[f32],
    rank: usize,
    c: usize,
    axes: &[Range<usize>; 3],
    loss: f64,
) -> Choice {
    let mut steps = [0; 3];
    let (mut bits, mut coded, mut absent) = (0.0, 0.0, f64::INFINITY);
    for (a, axis) in axes.iter().enumerate() {
        let rows = axis.len();
        let of_axis = || axis.clone().map(|row| row * rank + c);
        let (mut total, mut squares, mut cost) = (0.0, 0.0, 0.0);
        for at in of_axis() {
            let (v, h) = (f64::from(values[at]), f64::from(importance[at]));
            total += h;
            squares += v * v;
            cost += h * v * v;
        }
        absent = absent.min(cost);
        let wanted = (loss * rows as f64 / total).sqrt();
        // Larger steps than this quantize every entry to zero, which loses no more.
        let largest = (squares / rows as f64).sqrt().max(f64::from(f32::MIN_POSITIVE));
        steps[a] = step_code(wanted.min(8.0 * largest) as f32).max(1);
        let step = f64::from(step(steps[a]));
        let ratio = squares / rows as f64 / (step * step / 12.0);
        bits += rows as f64 * 0.5 * (1.0 + ratio).log2() + 6.0;
        coded += total * (step * step / 12.0).min(squares / rows as f64);
    }
    let is_dropped = absent <= coded + std::f64::consts::LN_2 / 6.0 * loss * bits;
    if is_dropped {
        values.iter_mut().skip(c).step_by(rank).for_each(|v| *v = 0.0);
    }
    Choice { is_dropped, steps, error: if is_dropped { absent } else { coded } }
}
