//! Appearance and decoder for many samples at once, as matrix products (spec 4.6 and 4.7). Twins:
//! `shaders/decoder.wgsl`, `shaders/resolve.wgsl`.

use pulp::{Arch, Simd, WithSimd};

use super::samples::count_contributions;
use super::{Field, Matrix, MatrixMut, Real, Samples, ShadedSamples, Stage, Work, multiply};
use strivec_format::geometry::Ray;
use strivec_format::model::{DecoderMode, Reduction};

/// The decoder's activations for a batch of rays. Reused from one batch to the next.
///
/// A *row* is one evaluation of the decoder: a shaded sample or, in the modes that decode rays, a ray with shaded
/// samples. A *term* is a color in a pixel's sum: one per row or, in mode *residual*, one per shaded sample.
#[derive(Clone, Debug, Default)]
pub struct Activations<T> {
    /// The shaded samples.
    pub shaded: ShadedSamples<T>,
    /// \[shaded\]\[ΣR\] aggregated appearance components, after the reduction over scales. Where rays are decoded, those
    /// of the last sample alone unless `keeps_components` is set.
    pub components: Vec<T>,
    /// True if gradients need the components of all samples.
    pub keeps_components: bool,
    /// \[shaded\] 1 over the number of covering scales; empty if the appearance reduction is *sum*.
    pub reductions: Vec<T>,
    /// \[row\]\[ΣR\] the rays' composited components; empty if samples are decoded.
    pub composites: Vec<T>,
    /// \[row\] Σ w of the composited samples; empty if samples are decoded.
    pub composite_weights: Vec<T>,
    /// \[ray\] its first row; then the number of rows.
    pub ray_rows: Vec<u32>,
    /// \[term\] its weight in its pixel.
    pub weights: Vec<T>,
    /// \[ray\] its first term; then the number of terms.
    pub ray_terms: Vec<u32>,
    /// \[layer\]\[row\]\[input\] the inputs of each layer: the encoded features, then each layer's rectified outputs.
    pub inputs: Vec<Vec<T>>,
    /// \[term\] sRGB colors in [0, 1].
    pub colors: Vec<[T; 3]>,
    /// \[row\]\[3\] the last layer's outputs.
    outputs: Vec<T>,
    /// \[shaded\]\[3\] the samples' first three features, then their sums with their row's outputs. Mode *residual*
    /// only.
    own_colors: Vec<T>,
    direction: Vec<T>,
    angles: Vec<T>,
}

impl<T: Real> Activations<T> {
    /// \[row\]\[ΣR\] the components that the appearance matrices multiply.
    pub fn decoded_components(&self, mode: DecoderMode) -> &[T] {
        match mode {
            DecoderMode::PerSample => &self.components,
            DecoderMode::PerRay | DecoderMode::Residual => &self.composites,
        }
    }

    /// Number of rows.
    pub fn row_count(&self) -> usize {
        self.ray_rows.last().map_or(0, |&count| count as usize)
    }

    /// The rows of `ray`.
    pub fn rows_of_ray(&self, ray: usize) -> std::ops::Range<usize> {
        self.ray_rows[ray] as usize..self.ray_rows[ray + 1] as usize
    }

    /// The terms of `ray`.
    pub fn terms_of_ray(&self, ray: usize) -> std::ops::Range<usize> {
        self.ray_terms[ray] as usize..self.ray_terms[ray + 1] as usize
    }

    /// The color of `ray`: its terms, of `scale` times their weights, composited over `behind`.
    #[inline(always)]
    pub fn pixel(&self, ray: usize, scale: T, behind: [T; 3]) -> [T; 3] {
        let mut color = behind;
        for term in self.terms_of_ray(ray) {
            for (sum, &value) in color.iter_mut().zip(&self.colors[term]) {
                *sum += scale * self.weights[term] * value;
            }
        }
        color
    }
}

/// Writes PE(`values`) (spec 4.7): all sines, then all cosines, frequencies fastest. Each frequency is computed by
/// doubling the angle of the one before, with an error of 2^(f−1)·ε at frequency f (docs/numerics.md), which is cheaper
/// than a sine each. `angles` is scratch for sines and cosines side by side, so that the loop
/// vectorizes.
#[inline(always)]
fn encode<T: Real>(values: &[T], frequencies: usize, encoded: &mut [T], angles: &mut Vec<T>) {
    let n = values.len();
    angles.resize(2 * n, T::zero());
    let (first_sines, first_cosines) = angles.split_at_mut(n);
    for ((s, c), &value) in first_sines.iter_mut().zip(first_cosines.iter_mut()).zip(values) {
        (*s, *c) = value.sine_cosine();
    }
    let (sines, cosines) = encoded.split_at_mut(n * frequencies);
    for frequency in 0..frequencies {
        for (encoded, known) in [(&mut *sines, &*first_sines), (&mut *cosines, &*first_cosines)] {
            encoded.iter_mut().skip(frequency).step_by(frequencies).zip(known).for_each(|(to, &from)| *to = from);
        }
        for (s, c) in first_sines.iter_mut().zip(first_cosines.iter_mut()) {
            (*s, *c) = ((*s + *s) * *c, T::one() - (*s + *s) * *s);
        }
    }
}

