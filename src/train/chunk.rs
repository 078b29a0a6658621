//! One chunk of rays, forward and backward: the loss, the gradients of the shared weights, and for each (tensor,
//! sample) pair the inputs of the gradients of its factors.
//!
//! Gradients are written out by hand. With τ = σ·δ·distance_scale, α = 1 − e^−τ and w = T·α, let s_i be ∂L/∂w_i by way
//! of colors (0 for samples without one) and b the gradient of the pixel times the background; then
//! ∂L/∂τ_i = T_{i+1}·s_i − (Σ_{j>i} w_j·s_j + T_end·b). The color behind the scene, of a sky or a background, has the
//! gradient T_end times that of the pixel. If every sample is decoded, s_i is the pixel's gradient times
//! the sample's color. If rays are decoded, the pixel is W·c(F) with W = Σ w and F = Σ w·f / W, so s_i is the pixel's
//! gradient times c plus ∂L/∂F·(f_i − F)/W. If samples have residual colors, the pixel is Σ w·c_i with
//! c_i = sigmoid(own_i + o(F)), so s_i is the pixel's gradient times c_i plus the same.

use super::NetworkLayout;
use super::pairs::TensorPairs;
use strivec_field::{Activations, Field, MAX_LANES, Matrix, MatrixMut, Real, Roulette, Samples, Stage, Work, multiply};
use strivec_format::color_map::ColorMap;
use strivec_format::geometry::Ray;
use strivec_format::model::{DecoderMode, Reduction};

/// The share of a known distance by which visible samples may be nearer or farther. A loss on what is seen farther
/// off gains 2 dB on photographs that were held out (docs/experiments/2026-11-25-regularizing.md).
const DISTANCE_TOLERANCE: f32 = 0.03;

/// Rays of a chunk, whatever the number of threads: results depend on it, so it is fixed.
/// 128 are 10 % faster than 32 (docs/experiments/2026-11-21-step-optimizations.md).
pub(crate) const RAYS_PER_CHUNK: usize = 128;

/// The expected color of a ray.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Target {
    /// The photographed color.
    pub color: [f32; 3],
    /// The background behind a scene without a sky.
    pub background: [f32; 3],
    /// The photograph.
    pub view: u32,
    /// The distance of what the pixel shows, in model units; 0 if unknown.
    pub distance: f32,
    /// How often the ray counts in the loss.
    pub weight: f32,
}

/// Russian roulette of a batch.
#[derive(Clone, Copy, Debug, Default)]
pub struct BatchRoulette {
    /// On the colors of samples, by visibility weight.
    pub color: Option<Roulette>,
    /// On the gradients of samples' densities, by their size in means of a chunk.
    pub density: Option<Roulette>,
}

/// The results of a chunk, for the gradients of tensors and of shared weights. Reused from step to step. All chunks of a
/// batch are kept until it ends, so they hold no more than this.
#[derive(Debug, Default)]
pub(super) struct Chunk<T> {
    /// \[place\] the samples' positions.
    pub(super) positions: Vec<[T; 3]>,
    /// \[row\]\[ΣR\] ∂L/∂(decoded components), and a register more, so that all can be read by registers.
    pub(super) component_gradients: Vec<T>,
    /// \[shaded sample\] ∂L/∂(its components).
    pub(super) shaded_gradients: Vec<ShadedGradient<T>>,
    /// ∂L/∂shared weights, in the flat layout.
    pub(super) network_gradients: Vec<T>,
    /// Pairs of all samples, weighted with the gradients of their density features.
    pub(super) density_pairs: TensorPairs<T>,
    /// Pairs of the shaded samples.
    pub(super) appearance_pairs: TensorPairs<T>,
    /// \[ray\] the scene's color.
    pub(super) colors: Vec<[f32; 3]>,
    /// \[ray\] the mean over channels of the squared error.
    pub(super) squared_errors: Vec<f32>,
    /// Σ over rays and channels of the squared error, times the ray's weight.
    pub(super) squared_error: f64,
    /// Σ over rays of known distance of the visibility that is elsewhere, times the ray's weight.
    pub(super) misplaced: f64,
    /// Counts and times.
    pub(super) work: Work,
}

