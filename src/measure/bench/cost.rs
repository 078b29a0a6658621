//! FLOP and bytes of each stage, from what was counted: the one place of these formulas.
//!
//! An addition, multiplication, division, square root, minimum or maximum counts one FLOP, a fused multiply-add two,
//! comparisons none, and [`TRANSCENDENTAL`] and [`SINE_COSINE`] what their names say. Bytes are those that a kernel's
//! loads and stores touch once each, in single precision, sums that a kernel adds to in registers left out; caches may
//! serve them. What the counts cannot tell is left out too (candidates that do not cover a sample, positions that the
//! occupancy skips, the decoder's weights, which stay in the caches), so that a share of the peak is never flattered.

use serde::Serialize;

use crate::field::{Field, Real, Stage, Work};

/// exp, ln(1 + x), exp − 1: about the additions and multiplications of a polynomial and its range reduction.
const TRANSCENDENTAL: f64 = 10.0;
/// A sine and a cosine together, counted in `field::Real::sine_cosine` of f32.
const SINE_COSINE: f64 = 30.0;
/// Bytes of a single-precision number, and of a tensor's or a sample's number.
const WORD: f64 = 4.0;
/// Offset from the centre (3), then u = (offset + half)·cells a unit and its fraction on each axis (3·3).
const INTERPOLATION: f64 = 12.0;