impl<T: Real> Field<T> {
    /// Computes the colors of `activations.shaded`, which selects from the `samples` of `rays`.
    #[inline(always)]
    pub fn decode(&self, rays: &[Ray], samples: &mut Samples<T>, activations: &mut Activations<T>) {
        self.compose_rows(activations);
        samples.clock.lap(Stage::Composite);
        Arch::new().dispatch(GatherAppearance { field: self, samples, activations });
        samples.clock.lap(Stage::AppearanceGather);
        self.multiply_appearance(activations);
        samples.clock.lap(Stage::AppearanceMatrices);
        self.encode_inputs(rays, activations);
        samples.clock.lap(Stage::Encoding);
        self.run_layers(activations);
        samples.clock.lap(Stage::Decoder);
        let work = &mut samples.clock.work;
        let slots = activations.shaded.slots.iter().map(|&slot| slot as usize);
        // A march may be decoded in parts, so the counts are added.
        work.add(&Work {
            shaded: activations.shaded.len() as u64,
            shaded_contributions: count_contributions(&samples.neighborhoods, slots, self.scales.len()),
            decoded: activations.row_count() as u64,
            ..Work::default()
        });
    }

    /// Fills rows, terms and their weights.
    #[inline(always)]
    fn compose_rows(&self, activations: &mut Activations<T>) {
        let mode = self.decoder.mode;
        let Activations { shaded, composite_weights, ray_rows, weights, ray_terms, .. } = activations;
        composite_weights.clear();
        // A ray without shaded samples has no row: nothing is decoded for it.
        if mode == DecoderMode::PerSample {
            ray_rows.clone_from(&shaded.ray_starts);
        } else {
            ray_rows.clear();
            ray_rows.push(0);
            for samples in shaded.ray_starts.windows(2).map(|ends| ends[0] as usize..ends[1] as usize) {
                if !samples.is_empty() {
                    composite_weights.push(shaded.weights[samples].iter().copied().sum());
                }
                ray_rows.push(composite_weights.len() as u32);
            }
        }
        if mode == DecoderMode::PerRay {
            weights.clone_from(composite_weights);
            ray_terms.clone_from(ray_rows);
        } else {
            weights.clone_from(&shaded.weights);
            ray_terms.clone_from(&shaded.ray_starts);
        }
    }

    /// Fills the features in the first layer's inputs.
    #[inline(always)]
    fn multiply_appearance(&self, activations: &mut Activations<T>) {
        let decoder = &self.decoder;
        let n = activations.row_count();
        let components = self.component_count();
        let inputs = decoder.layers[0].inputs;
        let mut all_inputs = std::mem::take(&mut activations.inputs);
        all_inputs.resize(decoder.layers.len(), Vec::new());
        let rows = &mut all_inputs[0];
        rows.resize(n * inputs, T::zero());
        multiply(
            // Straight into the first columns of the first layer's input, so that features are not copied.
            MatrixMut::new(rows, n, decoder.features, inputs),
            Matrix::new(activations.decoded_components(decoder.mode), n, components, components),
            Matrix::new(&decoder.appearance, decoder.features, components, components).transposed(),
            false,
        );
        activations.inputs = all_inputs;
    }

    /// Writes the aggregated appearance components of the sample in `slot`, after the reduction over scales, to the first ΣR
    /// numbers of `row`, and anything to the [`row_padding`] behind them. Returns the reduction, 1 over the number of covering
    /// scales, if it is a mean. Adds to `count` the components that were read.
    #[inline(always)]
    pub(super) fn appearance_row<S: Simd>(
        &self,
        simd: S,
        samples: &Samples<T>,
        slot: usize,
        row: &mut [T],
        count: &mut usize,
    ) -> Option<T> {
        let scales = self.scales.len();
        let mut end = 0;
        for (s, scale) in self.scales.iter().enumerate() {
            scale.appearance_of(simd, samples.contributions_of(slot, s, scales), &mut row[end..], count);
            end += scale.appearance_rank();
        }
        (self.rules.appearance_reduction == Reduction::Mean).then(|| {
            let reduction = T::one() / T::of(samples.covering_scales(slot, scales).max(1) as f64);
            row[..end].iter_mut().for_each(|v| *v *= reduction);
            reduction
        })
    }

