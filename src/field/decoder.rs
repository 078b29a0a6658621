//! Appearance and decoder for many samples at once, as matrix products (DESIGN, section 2.7).

use super::{Field, Matrix, MatrixMut, Real, Samples, multiply};
use crate::geometry::Ray;
use crate::model::{Reduction, Scene};

/// A fully connected layer.
#[derive(Clone, Debug)]
pub struct Dense<T> {
    /// Columns.
    pub inputs: usize,
    /// Rows.
    pub outputs: usize,
    /// \[outputs\]\[inputs\].
    pub weights: Vec<T>,
    /// \[outputs\].
    pub bias: Vec<T>,
}

/// The appearance matrices and the MLP.
#[derive(Clone, Debug)]
pub struct FieldDecoder<T> {
    /// P.
    pub features: usize,
    /// \[P\]\[ΣR\]: the scales' matrices side by side.
    pub appearance: Vec<T>,
    /// Frequencies of PE(features) and of PE(direction).
    pub frequencies: [u32; 2],
    /// First to last.
    pub layers: Vec<Dense<T>>,
}

/// What the decoder computed for a batch of n coloured samples. Reused from one batch to the next.
#[derive(Clone, Debug, Default)]
pub struct Activations<T> {
    /// \[n\]\[ΣR\] aggregated appearance components.
    pub components: Vec<T>,
    /// \[n\] what the features are multiplied by: 1, or 1 over the number of covering scales.
    pub reductions: Vec<T>,
    /// \[layer\]\[n\]\[inputs of that layer\]: the encoded features, then each layer's rectified outputs.
    pub inputs: Vec<Vec<T>>,
    /// \[n\] colours in [0, 1].
    pub colors: Vec<[T; 3]>,
    outputs: Vec<T>,
    direction: Vec<T>,
    angles: Vec<T>,
}