/// What a stage did.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Cost {
    /// Floating-point operations.
    pub flop: f64,
    /// Bytes that loads and stores touch.
    pub bytes: f64,
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
            first_layer_columns: field.decoder.input_parts()[2],
        }
    }

    /// What `stage` did in `runs` steps or frames, by the counts of all of them together.
    pub fn cost(&self, stage: Stage, work: &Work, runs: usize) -> Cost {
        let [rays, evaluated, samples, colored, decoded] =
            [work.rays, work.evaluated, work.samples, work.colored, work.decoded].map(|n| n as f64);
        let pairs = work.pairs.iter().sum::<u64>() as f64;
        let features = self.features as f64;
        let components = self.scales.iter().map(|s| s.appearance_rank).sum::<usize>() as f64;
        let [feature_frequencies, direction_frequencies] = self.frequencies.map(|f| f as f64);
        let cost = |flop: f64, bytes: f64| Cost { flop, bytes };
        match stage {
            // Nothing but random bits, cameras and sorting: a ray of 6 doubles and its colour of 3 floats are written,
            // and moved once into the order of space.
            Stage::Rays => cost(0.0, rays * 2.0 * (6.0 * 8.0 + 3.0 * WORD)),
            // Position: t (2) and o + t·d (3·2); the cell of the occupancy, a subtraction and a multiplication an axis.
            // Reads a word of blocks and one of cells.
            Stage::March => cost(evaluated * 14.0, evaluated * 2.0 * 8.0),
            // A neighbour: squared distance (3 + 3 + 2), its root, one division and the normalisation's addition and
            // multiplication. Reads its number and centre, writes number and weight.
            Stage::Neighbours => cost(pairs * 12.0, pairs * 6.0 * WORD),
            Stage::DensityGather => {
                let gathered = self.gather(&work.pairs, |s| s.density_rank);
                let summed = evaluated * self.scales.iter().map(|s| s.density_rank).sum::<usize>() as f64;
                cost(gathered.flop + summed, gathered.bytes + evaluated * WORD)
            }
            // α = −expm1(−softplus(f + shift)·depth): the shift, two transcendental functions, their sum, the product,
            // and expm1; then T·α, and 1 − α into T. A coloured sample adds 3 products to the pixel. Reads f, writes
            // α, T and the weight; reads colours.
            Stage::Composite => cost(
                evaluated * (3.0 * TRANSCENDENTAL + 3.0) + samples * 3.0 + colored * 6.0,
                evaluated * 2.0 * WORD + samples * 2.0 * WORD + colored * 3.0 * WORD,
            ),
            Stage::AppearanceGather => {
                let gathered = self.gather(&work.colored_pairs, |s| s.appearance_rank);
                cost(gathered.flop, gathered.bytes + colored * components * WORD)
            }
            // A product of one row: 2·P·ΣR.
            Stage::AppearanceMatrices => {
                cost(decoded * 2.0 * features * components, decoded * (components + features) * WORD)
            }
            // Sine and cosine of each feature, each further frequency by doubling (4), and the reduction over scales;
            // a direction's once a ray. Reads the features, writes the whole input row.
            Stage::Encoding => {
                let element = |frequencies: f64| SINE_COSINE + 4.0 * (frequencies - 1.0).max(0.0);
                let inputs = self.layers.first().map_or(0, |l| l[0]) as f64;
                cost(
                    decoded * features * (element(feature_frequencies) + 1.0)
                        + rays * 3.0 * element(direction_frequencies),
                    decoded * (features + inputs) * WORD,
                )
            }
            // A layer: 2·in·out, its bias and the rectifier; at the end three sigmoids. Reads inputs, writes outputs.
            Stage::Decoder => {
                let flop: usize = self.layers.iter().map(|[i, o]| 2 * i * o + 2 * o).sum();
                let words: usize = self.layers.iter().map(|[i, o]| i + o).sum();
                cost(decoded * (flop as f64 + 3.0 * (TRANSCENDENTAL + 2.0)), decoded * words as f64 * WORD)
            }
            // A sample: T·(1 − α) and T·α (3), per channel the gradient (4) and what lies behind (2), the softplus's
            // slope (transcendental, 3) and two products; a coloured one 4 a channel through the sigmoid; a ray 5 a
            // channel for error and loss. Reads f, T and α, writes a gradient; reads colours and writes theirs.
            Stage::CompositeBackward => cost(
                samples * (3.0 + 3.0 * 6.0 + TRANSCENDENTAL + 5.0) + colored * 12.0 + rays * 15.0,
                samples * 4.0 * WORD + colored * 6.0 * WORD,
            ),
            // A layer: its weights' gradients 2·in·out, its bias' out, and its inputs' 2·columns·out; the first layer's
            // inputs without the encoded direction. Reads inputs, twice the outputs' gradients, writes the inputs'.
            Stage::DecoderBackward => {
                let columns = |l: usize, inputs: usize| if l == 0 { self.first_layer_columns } else { inputs };
                let layers = || self.layers.iter().enumerate().map(|(l, &[i, o])| (i, o, columns(l, i)));
                let flop: usize = layers().map(|(i, o, c)| 2 * i * o + o + 2 * c * o).sum();
                let words: usize = layers().map(|(i, o, c)| i + 2 * o + c).sum();
                cost(decoded * flop as f64, decoded * words as f64 * WORD)
            }
            // A frequency of a feature: f·(g_sin·cos − g_cos·sin) added, 5; then the reduction. Reads gradients and
            // encodings, reads and writes the feature's gradient.
            Stage::EncodingBackward => cost(
                decoded * features * (5.0 * feature_frequencies + 1.0),
                decoded * features * (4.0 * feature_frequencies + 2.0) * WORD,
            ),
            // Two products of one row: the matrices' gradients and the components'. Reads the features' gradients
            // twice and the components, writes the components' gradients.
            Stage::AppearanceMatricesBackward => {
                cost(decoded * 4.0 * features * components, decoded * (2.0 * features + 2.0 * components) * WORD)
            }
            // A pair (2 words) is read to be counted and to be moved, and written with its place among the coloured.
            Stage::PairOrder => cost(0.0, pairs * (2.0 * 2.0 + 3.0) * WORD),
            // A pair reads itself (3 words), its sample's position and gradient; see `scatter`.
            Stage::DensityBackward => {
                let scattered = self.scatter(&work.pairs, |s| s.density_rank);
                cost(scattered.flop + pairs * (INTERPOLATION + 1.0), scattered.bytes + pairs * 7.0 * WORD)
            }
            // As the density's, on the same walk over the pairs: each component's gradient is read and weighed.
            Stage::AppearanceBackward => {
                let scattered = self.scatter(&work.colored_pairs, |s| s.appearance_rank);
                let weighed = self.per_component(&work.colored_pairs, |s| s.appearance_rank);
                cost(scattered.flop + weighed, scattered.bytes + weighed * WORD)
            }
            Stage::Optimiser => self.optimiser(work, runs as u64),
        }
    }

    /// Σ over scales of pairs × rank.
    fn per_component(&self, pairs: &[u64], rank: fn(&ScaleShape) -> usize) -> f64 {
        self.scales.iter().zip(pairs).map(|(scale, &n)| n as f64 * rank(scale) as f64).sum()
    }

    /// A component of a pair: on 3 axes a subtraction and a multiply-add between two rows (3·3), then weight·x·y·z
    /// added (4). Reads two rows an axis, 6 numbers a component, and the tensor's centre.
    fn gather(&self, pairs: &[u64], rank: fn(&ScaleShape) -> usize) -> Cost {
        let (count, components) = (pairs.iter().sum::<u64>() as f64, self.per_component(pairs, rank));
        Cost { flop: components * 13.0 + count * INTERPOLATION, bytes: components * 6.0 * WORD + count * 3.0 * WORD }
    }

    /// A component of a pair: x, y, z (3·3), on each axis the product of gradient and the other two (2), shared
    /// between two rows (4): 27. Reads 6 factors, reads and writes 6 gradients.
    fn scatter(&self, pairs: &[u64], rank: fn(&ScaleShape) -> usize) -> Cost {
        let components = self.per_component(pairs, rank);
        Cost { flop: components * 27.0, bytes: components * 18.0 * WORD }
    }

    /// An entry: both moments (3 + 4), the step's size (6). Reads gradient, value and moments, writes value and moments.
    /// Every density entry and shared weight takes part in every run, a density after adding the regularisation (1) to
    /// its gradient; of the appearance those of tensors that coloured a sample, which the counts bound: a pair each.
    fn optimiser(&self, work: &Work, runs: u64) -> Cost {
        let entries = |tensors: u64, scale: &ScaleShape, rank: usize| tensors as f64 * (scale.rows * rank) as f64;
        let all_tensors = |scale: &ScaleShape| scale.tensors as u64 * runs;
        let density: f64 = self.scales.iter().map(|s| entries(all_tensors(s), s, s.density_rank)).sum();
        let appearance: f64 = (self.scales.iter().zip(&work.colored_pairs))
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