    /// Fills direction, PE(features) and PE(direction) in the first layer's inputs.
    #[inline(always)]
    fn encode_inputs(&self, rays: &[Ray], activations: &mut Activations<T>) {
        let decoder = &self.decoder;
        let features = decoder.features;
        let inputs = decoder.layers[0].inputs;
        let Activations { inputs: all_inputs, ray_rows, direction: encoded_direction, angles, .. } = activations;
        let [direction_at, encoded_at, encoded_direction_at] = decoder.input_parts();
        encoded_direction.resize(inputs - encoded_direction_at, T::zero());
        // Directions of rays without rows are not encoded, which halves the stage
        // (docs/experiments/2026-11-26-frame-in-tiles.md).
        for (ray, rows) in rays.iter().zip(ray_rows.windows(2)).filter(|(_, rows)| rows[0] < rows[1]) {
            let direction = ray.direction.to_array().map(T::of);
            encode(&direction, decoder.frequencies[1] as usize, encoded_direction, angles);
            for row in all_inputs[0][rows[0] as usize * inputs..rows[1] as usize * inputs].chunks_exact_mut(inputs) {
                row[direction_at..encoded_at].copy_from_slice(&direction);
                let (values, encoded) = row[..encoded_direction_at].split_at_mut(encoded_at);
                encode(&values[..features], decoder.frequencies[0] as usize, encoded, angles);
                row[encoded_direction_at..].copy_from_slice(encoded_direction);
            }
        }
    }

    /// Evaluates the layers: fills the inputs of the layers after the first, and `colors`.
    #[inline(always)]
    fn run_layers(&self, activations: &mut Activations<T>) {
        let n = activations.row_count();
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
            // Bias and rectifier in one pass; the last layer has no rectifier.
            let floor = if last { T::neg_infinity() } else { T::zero() };
            for row in outputs.chunks_exact_mut(layer.outputs) {
                for (v, &b) in row.iter_mut().zip(&layer.bias) {
                    *v = (*v + b).max(floor);
                }
            }
        }
        let Activations { shaded, ray_rows, outputs, own_colors, colors, .. } = activations;
        let terms = match self.decoder.mode {
            DecoderMode::PerSample | DecoderMode::PerRay => outputs,
            DecoderMode::Residual => {
                for (samples, rows) in shaded.ray_starts.windows(2).zip(ray_rows.windows(2)) {
                    for own in own_colors[3 * samples[0] as usize..3 * samples[1] as usize].chunks_exact_mut(3) {
                        own.iter_mut().zip(&outputs[3 * rows[0] as usize..]).for_each(|(sum, &v)| *sum += v);
                    }
                }
                own_colors
            }
        };
        // e^−x may overflow; then the result is 0, as it should be.
        let sigmoid = |x: T| T::one() / (T::one() + (-x).exp());
        colors.clear();
        colors.extend(terms.chunks_exact(3).map(|c| [0, 1, 2].map(|i| sigmoid(c[i]))));
    }
}

/// The numbers behind a row of appearance components that registers may write to.
#[inline(always)]
pub(super) fn row_padding<T: Real, S: Simd>() -> usize {
    3 * T::lanes::<S>()
}

/// Fills `components`, `reductions`, where rays are decoded `composites` (Σ w·f / Σ w), and in mode *residual*
/// `own_colors`.
struct GatherAppearance<'a, T> {
    field: &'a Field<T>,
    samples: &'a mut Samples<T>,
    activations: &'a mut Activations<T>,
}

impl<T: Real> WithSimd for GatherAppearance<'_, T> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { field, samples, activations } = self;
        let (width, mode) = (field.component_count(), field.decoder.mode);
        let Activations { shaded, components, composites, composite_weights, ray_rows, .. } = activations;
        // Rendering composites a row while it is in the nearest cache and keeps none: compositing takes two thirds of
        // the time (docs/experiments/2026-11-26-frame-in-tiles.md).
        let is_kept = activations.keeps_components || mode == DecoderMode::PerSample;
        let padding = row_padding::<T, S>();
        components.resize(width * if is_kept { shaded.len() } else { 1 } + padding, T::zero());
        composites.clear();
        composites.resize(width * composite_weights.len(), T::zero());
        activations.reductions.clear();
        activations.own_colors.clear();
        let mut count = 0;
        for (ray, rows) in ray_rows.windows(2).enumerate() {
            for sample in shaded.ray_range(ray) {
                let slot = shaded.slots[sample] as usize;
                let row = &mut components[width * if is_kept { sample } else { 0 }..][..width + padding];
                activations.reductions.extend(field.appearance_row(simd, samples, slot, row, &mut count));
                let row = &mut row[..width];
                if mode == DecoderMode::Residual {
                    // Three features while the row is at hand; with a matrix product afterwards, appearance and
                    // matrices took a fifth longer (docs/experiments/2026-11-25-lean-training.md).
                    activations.own_colors.extend(field.decoder.own_color(simd, row));
                }
                if mode != DecoderMode::PerSample {
                    let decoded = rows[0] as usize;
                    // F is a mean, Σ w·f / Σ w, so that the decoder's input does not fade with the opacity.
                    let share = shaded.weights[sample] / composite_weights[decoded];
                    let composite = &mut composites[decoded * width..][..width];
                    composite.iter_mut().zip(row).for_each(|(sum, v)| *sum += share * *v);
                }
            }
        }
        components.truncate(components.len() - padding);
        samples.clock.work.appearance_components += count as u64;
    }
}
