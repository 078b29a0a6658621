//! FLOP and bytes of each stage from its counts.
//!
//! An addition, multiplication, division, square root, minimum or maximum counts one FLOP, a fused multiply-add two,
//! comparisons and rounding none; [`TRANSCENDENTAL`] and [`SINE_COSINE`] are for these functions. Bytes are those that
//! the loads and stores of a kernel touch once each, in single precision; caches may serve them. Left out are scratch
//! within a kernel, shared weights and the sums of their gradients, which stay in the caches, and unknown counts:
//! candidates that do not cover a sample, positions that the march passes over, a frame's depths.

use serde::Serialize;

use crate::field::{Field, Real, Stage, Work};
use crate::model::DecoderMode;
use crate::train::RAYS_PER_CHUNK;

/// exp, ln(1 + x), exp − 1: about the additions and multiplications of a polynomial and its range reduction.
const TRANSCENDENTAL: f64 = 10.0;
/// A sine and a cosine together, as in `field::Real::sine_cosine` of f32.
const SINE_COSINE: f64 = 30.0;
/// Bytes of a single-precision number, and of an index.
const WORD: f64 = 4.0;
/// Offset from the center (3), then u = (offset + half)·cells a unit and its fraction on each axis (3·3).
const INTERPOLATION: f64 = 12.0;
/// Words of a `field::Contribution`, of a `field::samples::Neighborhood` and of a `train::pairs::TensorPair`.
const CONTRIBUTION: f64 = 8.0;
const NEIGHBORHOOD: f64 = 3.0;
const TENSOR_PAIR: f64 = 3.0;

/// The cost of a stage.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Cost {
    /// Floating-point operations.
    pub flop: f64,
    /// Bytes that loads and stores touch.
    pub bytes: f64,
}

impl Cost {
    /// The cost of `flop` and of reading and writing single-precision `words`.
    fn new(flop: f64, words: f64) -> Self {
        Self { flop, bytes: words * WORD }
    }

    fn plus(self, other: Self) -> Self {
        Self { flop: self.flop + other.flop, bytes: self.bytes + other.bytes }
    }
}

/// The shape of a field; costs depend on it and on the counts.
#[derive(Clone, Debug, PartialEq)]
pub struct FieldShape {
    /// The scales, coarsest first.
    pub scales: Vec<ScaleShape>,
    /// Appearance features, P in the paper.
    pub features: usize,
    /// Frequencies of PE(features) and of PE(direction).
    pub frequencies: [usize; 2],
    /// \[layer\] inputs and outputs.
    pub layers: Vec<[usize; 2]>,
    /// The decoder is called per sample, per ray, or per ray with residuals.
    pub mode: DecoderMode,
    /// Columns of the first layer whose gradient is needed: all but the encoded direction.
    pub first_layer_columns: usize,
}

/// One scale of a [`FieldShape`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ScaleShape {
    /// Number of tensors.
    pub tensors: usize,
    /// Density factors of all tensors.
    pub density_factors: usize,
    /// Appearance factors of all tensors.
    pub appearance_factors: usize,
    /// Appearance components of the scale.
    pub appearance_rank: usize,
}