/// The gradients of a shaded sample's components: `share` times a row of the component gradients, and, if samples have
/// residual colors, Σ over channels of `own` times a row of the appearance matrices.
#[derive(Clone, Copy, Debug)]
pub(super) struct ShadedGradient<T> {
    pub(super) row: u32,
    pub(super) share: T,
    /// ∂L/∂(the sample's color before the sigmoid).
    pub(super) own: [T; 3],
}

/// Buffers of a thread for the work on a chunk. Reused.
#[derive(Debug, Default)]
pub(super) struct Scratch<T> {
    samples: Samples<T>,
    activations: Activations<T>,
    /// \[ray\] the color behind the scene.
    behind: Vec<[T; 3]>,
    /// \[ray\] ∂L/∂pixel.
    pixel_gradients: Vec<[T; 3]>,
    /// \[shaded sample\] ∂L/∂(the sample's weight), by way of colors.
    weight_gradients: Vec<T>,
    /// \[place\] ∂L/∂(a scale's density feature).
    feature_gradients: Vec<T>,
    input_gradients: Vec<T>,
    output_gradients: Vec<T>,
    /// \[term\]\[3\] ∂L/∂(a color before the sigmoid), if samples have residual colors.
    term_gradients: Vec<T>,
}

/// The terms of the loss.
pub(super) struct LossTerms<'a, T> {
    /// \[view\] the maps from the scene's colors to those of photographs; none if empty.
    pub(super) maps: &'a [ColorMap],
    /// Factor of the squared errors of colors.
    pub(super) color_scale: T,
    /// Factor of the visibility that is not at known distances.
    pub(super) distance_scale: T,
    /// A sky has gradients only of rays without samples.
    pub(super) sky_of_open_rays: bool,
}

impl<T: Real> Chunk<T> {
    /// Marches and decodes `rays`, compares them with `targets`, and computes the gradients of the loss, which is the sum of
    /// `terms`.
    #[inline(always)]
    #[expect(clippy::too_many_arguments, reason = "the inputs of a chunk have different owners")]
    pub(super) fn run(
        &mut self,
        field: &Field<T>,
        layout: &NetworkLayout,
        rays: &[Ray],
        targets: &[Target],
        terms: &LossTerms<'_, T>,
        roulette: BatchRoulette,
        scratch: &mut Scratch<T>,
    ) {
        field.march(rays, &mut scratch.samples);
        field.select_shaded(&scratch.samples, roulette.color, &mut scratch.activations.shaded);
        // The gradient of a weight needs the components of its own sample.
        scratch.activations.keeps_components = true;
        field.decode(rays, &mut scratch.samples, &mut scratch.activations);
        scratch.behind.clear();
        let behind = |(ray, target): (&Ray, &Target)| field.behind(ray, target.background.map(T::of_f32));
        scratch.behind.extend(rays.iter().zip(targets).map(behind));
        self.compare(field, targets, terms, scratch);
        scratch.samples.clock.lap(Stage::CompositeBackward);
        self.decode_backward(field, layout, scratch);
        self.sky_backward(field, layout, rays, terms.sky_of_open_rays, scratch);
        self.weigh_backward(field, scratch);
        self.composite_backward(field, targets, terms.distance_scale, scratch);
        if let Some(roulette) = roulette.density {
            density_roulette(roulette, &scratch.samples, &mut scratch.feature_gradients);
        }
        scratch.samples.clock.lap(Stage::CompositeBackward);
        self.sort_pairs(field, scratch);
        let Samples { positions, clock, .. } = &mut scratch.samples;
        // The chunk takes the positions, and the next march gets the buffer of the step before: nothing is copied.
        std::mem::swap(&mut self.positions, positions);
        clock.lap(Stage::ContributionOrder);
        self.work.clone_from(&clock.work);
    }

