//! FLOP and bytes of each stage, from what was counted: the one place of these formulas.
//!
//! An addition, multiplication, division, square root, minimum or maximum counts one FLOP, a fused multiply-add two,
//! comparisons and rounding none, and [`TRANSCENDENTAL`] and [`SINE_COSINE`] what their names say. Bytes are those that
//! a kernel's loads and stores touch once each, in single precision; caches may serve them. Left out are scratch that
//! does not outlive a kernel, shared weights and the sums of their gradients, which stay in the caches, and what the
//! counts cannot tell: candidates that do not cover a sample, positions that the march passes over, a frame's depths.

use serde::Serialize;

use crate::field::{Field, Real, Stage, Work};
use crate::model::DecoderMode;
use crate::train::RAYS_PER_CHUNK;

/// exp, ln(1 + x), exp − 1: about the additions and multiplications of a polynomial and its range reduction.
const TRANSCENDENTAL: f64 = 10.0;
/// A sine and a cosine together, counted in `field::Real::sine_cosine` of f32.
const SINE_COSINE: f64 = 30.0;
/// Bytes of a single-precision number, and of a tensor's or a sample's number.
const WORD: f64 = 4.0;
/// Offset from the center (3), then u = (offset + half)·cells a unit and its fraction on each axis (3·3).
const INTERPOLATION: f64 = 12.0;
/// Words of a `field::Contribution`, of a `field::InterpolationSite` and of a `train::pairs::TensorPair`.
const PAIR: f64 = 2.0;
const LOCATED: f64 = 8.0;
const TENSOR_PAIR: f64 = 3.0;

/// What a stage did.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Cost {
    /// Floating-point operations.
    pub flop: f64,
    /// Bytes that loads and stores touch.
    pub bytes: f64,
}

impl Cost {
    fn plus(self, other: Self) -> Self {
        Self { flop: self.flop + other.flop, bytes: self.bytes + other.bytes }
    }
}

/// What the costs of a field depend on besides the counts.
#[derive(Clone, Debug, PartialEq)]
pub struct FieldShape {
    /// Coarsest first.
    pub scales: Vec<ScaleShape>,
    /// P.
    pub features: usize,
    /// Frequencies of PE(features) and of PE(direction).
    pub frequencies: [usize; 2],
    /// \[layer\] inputs and outputs.
    pub layers: Vec<[usize; 2]>,
    /// Where the decoder is called.
    pub mode: DecoderMode,
    /// Columns of the first layer whose gradient is needed: all but the encoded direction.
    pub first_layer_columns: usize,
}

/// One scale of a [`FieldShape`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ScaleShape {
    /// How many.
    pub tensors: usize,
    /// Rows (vertices of all three axes) of a tensor.
    pub rows: usize,
    /// Density components.
    pub density_rank: usize,
    /// Appearance components.
    pub appearance_rank: usize,
}

impl FieldShape {
    /// Of `field`.
    pub fn of<T: Real>(field: &Field<T>) -> Self {
        let scales = (field.scales.iter())
            .map(|s| ScaleShape {
                tensors: s.len(),
                rows: s.rows().count,
                density_rank: s.density_rank,
                appearance_rank: s.appearance_rank,
            })
            .collect();
        Self {
            scales,
            features: field.decoder.features,
            frequencies: field.decoder.frequencies.map(|f| f as usize),
            layers: field.decoder.layers.iter().map(|l| [l.inputs, l.outputs]).collect(),
            mode: field.decoder.mode,
            first_layer_columns: field.decoder.input_parts()[2],
        }
    }