impl<T: Real> FieldDecoder<T> {
    /// Prepares `scene`'s appearance matrices and decoder.
    pub fn new(scene: &Scene) -> Self {
        let convert = |values: &[f32]| values.iter().map(|&v| T::of_f32(v)).collect::<Vec<T>>();
        let features = scene.features() as usize;
        let mut appearance = Vec::new();
        for p in 0..features {
            for scale in &scene.scales {
                let rank = scale.factors.appearance_rank as usize;
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
        Self { features, appearance, frequencies, layers }
    }

    /// Where each part of the first layer's input begins: direction, PE(features), PE(direction).
    pub fn input_parts(&self) -> [usize; 3] {
        let direction = self.features;
        let encoded_features = direction + 3;
        [direction, encoded_features, encoded_features + 2 * self.features * self.frequencies[0] as usize]
    }
}

/// Writes PE(`values`): all sines, then all cosines, frequencies fastest; each frequency by doubling the angle before.
/// `angles` is room for sines and cosines side by side, so that the loop over them vectorises.
#[inline(always)]
fn encode<T: Real>(values: &[T], frequencies: usize, encoded: &mut [T], angles: &mut Vec<T>) {
    let n = values.len();
    angles.resize(2 * n, T::zero());
    let (first_sines, first_cosines) = angles.split_at_mut(n);
    for i in 0..n {
        (first_sines[i], first_cosines[i]) = values[i].sine_cosine();
    }
    let (sines, cosines) = encoded.split_at_mut(n * frequencies);
    for i in 0..n {
        let (mut s, mut c) = (first_sines[i], first_cosines[i]);
        for k in i * frequencies..(i + 1) * frequencies {
            (sines[k], cosines[k]) = (s, c);
            (s, c) = ((s + s) * c, T::one() - (s + s) * s);
        }
    }
}

impl<T: Real> Field<T> {
    /// Colours of all coloured `samples` of `rays`.
    #[inline(always)]
    pub fn decode(&self, rays: &[Ray], samples: &Samples<T>, activations: &mut Activations<T>) {
        self.gather_appearance(samples, activations);
        self.encode_inputs(rays, samples, activations);
        let n = samples.colored.len();
        let layers = &self.decoder.layers;
        for (l, layer) in layers.iter().enumerate() {
            let last = l + 1 == layers.len();
            let (before, after) = activations.inputs.split_at_mut(l + 1);
            let outputs = if last { &mut activations.outputs } else { &mut after[0] };
            outputs.resize(n * layer.outputs, T::zero());
            multiply(
                MatrixMut::new(outputs, n, layer.outputs, layer.outputs),
                Matrix::new(&before[l], n, layer.inputs, layer.inputs),
                Matrix::new(&layer.weights, layer.outputs, layer.inputs, layer.inputs).transposed(),
                false,
            );
            let floor = if last { T::neg_infinity() } else { T::zero() };
            for row in outputs.chunks_exact_mut(layer.outputs) {
                for (v, &b) in row.iter_mut().zip(&layer.bias) {
                    *v = (*v + b).max(floor);
                }
            }
        }
        activations.colors.clear();
        let sigmoid = |x: T| T::one() / (T::one() + (-x).exp());
        activations.colors.extend(activations.outputs.chunks_exact(3).map(|c| [0, 1, 2].map(|i| sigmoid(c[i]))));
    }

    /// Fills `components` and `reductions`.
    #[inline(always)]
    fn gather_appearance(&self, samples: &Samples<T>, activations: &mut Activations<T>) {
        let width = self.component_count();
        let scales = self.scales.len();
        activations.components.clear();
        activations.components.resize(samples.colored.len() * width, T::zero());
        activations.reductions.clear();
        for (row, &sample) in activations.components.chunks_exact_mut(width).zip(&samples.colored) {
            let sample = sample as usize;
            let mut rest = row;
            for (s, scale) in self.scales.iter().enumerate() {
                let (components, after) = rest.split_at_mut(scale.appearance_rank);
                for pair in samples.pairs_of(sample, s, scales) {
                    let tensor = pair.tensor - scale.first_tensor;
                    scale.add_appearance_of(tensor, samples.positions[sample], pair.weight, components);
                }
                rest = after;
            }
            activations.reductions.push(match self.rules.appearance_reduction {
                Reduction::Sum => T::one(),
                Reduction::Mean => T::one() / T::of(samples.covering_scales(sample, scales) as f64),
            });
        }
    }

    /// Fills the first layer's inputs.
    #[inline(always)]
    fn encode_inputs(&self, rays: &[Ray], samples: &Samples<T>, activations: &mut Activations<T>) {
        let decoder = &self.decoder;
        let n = samples.colored.len();
        let features = decoder.features;
        let components = self.component_count();
        let inputs = decoder.layers[0].inputs;
        activations.inputs.resize(decoder.layers.len(), Vec::new());
        let Activations { inputs: all_inputs, components: sums, reductions, direction: direction_row, angles, .. } =
            activations;
        let rows = &mut all_inputs[0];
        rows.resize(n * inputs, T::zero());
        multiply(
            MatrixMut::new(rows, n, features, inputs),
            Matrix::new(sums, n, components, components),
            Matrix::new(&decoder.appearance, features, components, components).transposed(),
            false,
        );
        let [direction_at, encoded_at, encoded_direction_at] = decoder.input_parts();
        direction_row.resize(inputs - encoded_direction_at, T::zero());
        for (r, ray) in rays.iter().enumerate() {
            let direction = ray.direction.to_array().map(T::of);
            encode(&direction, decoder.frequencies[1] as usize, direction_row, angles);
            for c in samples.colored_of_ray(r) {
                let row = &mut rows[c * inputs..(c + 1) * inputs];
                let reduction = reductions[c];
                row[..features].iter_mut().for_each(|f| *f *= reduction);
                row[direction_at..encoded_at].copy_from_slice(&direction);
                let (values, encoded) = row[..encoded_direction_at].split_at_mut(encoded_at);
                encode(&values[..features], decoder.frequencies[0] as usize, encoded, angles);
                row[encoded_direction_at..].copy_from_slice(direction_row);
            }
        }
    }
}