    /// Pixels, loss, and the gradients of pixels, of colors before the sigmoid and of the decoder's outputs.
    #[inline(always)]
    fn compare(&mut self, field: &Field<T>, targets: &[Target], terms: &LossTerms<'_, T>, scratch: &mut Scratch<T>) {
        let Scratch { samples, activations, behind, pixel_gradients, term_gradients, output_gradients, .. } = scratch;
        self.squared_error = 0.0;
        self.colors.clear();
        self.squared_errors.clear();
        pixel_gradients.clear();
        term_gradients.clear();
        for (ray, target) in targets.iter().enumerate() {
            let remaining = samples.remaining[ray];
            let color = activations.pixel(ray, T::one(), behind[ray].map(|c| remaining * c));
            self.colors.push(color.map(|c| c.f64() as f32));
            let map = terms.maps.get(target.view as usize);
            let seen = map.map_or(color, |map| map.apply(color.map(T::f64)).map(T::of));
            let error = [0, 1, 2].map(|i| seen[i] - T::of_f32(target.color[i]));
            let weight = T::of_f32(target.weight);
            let squared = error.iter().map(|e| e.f64() * e.f64()).sum::<f64>();
            self.squared_errors.push((squared / 3.0) as f32);
            self.squared_error += weight.f64() * squared;
            let gradient = error.map(|e| (e + e) * terms.color_scale * weight);
            // The error is of mapped colors, and the scene learns unmapped ones: the gradient goes back through the
            // map.
            let gradient = map.map_or(gradient, |map| map.pull_back(gradient.map(T::f64)).map(T::of));
            pixel_gradients.push(gradient);
            for term in activations.terms_of_ray(ray) {
                let (weight, color) = (activations.weights[term], activations.colors[term]);
                // c·(1 − c) is the derivative of the sigmoid.
                term_gradients.extend([0, 1, 2].map(|i| gradient[i] * weight * color[i] * (T::one() - color[i])));
            }
        }
        if field.decoder.mode != DecoderMode::Residual {
            // Terms are rows.
            std::mem::swap(output_gradients, term_gradients);
            return;
        }
        output_gradients.clear();
        for terms in (0..targets.len()).map(|ray| activations.terms_of_ray(ray)).filter(|terms| !terms.is_empty()) {
            let mut sums = [T::zero(); 3];
            for of_term in term_gradients[3 * terms.start..3 * terms.end].chunks_exact(3) {
                sums.iter_mut().zip(of_term).for_each(|(sum, &g)| *sum += g);
            }
            output_gradients.extend(sums);
        }
    }

    /// `shaded_gradients`, and the gradients of the samples' weights.
    #[inline(always)]
    fn weigh_backward(&mut self, field: &Field<T>, scratch: &mut Scratch<T>) {
        let Scratch { samples, activations, pixel_gradients, weight_gradients, term_gradients, .. } = scratch;
        let shaded = &activations.shaded;
        let (mode, width) = (field.decoder.mode, field.component_count());
        self.shaded_gradients.clear();
        weight_gradients.clear();
        for (ray, gradient) in pixel_gradients.iter().enumerate() {
            let ray_row = activations.rows_of_ray(ray).start;
            for c in shaded.ray_range(ray) {
                let (term, row) = match mode {
                    DecoderMode::PerSample => (c, c),
                    DecoderMode::PerRay => (ray_row, ray_row),
                    DecoderMode::Residual => (c, ray_row),
                };
                let color = activations.colors[term];
                let mut sum = gradient[0] * color[0] + gradient[1] * color[1] + gradient[2] * color[2];
                let mut share = activations.reductions.get(c).copied().unwrap_or(T::one());
                let own = match mode {
                    DecoderMode::PerSample | DecoderMode::PerRay => [T::zero(); 3],
                    DecoderMode::Residual => [0, 1, 2].map(|p| share * term_gradients[3 * c + p]),
                };
                if mode != DecoderMode::PerSample {
                    let weight = activations.composite_weights[ray_row];
                    // ∂L/∂F·(f − F)/W: a sample's weight also moves the mean that is decoded.
                    sum += difference_along(
                        &self.component_gradients[ray_row * width..][..width],
                        &activations.components[c * width..][..width],
                        &activations.composites[ray_row * width..][..width],
                    ) / weight;
                    share *= shaded.weights[c] / weight;
                }
                // With Russian roulette, the weight of a sample's color may exceed the sample's weight.
                let place = shaded.slots[c] as usize;
                weight_gradients.push(sum * shaded.weights[c] / samples.weight(place));
                self.shaded_gradients.push(ShadedGradient { row: row as u32, share, own });
            }
        }
        scratch.samples.clock.lap(Stage::CompositeBackward);
    }

