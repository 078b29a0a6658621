//! A scene as the shaders read it: one array of quads, and the indices of everything in it.

use super::error::GpuError;
use super::layout::{PackedLayer, PackedScale, SceneHead};
use super::shader::{Extensions, Precision, ShaderShape, TEXTURE_SHIFT};
use crate::render::approximation::OwnThresholds;
use crate::{Dense, Field, FieldFactors, FieldScale, FieldSky};
use strivec_format::model::Form;

/// A device's limits for a scene.
#[derive(Clone, Copy, Debug)]
pub(super) struct BufferLimits {
    /// The most bindings of the scene buffer.
    pub(super) chunks: u32,
    /// Log₂ of the quads of one binding.
    pub(super) chunk_shift: u32,
    /// Bytes of workgroup memory.
    pub(super) workgroup_bytes: u32,
    pub(super) extensions: Extensions,
    /// See [`ShaderShape::is_software`].
    pub(super) is_software: bool,
    /// The most rows of a texture.
    pub(super) texture_rows: u32,
}

/// A scene, packed for a device.
pub(super) struct Packed {
    pub(super) shape: ShaderShape,
    /// The bytes of the uniform `scene`: head, layers, scales, sky.
    pub(super) scene: Vec<u8>,
    /// The scene buffer; a multiple of four words.
    pub(super) words: Vec<u32>,
    /// The most loop iterations of the march per sample.
    pub(super) iterations_per_sample: u32,
}

impl Packed {
    /// Packs `field` within `limits`; its scene's thresholds were `own` (see [`crate::render::Approximation`]).
    pub(super) fn new(
        field: &Field<f32>,
        own: &OwnThresholds,
        precision: Precision,
        limits: BufferLimits,
    ) -> Result<Self, GpuError> {
        let mut words = Words::default();
        let mut component_quads = 0;
        let has_matrices = field.scales.iter().any(|scale| scale.density.iter().any(|block| block.form() != Form::Cp));
        // Scenes of three vectors alone have one block a scale, and shaders without branches for others.
        let blocks = if has_matrices { 3 } else { 1 };
        let scales: Vec<PackedScale> = (field.scales.iter())
            .map(|scale| {
                let packed = words.scale(scale, precision, blocks, component_quads);
                component_quads += scale.appearance.iter().map(block_quads).sum::<u32>();
                packed
            })
            .collect();
        let cells = field.cells();
        let [grid_masks, grid_distances] = cells
            .map_or([0; 2], |cells| [halves(&cells.masks), fours(&cells.distances)].map(|packed| words.push(&packed)));
        let appearance = words.appearance(field, component_quads);
        let layers: Vec<PackedLayer> = field.decoder.layers.iter().map(|layer| words.layer(layer)).collect();
        let shape = ShaderShape {
            chunks: (words.quads().div_ceil(1 << limits.chunk_shift)).max(1) as u32,
            component_quads,
            blocks: blocks as u32,
            ..shape_of(field, precision, limits, &scales, &layers)
        };
        check_limits(&shape, &words, limits)?;
        let head = SceneHead { appearance, grid_masks, grid_distances, ..head_of(field, own) };
        let sky = sky_of(field);
        let parts: [&[u8]; 4] = [
            bytemuck::bytes_of(&head),
            bytemuck::cast_slice(&layers),
            bytemuck::cast_slice(&scales),
            bytemuck::cast_slice(&sky),
        ];
        let scene = parts.concat();
        words.align();
        let iterations_per_sample = iterations_per_sample(field, shape.top_k);
        Ok(Self { shape, scene, words: words.0, iterations_per_sample })
    }
}

