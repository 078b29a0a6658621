//! A scene's numbers as the shaders read them: one array of quads, and where in it everything is.

use super::GpuError;
use super::layout::{Layer, Scale, SceneHead};
use super::shader::{Extensions, Precision, Shape};
use crate::field::{BLOCK_SHIFT, Field, FieldScale};
use crate::model::{Aggregation, Coverage, DecoderMode, Reduction};

/// What a device has limits for.
#[derive(Clone, Copy, Debug)]
pub(super) struct BufferLimits {
    /// Bindings for the scene's numbers.
    pub(super) chunks: u32,
    /// Quads of one, as a shift.
    pub(super) chunk_shift: u32,
    /// Workgroup memory, in bytes.
    pub(super) workgroup_bytes: u32,
    pub(super) extensions: Extensions,
}

/// A scene, ready for a device.
pub(super) struct Packed {
    pub(super) shape: Shape,
    /// The uniform buffer: the head, layers, scales.
    pub(super) scene: Vec<u8>,
    /// Everything else; a multiple of four words.
    pub(super) words: Vec<u32>,
    /// Turns of all loops that marching takes for a sample, at most.
    pub(super) turns_per_sample: u32,
}

impl Packed {
    /// Packs `field` for a device with `limits`.
    pub(super) fn new(field: &Field<f32>, precision: Precision, limits: BufferLimits) -> Result<Self, GpuError> {
        let BufferLimits { chunks, chunk_shift, workgroup_bytes, extensions } = limits;
        let mut words = Words::default();
        let decoder = &field.decoder;
        let quads = |components: usize| components.div_ceil(4);
        let mut first_quad = 0;
        let scales: Vec<Scale> = (field.scales.iter())
            .map(|scale| {
                let packed = words.scale(scale, precision, first_quad);
                first_quad += packed.appearance_quads;
                packed
            })
            .collect();

        let (mut grid_words, mut grid_blocks) = (0, 0);
        let cells = field.cells();
        if let Some(cells) = cells {
            grid_words = words.push(&halves(&cells.words));
            grid_blocks = words.push(&halves(&cells.block_words));
        }
        let appearance = words.appearance(field, first_quad);
        let layers: Vec<Layer> = (decoder.layers.iter())
            .map(|layer| {
                let output_quads = quads(layer.outputs);
                let mut transposed = vec![0.0; layer.inputs * 4 * output_quads];
                for (i, row) in transposed.chunks_exact_mut(4 * output_quads.max(1)).enumerate() {
                    for (o, weight) in row.iter_mut().take(layer.outputs).enumerate() {
                        *weight = layer.weights[o * layer.inputs + i];
                    }
                }
                let mut bias = layer.bias.clone();
                bias.resize(4 * output_quads, 0.0);
                Layer {
                    inputs: layer.inputs as u32,
                    output_quads: output_quads as u32,
                    weights: words.push_numbers(&transposed) / 4,
                    bias: words.push_numbers(&bias) / 4,
                }
            })
            .collect();

        let feature_quads = quads(decoder.features) as u32;
        let shape = Shape {
            precision,
            extensions,
            chunks: (words.quads().div_ceil(1 << chunk_shift)).max(1) as u32,
            chunk_shift,
            scales: scales.len() as u32,
            top_k: scales.iter().map(|s| s.top_k).max().unwrap_or(1),
            layers: layers.len() as u32,
            inputs: layers.iter().map(|l| l.inputs).max().unwrap_or(0),
            output_quads: layers.iter().map(|l| l.output_quads).max().unwrap_or(0).max(feature_quads),
            component_quads: first_quad,
            features: decoder.features as u32,
            feature_frequencies: decoder.frequencies[0],
            direction_frequencies: decoder.frequencies[1],
            block_shift: cells.map(|_| BLOCK_SHIFT as u32),
            coverage_is_all: field.rules.coverage == Coverage::All,
            density_is_mean: field.rules.density_reduction == Reduction::Mean,
            appearance_is_mean: field.rules.appearance_reduction == Reduction::Mean,
            aggregation_is_clamped: field.rules.aggregation == Aggregation::Clamped,
            decodes_samples: decoder.mode == DecoderMode::PerSample,
            samples_have_colors: decoder.mode == DecoderMode::Residual,
            workgroup_bytes,
        };
        if shape.chunks > chunks {
            let limit = u64::from(chunks) << (chunk_shift + 4);
            return Err(GpuError::TooLarge { what: "bytes of the scene", found: 16 * words.quads(), limit });
        }
        if shape.rows().is_none() {
            let (found, limit) = (u64::from(shape.tile_columns()), u64::from(workgroup_bytes) / 64);
            return Err(GpuError::TooLarge { what: "components or neurons of the decoder", found, limit });
        }
        let relative = |v: glam::DVec3| (v - field.origin).to_array().map(|v| v as f32);
        let rules = &field.rules;
        let head = SceneHead {
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
            appearance,
            grid_words,
            grid_blocks,
            grid_min: cells.map_or([0.0; 3], |c| c.min),
            padding0: 0,
            grid_cells_per_unit: cells.map_or([1.0; 3], |c| c.cells_per_unit),
            padding1: 0,
            grid_cells: cells.map_or([0; 3], |c| c.cells),
            padding2: 0,
            grid_block_counts: cells.map_or([0; 3], |c| c.blocks),
            padding3: 0,
        };
        // Of the march's inner loops: over candidates, over neighbors' components, and over neighbors.
        let of_scale = |s: &FieldScale<f32>| {
            longest_list(s) + s.top_k() * (s.density_rank.div_ceil(4) + 2) + 3 * shape.top_k as usize
        };
        let turns = field.scales.iter().map(of_scale).sum::<usize>() + 1;
        let scene = [bytemuck::bytes_of(&head), bytemuck::cast_slice(&layers), bytemuck::cast_slice(&scales)].concat();
        words.align();
        Ok(Self { shape, scene, words: words.0, turns_per_sample: turns as u32 })
    }
}