    /// From the gradients of weights to those of density features. Where a ray's distance is known, the loss has
    /// 1 − Σ w over the samples near it, times `distance_scale`, so that their weights have the gradient −`distance_scale`.
    #[inline(always)]
    fn composite_backward(
        &mut self,
        field: &Field<T>,
        targets: &[Target],
        distance_scale: T,
        scratch: &mut Scratch<T>,
    ) {
        let Scratch {
            samples,
            activations,
            behind: colors_behind,
            pixel_gradients,
            weight_gradients,
            feature_gradients,
            ..
        } = scratch;
        let shaded = &activations.shaded;
        let scales = field.scales.len();
        let mut misplaced_sum = 0.0;
        // Slopes first: a loop without branches.
        feature_gradients.clear();
        feature_gradients.extend(samples.features.iter().map(|&feature| field.optical_depth_slope(feature)));
        for (ray, (gradient, color_behind)) in pixel_gradients.iter().zip(colors_behind.iter()).enumerate() {
            let mut behind = T::zero();
            for i in 0..3 {
                behind += samples.remaining[ray] * color_behind[i] * gradient[i];
            }
            // Linear in the weights, so that a wrong point pulls no harder the farther off it is
            // (docs/experiments/2026-11-25-regularizing.md).
            let [nearest, farthest] =
                [-1.0, 1.0].map(|side| T::of_f32(targets[ray].distance * (1.0 + side * DISTANCE_TOLERANCE)));
            let weight = T::of_f32(targets[ray].weight);
            let is_known = distance_scale > T::zero() && targets[ray].distance > 0.0;
            let mut misplaced = if is_known { T::one() } else { T::zero() };
            let mut ray_range = shaded.ray_range(ray);
            // From the end, so that `behind` is the sum over all samples behind without another pass.
            for &place in samples.order[samples.ray_range(ray)].iter().rev() {
                let mut weight_gradient = T::zero();
                let distance = samples.distances[place as usize];
                if is_known && distance >= nearest && distance <= farthest {
                    weight_gradient = -distance_scale * weight;
                    misplaced -= samples.weight(place as usize);
                }
                if ray_range.end > ray_range.start && shaded.slots[ray_range.end - 1] == place {
                    ray_range.end -= 1;
                    weight_gradient += weight_gradients[ray_range.end];
                }
                let place = place as usize;
                let after = samples.transmittances[place] * (T::one() - samples.alphas[place]);
                let depth_gradient = after * weight_gradient - behind;
                behind += samples.weight(place) * weight_gradient;
                let mut gradient = depth_gradient * feature_gradients[place];
                if field.rules.density_reduction == Reduction::Mean {
                    gradient /= T::of(samples.covering_scales(place, scales) as f64);
                }
                feature_gradients[place] = gradient;
            }
            misplaced_sum += weight.f64() * misplaced.f64();
        }
        self.misplaced = misplaced_sum;
    }

    /// From the gradients of the rows' outputs to those of the layers, the appearance matrices and the components.
    #[inline(always)]
    fn decode_backward(&mut self, field: &Field<T>, layout: &NetworkLayout, scratch: &mut Scratch<T>) {
        let rows = scratch.activations.row_count();
        self.network_gradients.clear();
        self.network_gradients.resize(layout.len(), T::zero());
        // A register of room at the end: a call that copied the last row kept the compiler from holding registers,
        // and appearance gradients took 20 instead of 14 core ms (docs/experiments/2026-11-26-rays-by-error.md).
        self.component_gradients.resize(rows * field.component_count() + MAX_LANES, T::zero());
        if rows == 0 {
            return;
        }
        let Scratch { samples, activations, input_gradients, output_gradients, .. } = scratch;
        let gradients = self.layers_backward(field, layout, activations, [output_gradients, input_gradients]);
        samples.clock.lap(Stage::DecoderBackward);
        encode_backward(field, activations, gradients, field.decoder.input_parts()[2]);
        samples.clock.lap(Stage::EncodingBackward);
        self.matrices_backward(field, layout, activations, gradients);
        if field.decoder.mode == DecoderMode::Residual {
            self.residuals_backward(field, scratch);
        }
        scratch.samples.clock.lap(Stage::AppearanceMatricesBackward);
    }

