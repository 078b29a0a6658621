//! One chunk of rays, forward and backward: loss, the gradients of the shared weights, and what each (tensor, sample)
//! pair needs for the gradients of its factors.
//!
//! Gradients are written out by hand. With τ = σ·δ·distance_scale, α = 1 − e^−τ and w = T·α, a pixel is
//! C = Σ w·c + T_end·background, so ∂C/∂τ_i = T_{i+1}·c_i − (Σ_{j>i} w_j·c_j + T_end·background), where samples
//! without colour have c = 0, and ∂C/∂c_i = w_i.

use super::NetworkLayout;
use crate::field::{Activations, Field, Matrix, MatrixMut, Real, Samples, multiply};
use crate::geometry::Ray;
use crate::model::Reduction;

/// Rays of a chunk, whatever the number of threads: results depend on it, so it is fixed.
pub(super) const RAYS_PER_CHUNK: usize = 32;

/// No colour: the `colored` of a pair whose sample has none.
pub(super) const NOT_COLORED: u32 = u32::MAX;

/// A (tensor, sample) pair of a chunk.
#[derive(Clone, Copy, Debug)]
pub(super) struct SortedPair<T> {
    pub(super) sample: u32,
    /// The sample's place among the coloured ones, or [`NOT_COLORED`].
    pub(super) colored: u32,
    pub(super) weight: T,
}

/// What a chunk leaves for the tensors and the shared weights. Reused from step to step.
#[derive(Debug, Default)]
pub(super) struct Chunk<T> {
    pub(super) samples: Samples<T>,
    /// \[sample\] ∂L/∂(a scale's density feature).
    pub(super) feature_gradients: Vec<T>,
    /// \[coloured\]\[ΣR\] ∂L/∂components.
    pub(super) component_gradients: Vec<T>,
    /// ∂L/∂shared weights, in the flat layout.
    pub(super) network_gradients: Vec<T>,
    /// \[tensor\] its first pair in `pairs`, and the number of pairs.
    pub(super) pair_starts: Vec<u32>,
    /// Pairs by tensor, then sample.
    pub(super) pairs: Vec<SortedPair<T>>,
    /// Σ over rays and channels of the squared error.
    pub(super) squared_error: f64,
    colored_of: Vec<u32>,
}

/// What a thread needs while it works on a chunk. Reused.
#[derive(Debug, Default)]
pub(super) struct Scratch<T> {
    activations: Activations<T>,
    color_gradients: Vec<T>,
    input_gradients: Vec<T>,
    output_gradients: Vec<T>,
}

impl<T: Real> Chunk<T> {
    /// Marches and decodes `rays`, compares with `targets`, and goes back. The loss is the squared error times
    /// `loss_scale`.
    #[inline(always)]
    pub(super) fn run(
        &mut self,
        field: &Field<T>,
        layout: &NetworkLayout,
        rays: &[Ray],
        targets: &[[f32; 3]],
        loss_scale: f64,
        scratch: &mut Scratch<T>,
    ) {
        field.march(rays, &mut self.samples);
        field.decode(rays, &self.samples, &mut scratch.activations);
        self.composite(field, targets, T::of(loss_scale), scratch);
        self.decode_backward(field, layout, scratch);
        self.sort_pairs(field);
    }