    /// What `stage` did in `runs` steps or frames, by the counts of all of them together.
    pub fn cost(&self, stage: Stage, work: &Work, runs: usize) -> Cost {
        let [rays, evaluated, samples, colored, decoded] =
            [work.rays, work.evaluated, work.samples, work.shaded, work.decoded].map(|n| n as f64);
        let pairs = work.contributions.iter().sum::<u64>() as f64;
        let colored_pairs = work.shaded_contributions.iter().sum::<u64>() as f64;
        // Those of samples that count: samples are taken to have as many pairs behind a ray's end as before it.
        let counted = if evaluated > 0.0 { samples / evaluated } else { 0.0 };
        let scales = self.scales.len() as f64;
        let features = self.features as f64;
        let components = self.scales.iter().map(|s| s.appearance_rank).sum::<usize>() as f64;
        let inputs = self.layers.first().map_or(0, |l| l[0]) as f64;
        // Where rays are decoded, each colored sample's components are composited.
        let [composited_samples, composites] =
            if self.mode == DecoderMode::PerSample { [0.0; 2] } else { [colored, decoded * components] };
        let composited = composited_samples * components;
        // Colors that pixels are summed from, and those of them that add a sample's own to its ray's.
        let [terms, own] = if self.mode == DecoderMode::Residual { [colored; 2] } else { [decoded, 0.0] };
        let tensors = self.scales.iter().map(|s| s.tensors).sum::<usize>() as f64;
        let tensors_by_chunk = tensors * (rays / RAYS_PER_CHUNK as f64).ceil();
        let cost = |flop: f64, words: f64| Cost { flop, bytes: words * WORD };
        match stage {
            // Nothing but random bits, cameras and sorting: a ray of 6 doubles and its color of 3 floats are written,
            // and moved once into the order of space.
            Stage::Rays => cost(0.0, rays * 2.0 * (6.0 * 2.0 + 3.0)),
            // t (2), o + t·d (3·2), relative to the origin (3). Writes distance and position.
            Stage::March => cost(evaluated * 11.0, evaluated * 4.0),
            // A neighbor: offset (3) and its square (6), root, reciprocal, their sum and the product with the weights'
            // scale (4), and u, its fraction and the last cell's minimum on each axis (3·4). A sample and scale: the
            // cell (3·2), the weights' scale. Writes pairs, and what interpolating them needs; for each scale reads the
            // position, writes where pairs are and moves it; moves distance and position.
            Stage::Neighbors => cost(
                pairs * 25.0 + evaluated * scales * 7.0,
                pairs * (LOCATED + PAIR) + evaluated * (scales * (3.0 + 3.0 * 2.0) + 2.0 * 4.0),
            ),
            // Components are summed over registers, lanes and scales. Reads the neighbors but for their numbers, and
            // where they are; writes f.
            Stage::DensityGather => {
                let gathered = self.gather(&work.contributions, |s| s.density_rank);
                let summed = evaluated * self.scales.iter().map(|s| s.density_rank).sum::<usize>() as f64;
                gathered.plus(cost(summed, pairs * (LOCATED - 1.0) + evaluated * (2.0 * scales + 1.0)))
            }
            // α = −expm1(−softplus(f + shift)·depth): the shift, a maximum, two transcendental functions, their sum,
            // the product, and expm1; reads f, writes α and T. A sample that counts: 1 − α into T, and T·α (3), reads
            // both, writes its place in the order. A colored one writes place and weight. A term adds to its pixel,
            // 3·2, and reads its weight and color. Where rays are decoded: a sample's share of the weight (2) and of
            // each component (2).
            Stage::Composite => cost(
                evaluated * (3.0 * TRANSCENDENTAL + 4.0)
                    + samples * 3.0
                    + terms * 6.0
                    + composited * 2.0
                    + composited_samples * 2.0,
                evaluated * 3.0 + samples * 3.0 + colored * 2.0 + terms * 4.0 + composited + composites,
            ),
            // Reads pairs, centers and positions; writes a row of components.
            Stage::AppearanceGather => self.gather(&work.shaded_contributions, |s| s.appearance_rank).plus(cost(
                colored_pairs * INTERPOLATION,
                colored_pairs * (PAIR + 3.0) + colored * (2.0 * scales + 3.0 + components),
            )),
            // A product of one row: 2·P·ΣR. A sample's own color: 2·3·ΣR.
            Stage::AppearanceMatrices => cost(
                (decoded * features + own * 3.0) * 2.0 * components,
                decoded * (components + features) + own * (components + 3.0),
            ),
            // Sine and cosine of each feature, each further frequency by doubling (4); a direction's once a ray. Reads
            // the features, writes the rest of the input row.
            Stage::Encoding => {
                let [element, direction_element] =
                    self.frequencies.map(|f| SINE_COSINE + 4.0 * (f as f64 - 1.0).max(0.0));
                cost(decoded * features * element + rays * 3.0 * direction_element, decoded * inputs)
            }
            // A layer: 2·in·out, its bias and the rectifier. Reads inputs, writes outputs. A color: three sigmoids; one of
            // a sample's own is read and added to.
            Stage::Decoder => {
                let flop: usize = self.layers.iter().map(|[i, o]| 2 * i * o + 2 * o).sum();
                let words: usize = self.layers.iter().map(|[i, o]| i + o).sum();
                cost(
                    decoded * flop as f64 + terms * 3.0 * (TRANSCENDENTAL + 2.0) + own * 3.0,
                    decoded * words as f64 + own * 6.0,
                )
            }
            // A sample: T·(1 − α) (2), what its weight and what lies behind make of it (2), what lies behind the next
            // (3), the softplus's slope (3 and a transcendental function) and two products; reads its place, f, T and
            // α, writes a gradient. A colored one: the gradient along its color (5) and what it weighs (3); reads
            // place, weight, T and α, writes three. A term 4 a channel through the sigmoid; reads weight and color,
            // writes the color's gradient. A ray 5 a channel for error and loss, 3 for the background. Where rays are
            // decoded: each component's difference from its composite times gradient (3), and its share of the weight
            // (4); reads components, composites and gradients. Where samples keep colors of their own: these' gradients
            // are summed (3) and read, and of each component the composite's share is added (2), read and written.
            Stage::CompositeBackward => cost(
                samples * (12.0 + TRANSCENDENTAL)
                    + colored * 8.0
                    + terms * 12.0
                    + rays * 24.0
                    + composited * 3.0
                    + composited_samples * 4.0
                    + own * (3.0 + 2.0 * components),
                samples * 5.0
                    + colored * 7.0
                    + terms * 7.0
                    + composited
                    + composites * 2.0
                    + own * (3.0 + 2.0 * components),
            ),
            // A layer: its weights' gradients 2·in·out, its bias' out, and its inputs' 2·columns·out; the first layer's
            // inputs without the encoded direction. Reads inputs, twice the outputs' gradients, writes the inputs'.
            Stage::DecoderBackward => {
                let columns = |l: usize, inputs: usize| if l == 0 { self.first_layer_columns } else { inputs };
                let layers = || self.layers.iter().enumerate().map(|(l, &[i, o])| (i, o, columns(l, i)));
                let flop: usize = layers().map(|(i, o, c)| 2 * i * o + o + 2 * c * o).sum();
                let words: usize = layers().map(|(i, o, c)| i + 2 * o + c).sum();
                cost(decoded * flop as f64, decoded * words as f64)
            }
            // A frequency of a feature: f·(g_sin·cos − g_cos·sin) added, 5. Reads gradients and encodings, reads and
            // writes the feature's gradient.
            Stage::EncodingBackward => {
                let frequencies = self.frequencies[0] as f64;
                cost(decoded * features * 5.0 * frequencies, decoded * features * (4.0 * frequencies + 2.0))
            }
            // Two products of one row: the matrices' gradients and the components'. Reads the features' gradients
            // twice and the components, writes the components' gradients. The same of samples' own colors.
            Stage::AppearanceMatricesBackward => {
                let of = |rows: f64, features: f64| {
                    cost(rows * 4.0 * features * components, rows * (2.0 * features + 2.0 * components))
                };
                of(decoded, features).plus(of(own, 3.0))
            }
            // A pair's tensor is read to be counted, the pair to be moved; its weight is multiplied. Where tensors begin
            // is summed up, once for density and once for appearance, in each chunk of rays.
            Stage::ContributionOrder => {
                let sorted = counted * pairs + colored_pairs;
                cost(sorted, sorted * (1.0 + PAIR + TENSOR_PAIR) + 2.0 * tensors_by_chunk * 2.0)
            }
            // Reads where a tensor's pairs begin in each chunk; a pair and its sample's position.
            Stage::DensityBackward => {
                let pairs_by_scale: Vec<f64> = work.contributions.iter().map(|&n| counted * n as f64).collect();
                let scattered = self.scatter(&pairs_by_scale, |s| s.density_rank);
                scattered.plus(cost(0.0, tensors_by_chunk))
            }
            // As the density's; each component's gradient is read and weighed too.
            Stage::AppearanceBackward => {
                let pairs_by_scale: Vec<f64> = work.shaded_contributions.iter().map(|&n| n as f64).collect();
                let scattered = self.scatter(&pairs_by_scale, |s| s.appearance_rank);
                let weighed = self.per_component(&pairs_by_scale, |s| s.appearance_rank);
                scattered.plus(cost(weighed, tensors_by_chunk + weighed))
            }
            Stage::Optimizer => self.optimizer(work, runs as u64),
        }
    }

