//! Encoding with the fewest bytes for a given distortion.
//!
//! The numbers of a component are integers times one step. With the importance h of its entries, errors of variance step²/12
//! add h·step²/12 per entry to the mean squared error of pictures, and one bit less per entry adds ln 2/6·h·step². A given
//! distortion takes the fewest bytes if h·step² is the same everywhere: that is `loss`. A component's factors are scaled
//! first, which does not change their product, so that entries of all of them are equally important: then one step is right
//! for all. A component is dropped if its absence costs no more than its integers would: absences add up, so that more would
//! cost pictures more than it saves bytes.

use std::ops::Range;

use rayon::prelude::*;

use super::balance::{entries, scale_factors};
use crate::{BlockImportance, FactorImportance, NETWORK_BITS};
use strivec_format::container::{ArrayOptions, EncodeOptions, Encoding, FactorOptions, step, step_code};
use strivec_format::model::Scene;

/// Bits of a factor's integer, at most; what they take in a file depends on the steps.
const BITS: u8 = 16;
/// The most steps of a number: half of what its bits allow, so that training may still move it.
const MOST_STEPS: f64 = 16_384.0;

/// A scene without the components that are not worth their bytes, and its encoding.
#[derive(Clone, Debug)]
pub struct Lossy {
    /// The scene to write.
    pub scene: Scene,
    /// The options to write it with.
    pub options: EncodeOptions,
}

/// Chooses the quantization steps at which h·step² is `loss` for every component of `scene`, `of_first` times that for those of
/// the first scale, scales their factors, and drops components.
pub fn lossy(scene: &Scene, importance: &FactorImportance, loss: f64, of_first: f64) -> Lossy {
    let mut scene = scene.clone();
    let mut codes = Vec::new();
    for (s, scale) in scene.scales.iter_mut().enumerate() {
        let loss = if s == 0 { of_first * loss } else { loss };
        let resolution = scale.cloud.resolution;
        let mut of_scale = Vec::new();
        for (block, importance) in scale.factors.blocks_mut().zip(&importance.scales[s]) {
            let (rank, factors) = (block.rank as usize, block.form.factors(resolution));
            let tensor = block.tensor_len(resolution);
            let BlockImportance { entries: of_entries, components } = importance;
            let importance = of_entries.par_chunks_exact(tensor).zip(components.par_chunks_exact(rank));
            let steps: Vec<u8> = (block.values.par_chunks_exact_mut(tensor).zip(importance))
                .flat_map_iter(|(values, (importance, absent))| {
                    let choose = |c: usize| choose(values, importance, absent[c], rank, c, &factors, loss);
                    (0..rank).map(choose).collect::<Vec<_>>()
                })
                .collect();
            of_scale.push(steps);
        }
        let of_appearance = of_scale.split_off(scale.factors.density.len());
        codes.push([of_scale, of_appearance]);
    }
    Lossy { scene, options: options_of(codes) }
}

/// The encoding in which density and appearance have \[scale\]\[block\]\[tensor\]\[component\] steps of these codes.
pub(super) fn options_of(codes: Vec<[Vec<Vec<u8>>; 2]>) -> EncodeOptions {
    let of_scale = |steps| FactorOptions { array: ArrayOptions::best(Encoding::Grid(BITS)), steps: Some(steps) };
    let (density, appearance) = codes.into_iter().map(|codes| codes.map(of_scale).into()).unzip();
    EncodeOptions {
        density,
        appearance,
        networks: ArrayOptions::best(Encoding::Grid(NETWORK_BITS)),
        zstd_level: Some(19),
        ..EncodeOptions::default()
    }
}

/// Chooses the step of component `c` of a tensor and scales its `factors`, given its `values`, their `importance`, and what it
/// costs if the component is `absent`. Writes zeros if it is dropped.
fn choose(
    values: &mut [f32],
    importance: &[f32],
    absent: f64,
    rank: usize,
    c: usize,
    factors: &[Range<usize>],
    loss: f64,
) -> u8 {
    // √ of the mean importance of a factor's entries.
    let size = |rows: &Range<usize>| {
        let total: f64 = entries(rows, rank, c).map(|at| f64::from(importance[at])).sum();
        (total / rows.len() as f64).sqrt()
    };
    let sizes: Vec<f64> = factors.iter().map(size).collect();
    if absent <= 0.0 || sizes.contains(&0.0) {
        values.iter_mut().skip(c).step_by(rank).for_each(|v| *v = 0.0);
        return 0;
    }
    let size = scale_factors(values, rank, c, factors, &sizes);
    let square = |rows: &Range<usize>| entries(rows, rank, c).map(|at| f64::from(values[at]).powi(2)).sum::<f64>();
    let squares: Vec<f64> = factors.iter().map(square).collect();
    let rows = factors.iter().map(Range::len).sum::<usize>() as f64;
    // Larger steps than this quantize every entry to zero, which loses no more.
    let largest = (squares.iter().sum::<f64>() / rows).sqrt().max(f64::from(f32::MIN_POSITIVE));
    let peak = factors
        .iter()
        .flat_map(|rows| entries(rows, rank, c))
        .map(|at| f64::from(values[at].abs()))
        .fold(0.0, f64::max);
    let code = step_code((loss.sqrt() / size).min(8.0 * largest).max(peak / MOST_STEPS) as f32).max(1);
    let step = f64::from(step(code));
    let of_factor = |(rows, squares): (&Range<usize>, f64)| (rows.len() as f64 * step * step / 12.0).min(squares);
    let coded = size * size * factors.iter().zip(squares).map(of_factor).sum::<f64>();
    if absent <= coded {
        values.iter_mut().skip(c).step_by(rank).for_each(|v| *v = 0.0);
    }
    code
}