    /// Compositing and loss, and back to density features and colours.
    #[inline(always)]
    fn composite(&mut self, field: &Field<T>, targets: &[[f32; 3]], loss_scale: T, scratch: &mut Scratch<T>) {
        let samples = &self.samples;
        let colors = &scratch.activations.colors;
        let scales = field.scales.len();
        let shift = T::of(field.rules.density_shift);
        let depth_per_density = T::of(field.rules.step * field.rules.distance_scale);
        self.feature_gradients.clear();
        self.feature_gradients.resize(samples.len(), T::zero());
        scratch.color_gradients.clear();
        scratch.color_gradients.resize(3 * colors.len(), T::zero());
        self.squared_error = 0.0;

        for (r, target) in targets.iter().enumerate() {
            let behind_all = field.background.map(|c| samples.remaining[r] * c);
            let mut color = behind_all;
            for c in samples.colored_of_ray(r) {
                let sample = samples.colored[c] as usize;
                let weight = samples.transmittances[sample] * samples.alphas[sample];
                for (sum, &value) in color.iter_mut().zip(&colors[c]) {
                    *sum += weight * value;
                }
            }
            let error = [0, 1, 2].map(|i| color[i] - T::of_f32(target[i]));
            self.squared_error += error.iter().map(|e| e.f64() * e.f64()).sum::<f64>();
            let pixel_gradient = error.map(|e| (e + e) * loss_scale);

            let mut behind = behind_all;
            let mut colored = samples.colored_of_ray(r);
            for sample in samples.of_ray(r).rev() {
                let (transmittance, alpha) = (samples.transmittances[sample], samples.alphas[sample]);
                let weight = transmittance * alpha;
                let mut value = [T::zero(); 3];
                if colored.end > colored.start && samples.colored[colored.end - 1] as usize == sample {
                    colored.end -= 1;
                    value = colors[colored.end];
                    for i in 0..3 {
                        // Through the sigmoid.
                        scratch.color_gradients[3 * colored.end + i] =
                            pixel_gradient[i] * weight * value[i] * (T::one() - value[i]);
                    }
                }
                let after = transmittance * (T::one() - alpha);
                let mut depth_gradient = T::zero();
                for i in 0..3 {
                    depth_gradient += pixel_gradient[i] * (after * value[i] - behind[i]);
                    behind[i] += weight * value[i];
                }
                let softplus_slope = T::one() / (T::one() + (-(samples.features[sample] + shift)).exp());
                let mut gradient = depth_gradient * depth_per_density * softplus_slope;
                if field.rules.density_reduction == Reduction::Mean {
                    gradient /= T::of(samples.covering_scales(sample, scales) as f64);
                }
                self.feature_gradients[sample] = gradient;
            }
        }
    }

    /// From colour gradients to those of the layers, the appearance matrices and the components.
    #[inline(always)]
    fn decode_backward(&mut self, field: &Field<T>, layout: &NetworkLayout, scratch: &mut Scratch<T>) {
        let Scratch { activations, color_gradients, input_gradients, output_gradients } = scratch;
        let decoder = &field.decoder;
        let n = activations.colors.len();
        let components = field.component_count();
        self.network_gradients.clear();
        self.network_gradients.resize(layout.len(), T::zero());
        self.component_gradients.resize(n * components, T::zero());
        if n == 0 {
            return;
        }
        std::mem::swap(output_gradients, color_gradients);
        let encoded_direction_at = decoder.input_parts()[2];
        for (l, layer) in decoder.layers.iter().enumerate().rev() {
            let inputs = &activations.inputs[l];
            let (weights_at, bias_at, end) = layout.layers[l];
            multiply(
                MatrixMut::new(
                    &mut self.network_gradients[weights_at..bias_at],
                    layer.outputs,
                    layer.inputs,
                    layer.inputs,
                ),
                Matrix::new(output_gradients, n, layer.outputs, layer.outputs).transposed(),
                Matrix::new(inputs, n, layer.inputs, layer.inputs),
                false,
            );
            let bias_gradients = &mut self.network_gradients[bias_at..end];
            for row in output_gradients.chunks_exact(layer.outputs) {
                for (sum, &g) in bias_gradients.iter_mut().zip(row) {
                    *sum += g;
                }
            }
            // Nothing needs the gradient of the encoded direction.
            let columns = if l == 0 { encoded_direction_at } else { layer.inputs };
            input_gradients.resize(n * columns, T::zero());
            multiply(
                MatrixMut::new(input_gradients, n, columns, columns),
                Matrix::new(output_gradients, n, layer.outputs, layer.outputs),
                Matrix::new(&layer.weights, layer.outputs, columns, layer.inputs),
                false,
            );
            if l > 0 {
                for (g, &rectified) in input_gradients.iter_mut().zip(inputs) {
                    *g = if rectified > T::zero() { *g } else { T::zero() };
                }
            }
            std::mem::swap(output_gradients, input_gradients);
        }
        // `output_gradients` now holds those of the first layer's input.
        encode_backward(field, activations, output_gradients, encoded_direction_at);
        let feature_gradients = Matrix::new(output_gradients, n, decoder.features, encoded_direction_at);
        multiply(
            MatrixMut::new(&mut self.network_gradients[..layout.appearance], decoder.features, components, components),
            feature_gradients.transposed(),
            Matrix::new(&activations.components, n, components, components),
            false,
        );
        multiply(
            MatrixMut::new(&mut self.component_gradients, n, components, components),
            feature_gradients,
            Matrix::new(&decoder.appearance, decoder.features, components, components),
            false,
        );
    }