/// The most candidates that a cell has.
fn longest_list(scale: &FieldScale<f32>) -> usize {
    scale.index().candidates().map(Iterator::count).max().unwrap_or(0)
}

/// Each word's lower half, then its upper one.
fn halves(words: &[u64]) -> Vec<u32> {
    words.iter().flat_map(|w| [*w as u32, (*w >> 32) as u32]).collect()
}

/// The array while it grows.
#[derive(Default)]
struct Words(Vec<u32>);

impl Words {
    fn align(&mut self) {
        self.0.resize(self.0.len().next_multiple_of(4), 0);
    }

    fn quads(&self) -> u64 {
        self.0.len().div_ceil(4) as u64
    }

    /// Appends `words` from a quad on; returns their number.
    fn push(&mut self, words: &[u32]) -> u32 {
        self.align();
        let first = self.0.len() as u32;
        self.0.extend_from_slice(words);
        first
    }

    fn push_numbers(&mut self, numbers: &[f32]) -> u32 {
        self.push(bytemuck::cast_slice(numbers))
    }

    fn scale(&mut self, scale: &FieldScale<f32>, precision: Precision, first_quad: u32) -> Scale {
        let index = scale.index();
        let (min, cells_per_unit, cells) = index.grid();
        let lists = self.push(index.lists());
        let mut starts = vec![0];
        let mut candidates: Vec<[u32; 4]> = Vec::new();
        for list in index.candidates() {
            candidates.extend(list.map(|([x, y, z], tensor)| [x.to_bits(), y.to_bits(), z.to_bits(), tensor]));
            starts.push(candidates.len() as u32);
        }
        let starts = self.push(&starts);
        let candidates = self.push(candidates.as_flattened()) / 4;
        let rows = scale.rows();
        let mut factors = |values: &[f32], rank: usize| self.factors(values, rank, precision);
        Scale {
            min,
            top_k: scale.top_k() as u32,
            cells_per_unit,
            lists,
            cells: cells.map(|c| c as u32),
            starts,
            half: scale.half,
            candidates,
            factor_cells_per_unit: rows.cells_per_unit,
            rows: rows.count as u32,
            last_cell: rows.last_cell.map(|c| c as u32),
            density: factors(&scale.density, scale.density_rank),
            first_row: rows.first_row.map(|r| r as u32),
            appearance: factors(&scale.appearance, scale.appearance_rank),
            density_quads: scale.density_rank.div_ceil(4) as u32,
            appearance_quads: scale.appearance_rank.div_ceil(4) as u32,
            first_quad,
            padding: 0,
        }
    }

    /// Rows of `rank` components, each padded to quads; returns the first one's number, counted in quads of factors.
    fn factors(&mut self, values: &[f32], rank: usize, precision: Precision) -> u32 {
        self.align();
        let first = self.0.len() as u32;
        for row in values.chunks_exact(rank.max(1)) {
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
        match precision {
            Precision::F32 => first / 4,
            Precision::F16 => first / 2,
        }
    }

    /// The appearance matrices, [component][feature], features and each scale's components padded to quads; their first quad.
    fn appearance(&mut self, field: &Field<f32>, component_quads: u32) -> u32 {
        let decoder = &field.decoder;
        let (components, width) = (field.component_count(), decoder.features.next_multiple_of(4));
        let mut transposed = vec![0.0; 4 * component_quads as usize * width];
        let (mut from, mut to) = (0, 0);
        for scale in &field.scales {
            for r in 0..scale.appearance_rank {
                for p in 0..decoder.features {
                    transposed[(to + r) * width + p] = decoder.appearance[p * components + from + r];
                }
            }
            from += scale.appearance_rank;
            to += scale.appearance_rank.next_multiple_of(4);
        }
        self.push_numbers(&transposed) / 4
    }
}

/// The nearest number of 16 bits, at most the largest finite one.
fn half_of(value: f32) -> u16 {
    let largest = half::f16::MAX.to_f32();
    half::f16::from_f32(value.clamp(-largest, largest)).to_bits()
}