    /// From the gradients of the rows' outputs, the first of `buffers`, to those of the layers. Returns the gradients of the
    /// first layer's input, \[row\]\[input\], without the encoded direction; they lie in one of `buffers`.
    #[inline(always)]
    fn layers_backward<'b>(
        &mut self,
        field: &Field<T>,
        layout: &NetworkLayout,
        activations: &Activations<T>,
        buffers: [&'b mut Vec<T>; 2],
    ) -> &'b mut [T] {
        let [mut output_gradients, mut input_gradients] = buffers;
        let decoder = &field.decoder;
        let n = activations.row_count();
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
            // The gradient of the encoded direction is not used.
            let columns = if l == 0 { decoder.input_parts()[2] } else { layer.inputs };
            input_gradients.resize(n * columns, T::zero());
            multiply(
                MatrixMut::new(input_gradients, n, columns, columns),
                Matrix::new(output_gradients, n, layer.outputs, layer.outputs),
                Matrix::new(&layer.weights, layer.outputs, columns, layer.inputs),
                false,
            );
            if l > 0 {
                for (g, &rectified) in input_gradients.iter_mut().zip(inputs) {
                    // A select, not a branch, so that the loop vectorizes.
                    *g = if rectified > T::zero() { *g } else { T::zero() };
                }
            }
            // The input of a layer is the output of the one before. The references change places, not the buffers.
            std::mem::swap(&mut output_gradients, &mut input_gradients);
        }
        output_gradients
    }

    /// From the gradients of the features, which are the first numbers of each row of `input_gradients`, to those of the
    /// appearance matrices and the rows' components.
    #[inline(always)]
    fn matrices_backward(
        &mut self,
        field: &Field<T>,
        layout: &NetworkLayout,
        activations: &Activations<T>,
        input_gradients: &[T],
    ) {
        let decoder = &field.decoder;
        let (n, components) = (activations.row_count(), field.component_count());
        let feature_gradients = Matrix::new(input_gradients, n, decoder.features, decoder.input_parts()[2]);
        multiply(
            MatrixMut::new(&mut self.network_gradients[..layout.appearance], decoder.features, components, components),
            feature_gradients.transposed(),
            Matrix::new(activations.decoded_components(decoder.mode), n, components, components),
            false,
        );
        multiply(
            MatrixMut::new(&mut self.component_gradients, n, components, components),
            feature_gradients,
            Matrix::new(&decoder.appearance, decoder.features, components, components),
            false,
        );
    }

    /// From the gradients of the samples' residual colors to those of the first three rows of the appearance matrices.
    #[inline(always)]
    fn residuals_backward(&mut self, field: &Field<T>, scratch: &Scratch<T>) {
        let Scratch { activations, term_gradients, .. } = scratch;
        let (components, count) = (field.component_count(), activations.shaded.len());
        multiply(
            MatrixMut::new(&mut self.network_gradients[..3 * components], 3, components, components),
            Matrix::new(term_gradients, count, 3, 3).transposed(),
            Matrix::new(&activations.components, count, components, components),
            true,
        );
    }

    /// The gradients of the sky's coefficients; of `open_rays`, those without samples, alone if that is true.
    #[inline(always)]
    fn sky_backward(
        &mut self,
        field: &Field<T>,
        layout: &NetworkLayout,
        rays: &[Ray],
        open_rays: bool,
        scratch: &Scratch<T>,
    ) {
        // A sky that learns from all rays takes the color of walls before their density grows, and then none does:
        // 15.9 instead of 21.3 dB (docs/experiments/2026-11-25-surroundings.md).
        let Some(sky) = &field.sky else { return };
        let gradients = &mut self.network_gradients[layout.sky_at()..];
        for (n, ray) in rays.iter().enumerate().filter(|&(n, _)| !open_rays || scratch.samples.ray_range(n).is_empty())
        {
            let color_gradient = scratch.pixel_gradients[n].map(|g| scratch.samples.remaining[n] * g);
            sky.add_gradients(ray.direction, scratch.behind[n], color_gradient, gradients);
        }
    }

    /// Fills the pairs by tensor.
    fn sort_pairs(&mut self, field: &Field<T>, scratch: &Scratch<T>) {
        let (samples, scales, tensors) = (&scratch.samples, field.scales.len(), field.tensor_count());
        let gradients = &scratch.feature_gradients;
        let counted = samples.order.iter().map(|&place| (place, 0, gradients[place as usize]));
        // Dropped gradients have no pairs. Density and appearance are sorted apart, as few samples are shaded.
        let counted = counted.filter(|&(.., gradient)| gradient != T::zero());
        self.density_pairs.sort(samples, scales, tensors, counted);
        let shaded = scratch.activations.shaded.slots.iter().zip(0..).map(|(&place, shaded)| (place, shaded, T::one()));
        self.appearance_pairs.sort(samples, scales, tensors, shaded);
    }
}

