//! The appearance matrices and the layers of the decoder (spec 4.6, 4.7), in the field's precision.

use pulp::Simd;

use super::Real;
use strivec_format::model::{DecoderMode, Scene};

/// A fully connected layer.
#[derive(Clone, Debug)]
pub struct Dense<T> {
    /// Number of inputs.
    pub inputs: usize,
    /// Number of outputs.
    pub outputs: usize,
    /// \[output\]\[input\] weights.
    pub weights: Vec<T>,
    /// \[output\] biases.
    pub bias: Vec<T>,
}

/// The appearance matrices and the MLP.
#[derive(Clone, Debug)]
pub struct FieldDecoder<T> {
    /// The decoder's mode: samples or rays are decoded.
    pub mode: DecoderMode,
    /// P, the number of appearance features.
    pub features: usize,
    /// \[P\]\[ΣR\] the scales' appearance matrices side by side.
    pub appearance: Vec<T>,
    /// Numbers of frequencies of PE(features) and of PE(direction).
    pub frequencies: [u32; 2],
    /// The layers, first to last.
    pub layers: Vec<Dense<T>>,
}

impl<T: Real> FieldDecoder<T> {
    /// Prepares `scene`'s appearance matrices and decoder.
    pub fn new(scene: &Scene) -> Self {
        let convert = |values: &[f32]| values.iter().map(|&v| T::of_f32(v)).collect::<Vec<T>>();
        let features = scene.features() as usize;
        let mut appearance = Vec::new();
        // Side by side, so that all scales are one matrix product.
        for p in 0..features {
            for scale in &scene.scales {
                let rank = scale.factors.appearance_rank() as usize;
                appearance.extend(convert(&scale.appearance_matrix.weights[p * rank..(p + 1) * rank]));
            }
        }
        let layers = (scene.decoder.layers.iter())
            .map(|l| Dense {
                inputs: l.inputs as usize,
                outputs: l.outputs as usize,
                weights: convert(&l.weights),
                bias: convert(&l.bias),
            })
            .collect();
        let frequencies = [scene.decoder.feature_frequencies, scene.decoder.direction_frequencies];
        Self { mode: scene.decoder.mode, features, appearance, frequencies, layers }
    }

    /// The rows of the appearance matrices of a sample's own color, \[3\]\[ΣR\]; `None` if samples have none.
    pub fn own_rows(&self) -> Option<&[T]> {
        let width = self.appearance.len() / self.features.max(1);
        (self.mode == DecoderMode::Residual).then(|| &self.appearance[..3 * width])
    }

    /// The first three features of a sample's `components`: its own color in mode *residual*, before the row's is added.
    #[inline(always)]
    pub(super) fn own_color<S: Simd>(&self, simd: S, components: &[T]) -> [T; 3] {
        let (lanes, width) = (T::lanes::<S>(), components.len());
        let whole = width / lanes * lanes;
        // Three sums at once, so that each component is loaded once.
        let mut sums = [T::splat(simd, T::zero()); 3];
        for first in (0..whole).step_by(lanes) {
            let values = T::load(simd, &components[first..]);
            for (p, sum) in sums.iter_mut().enumerate() {
                *sum = T::times_plus(simd, values, T::load(simd, &self.appearance[p * width + first..]), *sum);
            }
        }
        let mut color = [T::total(simd, sums[0]), T::total(simd, sums[1]), T::total(simd, sums[2])];
        // The rest one by one: a register would reach into the next row of the matrix.
        for c in whole..width {
            for (p, color) in color.iter_mut().enumerate() {
                *color += components[c] * self.appearance[p * width + c];
            }
        }
        color
    }

    /// The first columns of the parts of the first layer's input after the features: direction, PE(features),
    /// PE(direction).
    pub fn input_parts(&self) -> [usize; 3] {
        let direction = self.features;
        let encoded_features = direction + 3;
        [direction, encoded_features, encoded_features + 2 * self.features * self.frequencies[0] as usize]
    }
}