    /// A stable counting sort of the pairs by tensor.
    fn sort_pairs(&mut self, field: &Field<T>) {
        let samples = &self.samples;
        self.colored_of.clear();
        self.colored_of.resize(samples.len(), NOT_COLORED);
        for (c, &sample) in samples.colored.iter().enumerate() {
            self.colored_of[sample as usize] = c as u32;
        }
        // `pair_starts[n + 1]` counts tensor n, then becomes where it begins, then where it ends.
        self.pair_starts.clear();
        self.pair_starts.resize(field.tensor_count() + 2, 0);
        for pair in &samples.pairs {
            self.pair_starts[pair.tensor as usize + 2] += 1;
        }
        for n in 2..self.pair_starts.len() {
            self.pair_starts[n] += self.pair_starts[n - 1];
        }
        self.pairs.resize(samples.pairs.len(), SortedPair { sample: 0, colored: 0, weight: T::zero() });
        let per_sample = field.scales.len();
        for sample in 0..samples.len() {
            let first = samples.pair_starts[sample * per_sample] as usize;
            let last = samples.pair_starts[(sample + 1) * per_sample] as usize;
            for pair in &samples.pairs[first..last] {
                let at = &mut self.pair_starts[pair.tensor as usize + 1];
                self.pairs[*at as usize] =
                    SortedPair { sample: sample as u32, colored: self.colored_of[sample], weight: pair.weight };
                *at += 1;
            }
        }
        self.pair_starts.pop();
    }

    /// The pairs of `tensor`, counted over all scales.
    #[inline(always)]
    pub(super) fn pairs_of(&self, tensor: usize) -> &[SortedPair<T>] {
        &self.pairs[self.pair_starts[tensor] as usize..self.pair_starts[tensor + 1] as usize]
    }
}

/// Adds the gradients of PE(features) to those of the features, and applies the reduction over scales. `gradients` has
/// rows of `width`: the first layer's input without the encoded direction.
#[inline(always)]
fn encode_backward<T: Real>(field: &Field<T>, activations: &Activations<T>, gradients: &mut [T], width: usize) {
    let decoder = &field.decoder;
    let frequencies = decoder.frequencies[0] as usize;
    let encoded_at = decoder.input_parts()[1];
    let sines_len = decoder.features * frequencies;
    let inputs = activations.inputs[0].chunks_exact(decoder.layers[0].inputs);
    for ((row, input), &reduction) in gradients.chunks_exact_mut(width).zip(inputs).zip(&activations.reductions) {
        let (direct, encoded) = row.split_at_mut(encoded_at);
        let (sine_gradients, cosine_gradients) = encoded.split_at(sines_len);
        let (sines, cosines) = input[encoded_at..].split_at(sines_len);
        for (p, g) in direct[..decoder.features].iter_mut().enumerate() {
            let mut sum = *g;
            let mut frequency = T::one();
            for i in p * frequencies..(p + 1) * frequencies {
                sum += frequency * (sine_gradients[i] * cosines[i] - cosine_gradients[i] * sines[i]);
                frequency += frequency;
            }
            *g = sum * reduction;
        }
    }
}