/// The shape of `field`, with `chunks`, `component_quads` and `blocks` unset.
fn shape_of(
    field: &Field<f32>,
    precision: Precision,
    limits: BufferLimits,
    scales: &[PackedScale],
    layers: &[PackedLayer],
) -> ShaderShape {
    let decoder = &field.decoder;
    let feature_quads = decoder.features.div_ceil(4) as u32;
    ShaderShape {
        precision,
        extensions: limits.extensions,
        is_software: limits.is_software,
        chunks: 0,
        chunk_shift: limits.chunk_shift,
        scales: scales.len() as u32,
        top_k: scales.iter().map(|s| s.top_k).max().unwrap_or(1),
        layers: layers.len() as u32,
        // Sizes of shaders are those of the largest part, as arrays have constant lengths.
        inputs: layers.iter().map(|l| l.inputs).max().unwrap_or(0),
        output_quads: layers.iter().map(|l| l.output_quads).max().unwrap_or(0).max(feature_quads),
        component_quads: 0,
        blocks: 0,
        features: decoder.features as u32,
        feature_frequencies: decoder.frequencies[0],
        direction_frequencies: decoder.frequencies[1],
        has_grid: field.cells().is_some(),
        contracted: field.rules.contraction.is_some(),
        sky_degree: field.sky.as_ref().map_or(0, |sky| sky.degree),
        coverage: field.rules.coverage,
        density_reduction: field.rules.density_reduction,
        appearance_reduction: field.rules.appearance_reduction,
        aggregation: field.rules.aggregation,
        decoder_mode: decoder.mode,
        workgroup_bytes: limits.workgroup_bytes,
    }
}

/// The head of `field`, with the indices of `appearance` and of the grid unset.
fn head_of(field: &Field<f32>, own: &OwnThresholds) -> SceneHead {
    let relative = |v: glam::DVec3| (v - field.origin).to_array().map(|v| v as f32);
    let rules = &field.rules;
    let cells = field.cells();
    SceneHead {
        bounds_min: relative(field.bounds.min),
        near: field.near_far[0] as f32,
        bounds_max: relative(field.bounds.max),
        far: field.near_far[1] as f32,
        background: field.background,
        position_error: field.position_error(),
        step: rules.step as f32,
        density_shift: rules.density_shift as f32,
        depth_scale: (rules.step * rules.distance_scale) as f32,
        min_weight: rules.min_weight as f32,
        min_transmittance: rules.min_transmittance as f32,
        appearance: 0,
        grid_masks: 0,
        grid_distances: 0,
        grid_min: cells.map_or([0.0; 3], |c| c.min),
        shell: rules.contraction.map_or(0.0, |contraction| contraction.shell as f32),
        grid_cells_per_unit: cells.map_or([1.0; 3], |c| c.cells_per_unit),
        padding1: 0,
        grid_cells: cells.map_or([0; 3], |c| c.cells),
        own_min_weight: own.min_weight as f32,
        grid_bricks: cells.map_or([0; 3], |c| c.bricks),
        own_min_transmittance: own.min_transmittance as f32,
    }
}

/// \[term\] the sky's coefficients of red, green and blue; one of zeros without a sky.
fn sky_of(field: &Field<f32>) -> Vec<[f32; 4]> {
    let quad = |[r, g, b]: [f32; 3]| [r, g, b, 0.0];
    let quads = |sky: &FieldSky<f32>| sky.polynomial_coefficients().into_iter().map(quad).collect();
    field.sky.as_ref().map_or_else(|| vec![[0.0; 4]], quads)
}

/// Checks that the scene buffer and the decoder's tile are within `limits`.
fn check_limits(shape: &ShaderShape, words: &Words, limits: BufferLimits) -> Result<(), GpuError> {
    let most_quads = if limits.is_software {
        u64::from(limits.texture_rows) << TEXTURE_SHIFT
    } else {
        u64::from(limits.chunks) << limits.chunk_shift
    };
    if words.quads() > most_quads {
        let limit = 16 * most_quads;
        return Err(GpuError::TooLarge { what: "bytes of scene data", found: 16 * words.quads(), limit });
    }
    if shape.rows().is_none() {
        let (found, limit) = (u64::from(shape.tile_columns()), u64::from(limits.workgroup_bytes) / 64);
        return Err(GpuError::TooLarge { what: "components or neurons per decoder layer", found, limit });
    }
    Ok(())
}