/// Russian roulette on the small gradients of density features.
#[inline(always)]
fn density_roulette<T: Real>(roulette: Roulette, samples: &Samples<T>, gradients: &mut [T]) {
    // Relative to the mean, as gradients shrink over a training. At a threshold of one mean, the density stage takes
    // a fifth of its time (docs/experiments/2026-11-21-step-optimizations.md).
    let total: T = samples.order.iter().map(|&place| gradients[place as usize].abs()).sum();
    let mean = total.f64() / samples.len().max(1) as f64;
    let roulette = Roulette { below: roulette.below * mean, ..roulette };
    for ray in 0..samples.remaining.len() {
        for (n, &place) in samples.order[samples.ray_range(ray)].iter().enumerate() {
            let gradient = &mut gradients[place as usize];
            *gradient = roulette.reweight(gradient.abs(), ray, n).copysign(*gradient);
        }
    }
}

/// Σ gradient·(from − to).
#[inline(always)]
fn difference_along<T: Real>(gradient: &[T], from: &[T], to: &[T]) -> T {
    // Sixteen sums, because the compiler may not reorder one: it would leave the loop scalar.
    let mut sums = [T::zero(); 16];
    let (gradients, gradient_rest) = gradient.as_chunks::<16>();
    let (froms, from_rest) = from.as_chunks::<16>();
    let (tos, to_rest) = to.as_chunks::<16>();
    for ((g, f), t) in gradients.iter().zip(froms).zip(tos) {
        for l in 0..16 {
            sums[l] += g[l] * (f[l] - t[l]);
        }
    }
    let rest: T = gradient_rest.iter().zip(from_rest).zip(to_rest).map(|((&g, &f), &t)| g * (f - t)).sum();
    sums.into_iter().fold(rest, |sum, s| sum + s)
}

/// Adds the gradients of PE(features) to those of the features. `gradients` has rows of `width`: the first layer's
/// input without the encoded direction.
#[inline(always)]
fn encode_backward<T: Real>(field: &Field<T>, activations: &Activations<T>, gradients: &mut [T], width: usize) {
    let decoder = &field.decoder;
    let frequencies = decoder.frequencies[0] as usize;
    let encoded_at = decoder.input_parts()[1];
    let sines_len = decoder.features * frequencies;
    let inputs = activations.inputs[0].chunks_exact(decoder.layers[0].inputs);
    for (row, input) in gradients.chunks_exact_mut(width).zip(inputs) {
        let (direct, encoded) = row.split_at_mut(encoded_at);
        let (sine_gradients, cosine_gradients) = encoded.split_at(sines_len);
        let (sines, cosines) = input[encoded_at..].split_at(sines_len);
        for (p, g) in direct[..decoder.features].iter_mut().enumerate() {
            let mut sum = *g;
            let mut frequency = T::one();
            for i in p * frequencies..(p + 1) * frequencies {
                // The derivative of a sine is the cosine that the forward pass stored, and the other way around: no
                // function is evaluated.
                sum += frequency * (sine_gradients[i] * cosines[i] - cosine_gradients[i] * sines[i]);
                frequency += frequency;
            }
            *g = sum;
        }
    }
}