    /// Σ over scales of pairs × rank.
    fn per_component(&self, pairs: &[f64], rank: fn(&ScaleShape) -> usize) -> f64 {
        self.scales.iter().zip(pairs).map(|(scale, n)| n * rank(scale) as f64).sum()
    }

    /// A component of a pair: on 3 axes a subtraction and a multiply-add between two rows (3·3), then weight·x·y·z
    /// added (4). Reads two rows an axis, 6 numbers a component.
    fn gather(&self, pairs: &[u64], rank: fn(&ScaleShape) -> usize) -> Cost {
        let pairs: Vec<f64> = pairs.iter().map(|&n| n as f64).collect();
        let components = self.per_component(&pairs, rank);
        Cost { flop: components * 13.0, bytes: components * 6.0 * WORD }
    }

    /// A component of a pair: x, y, z (3·3), the product of gradient and the other two on each axis (5), shared between
    /// two rows and added (3·4). Reads 6 factors, reads and writes 6 gradients; reads the pair and its position.
    fn scatter(&self, pairs: &[f64], rank: fn(&ScaleShape) -> usize) -> Cost {
        let (count, components) = (pairs.iter().sum::<f64>(), self.per_component(pairs, rank));
        Cost {
            flop: components * 26.0 + count * INTERPOLATION,
            bytes: (components * 18.0 + count * (TENSOR_PAIR + 3.0)) * WORD,
        }
    }