impl FieldShape {
    /// The shape of `field`.
    pub fn new<T: Real>(field: &Field<T>) -> Self {
        let scales = (field.scales.iter())
            .map(|s| ScaleShape {
                tensors: s.len(),
                density_factors: s.density.iter().map(|block| block.values().len()).sum(),
                appearance_factors: s.appearance.iter().map(|block| block.values().len()).sum(),
                appearance_rank: s.appearance_rank(),
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

    /// The cost of `stage` in `runs` steps or frames, from the counts of all of them together.
    pub fn cost(&self, stage: Stage, work: &Work, runs: usize) -> Cost {
        let counts = Counts::new(self, work);
        match stage {
            Stage::Rays => counts.rays(),
            Stage::March => counts.march(),
            Stage::Neighbors => counts.neighbors(),
            Stage::DensityGather => self.density_gather(work, &counts),
            Stage::Composite => counts.composite(),
            Stage::AppearanceGather => self.appearance_gather(work, &counts),
            Stage::AppearanceMatrices => counts.appearance_matrices(),
            Stage::Encoding => self.encoding(&counts),
            Stage::Decoder => self.decoder(&counts),
            Stage::CompositeBackward => counts.composite_backward(),
            Stage::DecoderBackward => self.decoder_backward(&counts),
            Stage::EncodingBackward => self.encoding_backward(&counts),
            Stage::AppearanceMatricesBackward => counts.appearance_matrices_backward(),
            Stage::ContributionOrder => counts.contribution_order(),
            Stage::DensityBackward => self.density_backward(work, &counts),
            Stage::AppearanceBackward => self.appearance_backward(work, &counts),
            Stage::Optimizer => self.optimizer(work, runs as u64),
        }
    }

    /// Components are summed over registers and lanes. Reads contributions but for their tensors, and the neighborhoods;
    /// writes f.
    fn density_gather(&self, work: &Work, counts: &Counts) -> Cost {
        gather(work.density_components as f64).plus(Cost::new(
            work.density_components as f64,
            counts.contributions * (CONTRIBUTION - 1.0) + counts.evaluated * (NEIGHBORHOOD * counts.scales + 1.0),
        ))
    }

    /// Reads contributions but for their tensors, and the neighborhoods; writes a row of components. A sample's residual:
    /// 2·3·ΣR, reads the row. If rays are decoded: a sample's share of the weight and of each component (2); reads the
    /// row, writes the ray's.
    fn appearance_gather(&self, work: &Work, counts: &Counts) -> Cost {
        gather(work.appearance_components as f64).plus(Cost::new(
            counts.residuals * 3.0 * 2.0 * counts.components + counts.composited * 2.0 + counts.composited_samples,
            counts.shaded_contributions * (CONTRIBUTION - 1.0)
                + counts.shaded * (NEIGHBORHOOD * counts.scales + counts.components)
                + counts.residuals * (counts.components + 3.0)
                + counts.composited
                + counts.composites,
        ))
    }

    /// Sine and cosine of each feature, each further frequency by doubling (4); a direction's once a ray. Reads the
    /// features, writes the rest of the input row.
    fn encoding(&self, counts: &Counts) -> Cost {
        let [element, direction_element] = self.frequencies.map(|f| SINE_COSINE + 4.0 * (f as f64 - 1.0).max(0.0));
        let inputs = self.layers.first().map_or(0, |l| l[0]) as f64;
        Cost::new(
            counts.decoded * counts.features * element + counts.rays * 3.0 * direction_element,
            counts.decoded * inputs,
        )
    }

    /// A layer: 2·in·out and its bias; the rectifier of a hidden layer. Reads inputs, writes outputs. A color: three
    /// sigmoids; a sample's residual is read and added to.
    fn decoder(&self, counts: &Counts) -> Cost {
        let rectified: usize = self.layers.iter().rev().skip(1).map(|[_, o]| o).sum();
        let flop = self.layers.iter().map(|[i, o]| 2 * i * o + o).sum::<usize>() + rectified;
        let words: usize = self.layers.iter().map(|[i, o]| i + o).sum();
        Cost::new(
            counts.decoded * flop as f64 + counts.terms * 3.0 * (TRANSCENDENTAL + 2.0) + counts.residuals * 3.0,
            counts.decoded * words as f64 + counts.residuals * 6.0,
        )
    }

    /// A layer: its weights' gradients 2·in·out, its bias' out, and its inputs' 2·columns·out; the first layer's inputs
    /// without the encoded direction. Reads inputs, twice the outputs' gradients, writes the inputs'.
    fn decoder_backward(&self, counts: &Counts) -> Cost {
        let columns = |l: usize, inputs: usize| if l == 0 { self.first_layer_columns } else { inputs };
        let layers = || self.layers.iter().enumerate().map(|(l, &[i, o])| (i, o, columns(l, i)));
        let flop: usize = layers().map(|(i, o, c)| 2 * i * o + o + 2 * c * o).sum();
        let words: usize = layers().map(|(i, o, c)| i + 2 * o + c).sum();
        Cost::new(counts.decoded * flop as f64, counts.decoded * words as f64)
    }

    /// A frequency of a feature: f·(g_sin·cos − g_cos·sin) added, 5. Reads gradients and encodings, reads and writes
    /// the feature's gradient.
    fn encoding_backward(&self, counts: &Counts) -> Cost {
        let frequencies = self.frequencies[0] as f64;
        Cost::new(
            counts.decoded * counts.features * 5.0 * frequencies,
            counts.decoded * counts.features * (4.0 * frequencies + 2.0),
        )
    }

    /// Reads the range of a tensor's contributions in each chunk; a contribution and its sample's position.
    fn density_backward(&self, work: &Work, counts: &Counts) -> Cost {
        let [pairs, components] =
            [counts.contributions, work.density_components as f64].map(|n| counts.composited_share * n);
        scatter(pairs, components).plus(Cost::new(0.0, counts.tensors_by_chunk))
    }

    /// As the density's; each component's gradient is read and weighted too.
    fn appearance_backward(&self, work: &Work, counts: &Counts) -> Cost {
        let components = work.appearance_components as f64;
        let scattered = scatter(counts.shaded_contributions, components);
        scattered.plus(Cost::new(components, counts.tensors_by_chunk + components))
    }

    /// An entry: both moments (3 + 4), the step's size (6). Reads gradient, value and moments, writes value and
    /// moments. Every density entry and shared weight takes part in every run, a density after adding the
    /// regularization (1) to its gradient. Appearance entries take part if their tensor colored a sample; their
    /// number is bounded by one tensor per pair.
    fn optimizer(&self, work: &Work, runs: u64) -> Cost {
        let density = runs as f64 * self.scales.iter().map(|s| s.density_factors).sum::<usize>() as f64;
        let appearance: f64 = (self.scales.iter().zip(&work.shaded_contributions))
            .map(|(s, &pairs)| {
                let tensors = pairs.min(s.tensors as u64 * runs) as f64;
                tensors * s.appearance_factors as f64 / s.tensors.max(1) as f64
            })
            .sum();
        let matrices = self.features * self.scales.iter().map(|s| s.appearance_rank).sum::<usize>();
        let networks = matrices + self.layers.iter().map(|[i, o]| i * o + o).sum::<usize>();
        let all = density + appearance + networks as f64 * runs as f64;
        Cost { flop: all * 13.0 + density, bytes: all * 7.0 * WORD }
    }
}

/// A component of a contribution: on 3 axes a subtraction and a multiply-add between two rows (3·3), then weight·x·y·z
/// added (4). Reads two rows an axis, 6 numbers a component; of a vector and a matrix as many, with two operations more.
fn gather(components: f64) -> Cost {
    Cost { flop: components * 13.0, bytes: components * 6.0 * WORD }
}

/// A component of a pair: x, y, z (3·3), the product of gradient and the other two on each axis (5), shared between two
/// rows and added (3·4). Reads 6 factors, reads and writes 6 gradients; reads the pair and its position.
fn scatter(pairs: f64, components: f64) -> Cost {
    Cost {
        flop: components * 26.0 + pairs * INTERPOLATION,
        bytes: (components * 18.0 + pairs * (TENSOR_PAIR + 3.0)) * WORD,
    }
}

/// The counts of costs, as floating point.
#[derive(Clone, Copy, Debug)]
struct Counts {
    rays: f64,
    /// Samples whose density is evaluated.
    evaluated: f64,
    /// Samples before their ray's end.
    samples: f64,
    /// Samples with a color.
    shaded: f64,
    /// Calls of the decoder.
    decoded: f64,
    contributions: f64,
    shaded_contributions: f64,
    /// Share of the evaluated samples that are before their ray's end. Samples behind it are assumed to have as many
    /// contributions.
    composited_share: f64,
    scales: f64,
    features: f64,
    /// Appearance components of all scales.
    components: f64,
    /// Samples whose components are composited, if the decoder is called per ray.
    composited_samples: f64,
    /// Their components.
    composited: f64,
    /// Components of the composites.
    composites: f64,
    /// Colors that pixels are summed from.
    terms: f64,
    /// Of these, the ones that add a sample's residual to its ray's color.
    residuals: f64,
    /// Ranges of tensors, one for each chunk of rays.
    tensors_by_chunk: f64,
}

impl Counts {
    fn new(shape: &FieldShape, work: &Work) -> Self {
        let [rays, evaluated, samples, shaded, decoded] =
            [work.rays, work.evaluated, work.samples, work.shaded, work.decoded].map(|n| n as f64);
        let components = shape.scales.iter().map(|s| s.appearance_rank).sum::<usize>() as f64;
        let [composited_samples, composites] =
            if shape.mode == DecoderMode::PerSample { [0.0; 2] } else { [shaded, decoded * components] };
        let [terms, residuals] = if shape.mode == DecoderMode::Residual { [shaded; 2] } else { [decoded, 0.0] };
        let tensors = shape.scales.iter().map(|s| s.tensors).sum::<usize>() as f64;
        Self {
            rays,
            evaluated,
            samples,
            shaded,
            decoded,
            contributions: work.contributions.iter().sum::<u64>() as f64,
            shaded_contributions: work.shaded_contributions.iter().sum::<u64>() as f64,
            composited_share: if evaluated > 0.0 { samples / evaluated } else { 0.0 },
            scales: shape.scales.len() as f64,
            features: shape.features as f64,
            components,
            composited_samples,
            composited: composited_samples * components,
            composites,
            terms,
            residuals,
            tensors_by_chunk: tensors * (rays / RAYS_PER_CHUNK as f64).ceil(),
        }
    }

    /// Random bits, cameras and sorting alone: a ray of 6 doubles and its color of 3 floats are written, and moved once
    /// into the order of space.
    fn rays(&self) -> Cost {
        Cost::new(0.0, self.rays * 2.0 * (6.0 * 2.0 + 3.0))
    }

    /// t (2), o + t·d (3·2), relative to the origin (3). Writes distance and position.
    fn march(&self) -> Cost {
        Cost::new(self.evaluated * 11.0, self.evaluated * 4.0)
    }

    /// A neighbor: offset (3) and its square (6), root, reciprocal, their sum and the product with the weights' scale
    /// (4), and u, its fraction and the last cell's minimum on each axis (3·4). A sample and scale: the cell (3·2), the
    /// weights' scale. Writes contributions; for each scale reads the position, writes and moves the neighborhood; moves
    /// distance and position.
    fn neighbors(&self) -> Cost {
        Cost::new(
            self.contributions * 25.0 + self.evaluated * self.scales * 7.0,
            self.contributions * CONTRIBUTION + self.evaluated * (self.scales * (3.0 + 3.0 * NEIGHBORHOOD) + 2.0 * 4.0),
        )
    }

    /// α = −expm1(−softplus(f + shift)·depth): the shift, a maximum, two transcendental functions, their sum, the
    /// product, and expm1; reads f, writes α and T. A sample before the ray's end: 1 − α into T, and T·α (3), reads
    /// both, writes its slot in the order. A shaded one writes slot and weight. A term adds to its pixel, 3·2, and
    /// reads its weight and color. If rays are decoded: the sum of samples' weights.
    fn composite(&self) -> Cost {
        Cost::new(
            self.evaluated * (3.0 * TRANSCENDENTAL + 4.0)
                + self.samples * 3.0
                + self.terms * 6.0
                + self.composited_samples,
            self.evaluated * 3.0 + self.samples * 3.0 + self.shaded * 2.0 + self.terms * 4.0,
        )
    }

    /// A product of one row: 2·P·ΣR.
    fn appearance_matrices(&self) -> Cost {
        Cost::new(
            self.decoded * self.features * 2.0 * self.components,
            self.decoded * (self.components + self.features),
        )
    }

    /// A sample: T·(1 − α) (2), the gradients of its weight and of the color behind it (2), the color behind the next
    /// (3), the softplus's slope (3 and a transcendental function) and two products; reads its slot, f, T and α, writes
    /// a gradient. A shaded one: the gradient along its color (5) and its weight (3); reads slot, weight, T and α,
    /// writes three. A term 4 a channel through the sigmoid; reads weight and color, writes the color's gradient. A ray
    /// 5 a channel for error and loss, 3 for the background. If rays are decoded: each component's difference from its
    /// composite times gradient (3), and its share of the weight (4); reads components, composites and gradients. If
    /// samples have residuals: their gradients are summed (3) and read, and of each component the composite's share is
    /// added (2), read and written.
    fn composite_backward(&self) -> Cost {
        Cost::new(
            self.samples * (12.0 + TRANSCENDENTAL)
                + self.shaded * 8.0
                + self.terms * 12.0
                + self.rays * 24.0
                + self.composited * 3.0
                + self.composited_samples * 4.0
                + self.residuals * (3.0 + 2.0 * self.components),
            self.samples * 5.0
                + self.shaded * 7.0
                + self.terms * 7.0
                + self.composited
                + self.composites * 2.0
                + self.residuals * (3.0 + 2.0 * self.components),
        )
    }

    /// Two products of one row: the matrices' gradients and the components'. Reads the features' gradients twice and
    /// the components, writes the components' gradients. The same for residuals.
    fn appearance_matrices_backward(&self) -> Cost {
        let products = |rows: f64, features: f64| {
            Cost::new(rows * 4.0 * features * self.components, rows * (2.0 * features + 2.0 * self.components))
        };
        products(self.decoded, self.features).plus(products(self.residuals, 3.0))
    }

    /// A contribution's tensor is read to be counted, with its weight to be moved; the weight is multiplied. The
    /// beginnings of the tensors' ranges are summed up, once for density and once for appearance, in each chunk of
    /// rays.
    fn contribution_order(&self) -> Cost {
        let sorted = self.composited_share * self.contributions + self.shaded_contributions;
        Cost::new(sorted, sorted * (1.0 + 2.0 + TENSOR_PAIR) + 2.0 * self.tensors_by_chunk * 2.0)
    }
}

#[cfg(test)]
mod tests;