/// The most iterations of all loops of the march per sample: over candidates, over neighbors' components, and over
/// neighbors.
fn iterations_per_sample(field: &Field<f32>, top_k: u32) -> u32 {
    let of_scale = |s: &FieldScale<f32>| {
        // An estimate from above, by which a pass stays within the loops of a software device.
        let components: usize = s.density.iter().map(|block| block_quads(block) as usize + 2).sum();
        longest_list(s) + s.top_k() * components + 3 * top_k as usize
    };
    (field.scales.iter().map(of_scale).sum::<usize>() + 1) as u32
}

/// The components of a block, in quads.
fn block_quads(block: &FieldFactors<f32>) -> u32 {
    block.held().rank().div_ceil(4) as u32
}

/// The place of a block among those of a scale on the device.
fn place_of(block: &FieldFactors<f32>) -> usize {
    match block.form() {
        Form::Cp => 0,
        Form::Vm(axis) => axis,
    }
}

/// The length of the longest candidate list.
fn longest_list(scale: &FieldScale<f32>) -> usize {
    scale.index().candidates().map(Iterator::count).max().unwrap_or(0)
}

/// Each word's lower half, then its upper half.
fn halves(words: &[u64]) -> Vec<u32> {
    words.iter().flat_map(|w| [*w as u32, (*w >> 32) as u32]).collect()
}

/// Words of four bytes each, the first lowest.
fn fours(bytes: &[u8]) -> Vec<u32> {
    let word = |part: &[u8]| part.iter().rev().fold(0, |word, &byte| word << 8 | u32::from(byte));
    bytes.chunks(4).map(word).collect()
}

/// The scene buffer under construction.
#[derive(Default)]
struct Words(Vec<u32>);

impl Words {
    fn align(&mut self) {
        self.0.resize(self.0.len().next_multiple_of(4), 0);
    }

    fn quads(&self) -> u64 {
        self.0.len().div_ceil(4) as u64
    }

    /// Appends `words` at the start of a quad. Returns the index of the first word.
    fn push(&mut self, words: &[u32]) -> u32 {
        self.align();
        let first = self.0.len() as u32;
        self.0.extend_from_slice(words);
        first
    }

    fn push_floats(&mut self, floats: &[f32]) -> u32 {
        self.push(bytemuck::cast_slice(floats))
    }

    /// Appends the candidate lists and factors of `scale`, whose first appearance quad is `first_quad`, for so many `blocks` of a
    /// scale.
    fn scale(&mut self, scale: &FieldScale<f32>, precision: Precision, blocks: usize, first_quad: u32) -> PackedScale {
        let index = scale.index();
        let (min, cells_per_unit, cells) = index.grid();
        let lists = self.push(index.lists());
        let mut starts = vec![0];
        let mut candidates: Vec<[u32; 4]> = Vec::new();
        for list in index.candidates() {
            // Center and tensor are one quad: a candidate is one load.
            candidates.extend(list.map(|([x, y, z], tensor)| [x.to_bits(), y.to_bits(), z.to_bits(), tensor]));
            starts.push(candidates.len() as u32);
        }
        let starts = self.push(&starts);
        let candidates = self.push(candidates.as_flattened()) / 4;
        let mut tensors = vec![[0; 4]; blocks * scale.len()];
        for (part, factors) in [&scale.density, &scale.appearance].into_iter().enumerate() {
            for block in factors {
                let places = self.factors(block, precision);
                for (n, place) in places.into_iter().enumerate() {
                    // A tensor has quads of the components that it holds, not of its scale's.
                    let quads = block.held().count(n).div_ceil(4) as u32;
                    tensors[blocks * n + place_of(block)][2 * part..][..2].copy_from_slice(&[place, quads]);
                }
            }
        }
        let mut first_quads = [first_quad; 3];
        for block in &scale.appearance {
            first_quads[place_of(block) + 1..].iter_mut().for_each(|first| *first += block_quads(block));
        }
        let vertices = scale.vertices();
        let [x, y, _] = scale.resolution.map(|cells| cells + 1);
        PackedScale {
            min,
            top_k: scale.top_k() as u32,
            cells_per_unit,
            lists,
            cells: cells.map(|c| c as u32),
            starts,
            half_edge: scale.half_edge,
            candidates,
            factor_cells_per_unit: vertices.cells_per_unit,
            tensors: self.push(tensors.as_flattened()) / 4,
            last_cell: vertices.last_cell.map(|c| c as u32),
            has_matrices: scale.density.iter().any(|block| block.form() != Form::Cp).into(),
            first_row: [0, x, x + y],
            padding1: 0,
            first_quads,
            padding2: 0,
        }
    }