    /// An entry: both moments (3 + 4), the step's size (6). Reads gradient, value and moments, writes value and moments.
    /// Every density entry and shared weight takes part in every run, a density after adding the regularization (1) to
    /// its gradient; of the appearance those of tensors that colored a sample, of which the counts tell the most there
    /// can be: one a pair.
    fn optimizer(&self, work: &Work, runs: u64) -> Cost {
        let entries = |tensors: u64, scale: &ScaleShape, rank: usize| tensors as f64 * (scale.rows * rank) as f64;
        let all_tensors = |scale: &ScaleShape| scale.tensors as u64 * runs;
        let density: f64 = self.scales.iter().map(|s| entries(all_tensors(s), s, s.density_rank)).sum();
        let appearance: f64 = (self.scales.iter().zip(&work.shaded_contributions))
            .map(|(s, &pairs)| entries(pairs.min(all_tensors(s)), s, s.appearance_rank))
            .sum();
        let matrices = self.features * self.scales.iter().map(|s| s.appearance_rank).sum::<usize>();
        let networks = matrices + self.layers.iter().map(|[i, o]| i * o + o).sum::<usize>();
        let all = density + appearance + networks as f64 * runs as f64;
        Cost { flop: all * 13.0 + density, bytes: all * 7.0 * WORD }
    }
}

#[cfg(test)]
mod tests;