    /// Appends a layer's weights, \[input\]\[output\], and bias, with outputs padded to quads.
    fn layer(&mut self, layer: &Dense<f32>) -> PackedLayer {
        let output_quads = layer.outputs.div_ceil(4);
        // Transposed and padded, so that a lane reads four outputs' weights of an input at once.
        let mut transposed = vec![0.0; layer.inputs * 4 * output_quads];
        for (i, row) in transposed.chunks_exact_mut(4 * output_quads.max(1)).enumerate() {
            for (o, weight) in row.iter_mut().take(layer.outputs).enumerate() {
                *weight = layer.weights[o * layer.inputs + i];
            }
        }
        let mut bias = layer.bias.clone();
        bias.resize(4 * output_quads, 0.0);
        PackedLayer {
            inputs: layer.inputs as u32,
            output_quads: output_quads as u32,
            weights: self.push_floats(&transposed) / 4,
            bias: self.push_floats(&bias) / 4,
        }
    }

    /// Appends `factors`, each row padded to quads. Returns \[tensor\] the index of its first quad of factors.
    fn factors(&mut self, factors: &FieldFactors<f32>, precision: Precision) -> Vec<u32> {
        self.align();
        let words_per_quad = if precision == Precision::F32 { 4 } else { 2 };
        let held = factors.held();
        let mut places = Vec::with_capacity(held.tensors());
        for n in 0..held.tensors() {
            places.push(self.0.len() as u32 / words_per_quad);
            for row in factors.values()[held.values(n)].chunks_exact(held.count(n).max(1)) {
                // Rows are padded to quads with zeros, so shaders need no masks.
                for quad in row.chunks(4) {
                    let mut padded = [0.0; 4];
                    padded[..quad.len()].copy_from_slice(quad);
                    match precision {
                        Precision::F32 => self.0.extend(padded.map(f32::to_bits)),
                        Precision::F16 => {
                            let [a, b, c, d] = padded.map(|v| u32::from(half_of(v)));
                            self.0.extend([a | b << 16, c | d << 16]);
                        }
                    }
                }
            }
        }
        places
    }

    /// Appends the appearance matrices, \[component\]\[feature\], with features and each block's components padded to
    /// quads. Returns the index of the first quad.
    fn appearance(&mut self, field: &Field<f32>, component_quads: u32) -> u32 {
        let decoder = &field.decoder;
        let (components, width) = (field.component_count(), decoder.features.next_multiple_of(4));
        // Transposed and padded like the layers' weights.
        let mut transposed = vec![0.0; 4 * component_quads as usize * width];
        let (mut from, mut to) = (0, 0);
        for block in field.scales.iter().flat_map(|scale| &scale.appearance) {
            let rank = block.held().rank();
            for r in 0..rank {
                for p in 0..decoder.features {
                    transposed[(to + r) * width + p] = decoder.appearance[p * components + from + r];
                }
            }
            from += rank;
            to += rank.next_multiple_of(4);
        }
        self.push_floats(&transposed) / 4
    }
}

/// The nearest 16-bit float, clamped to the finite ones.
fn half_of(value: f32) -> u16 {
    // An infinite factor could make pixels NaN.
    let largest = half::f16::MAX.to_f32();
    half::f16::from_f32(value.clamp(-largest, largest)).to_bits()
}
